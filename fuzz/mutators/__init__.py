"""How good files are damaged: pure functions of a content and a random generator, a file for each form."""
