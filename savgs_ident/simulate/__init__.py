"""Motions of the rig: periodic steady states and transients."""
