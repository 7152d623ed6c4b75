"""JAX as users have it, for tests of what is too large to be written with strict numerics."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax
from jax.experimental.compilation_cache import compilation_cache

from savgs_ident.simulate.program_cache import use_persistent_cache

_RELAXED = {"jax_numpy_dtype_promotion": "standard", "jax_numpy_rank_promotion": "allow"}
_FOLDER = "jax_compilation_cache_dir"


@contextmanager
def as_users_have_it() -> Iterator[None]:
    """Without the strictness of other tests: solvers spread (P,) over (m, P) and count orders in integers.

    In all threads of the process; JAX's own context managers hold in their own thread only. Where programs are kept
    is afterwards as it was before.
    """
    before = {name: jax.config.values[name] for name in (*_RELAXED, _FOLDER)}
    for name, setting in _RELAXED.items():
        jax.config.update(name, setting)
    try:
        yield
    finally:
        moved = jax.config.values[_FOLDER] != before[_FOLDER]
        for name, setting in before.items():
            jax.config.update(name, setting)
        if moved:
            compilation_cache.reset_cache()


@contextmanager
def with_kept_programs() -> Iterator[None]:
    """The same, with programs kept from one run to the next.

    JAX looks for its cache at the first compilation of a process, which another test may have been.
    """
    with as_users_have_it():
        use_persistent_cache()
        compilation_cache.reset_cache()
        yield
