"""How fast the package is, beside its peers on the same work: ``python -m benchmarks``."""
