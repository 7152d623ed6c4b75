"""Damaged files for every loader of the package; see :mod:`fuzz.registry` for the loaders."""
