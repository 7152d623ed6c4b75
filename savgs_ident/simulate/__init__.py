"""Motions of a plant: periodic steady states and transients."""
