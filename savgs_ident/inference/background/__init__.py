"""The background: small errors that every model has, in every hypothesis about it."""
