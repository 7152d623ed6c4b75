"""CSV and MCAP recordings to immutable, checked campaigns in SI."""
