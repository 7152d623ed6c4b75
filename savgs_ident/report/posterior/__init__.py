"""Report of a posterior."""
