"""Thin commands around the stages."""
