"""Recorded tests to frequency responses: harmonics of dwells, first harmonic along sweeps."""
