"""Figures and texts for people."""
