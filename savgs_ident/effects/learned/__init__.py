"""Corrections that a diagnosis learned where nothing of the catalogue explains what is there."""
