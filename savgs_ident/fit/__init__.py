"""Least squares on measured responses, and what they identify."""
