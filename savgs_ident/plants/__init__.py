"""Differentiable models of test rigs."""
