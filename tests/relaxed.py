"""JAX as users have it, for tests of what is too large to be written with strict numerics."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax
from jax.experimental.compilation_cache import compilation_cache

from savgs_ident.simulate.program_cache import use_persistent_cache

_RELAXED = {"jax_numpy_dtype_promotion": "standard", "jax_numpy_rank_promotion": "allow"}


@contextmanager
def as_users_have_it() -> Iterator[None]:
    """Without the strictness of other tests: solvers spread (P,) over (m, P) and count orders in integers.

    In all threads of the process; JAX's own context managers hold in their own thread only.
    """
    strict = {name: jax.config.values[name] for name in _RELAXED}
    for name, setting in _RELAXED.items():
        jax.config.update(name, setting)
    try:
        yield
    finally:
        for name, setting in strict.items():
            jax.config.update(name, setting)


@contextmanager
def with_kept_programs() -> Iterator[None]:
    """The same, with programs kept from one run to the next.

    JAX looks for its cache at the first compilation of a process, which another test may have been.
    """
    use_persistent_cache()
    compilation_cache.reset_cache()
    with as_users_have_it():
        yield
