"""Diagnosis of a servo axis from its published recordings."""
