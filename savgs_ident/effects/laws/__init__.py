"""The laws, one a file; each can act at any port of its kind."""
