"""The catalogue: one unmodelled effect, one file, collected in :mod:`savgs_ident.effects.registry`."""
