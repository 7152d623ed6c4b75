"""Samplers of a posterior, one a file."""
