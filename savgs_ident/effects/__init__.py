"""Effects: laws that are written once, for any port of the right kind, of any plant."""
