"""Tables, texts and pictures of a fit."""
