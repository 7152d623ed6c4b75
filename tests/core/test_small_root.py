"""Roots of small systems: found to the precision asked for, with exact slopes; one that is not found says why."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.core.small_root import Root, find_root
from savgs_ident.core.status import Status

ONE = np.ones(1)


def _square_root(of: Array) -> Root:
    return find_root(lambda x: x**2 - of, jnp.ones(1), jnp.ones(1))


def test_a_root_and_its_slopes_are_exact() -> None:
    root = jax.jit(_square_root)(2.0 * ONE)
    assert root.status() is Status.CONVERGED
    assert float(root.x[0]) == pytest.approx(np.sqrt(2.0), rel=1e-11)
    first = jax.jacfwd(lambda of: _square_root(of).x)
    second = jax.jacrev(first)
    assert float(first(2.0 * ONE)[0, 0]) == pytest.approx(0.5 / np.sqrt(2.0), rel=1e-10)
    assert float(second(2.0 * ONE)[0, 0, 0]) == pytest.approx(-0.25 / 2.0**1.5, rel=1e-10)


def test_a_root_far_above_its_typical_size_is_found_as_exactly_as_numbers_allow() -> None:
    """Numbers about a million lie further apart than the precision times one."""
    for of in np.linspace(1.9e12, 2.1e12, 20):
        root = jax.jit(_square_root)(of * ONE)
        assert root.status() is Status.CONVERGED
        assert float(root.x[0]) == pytest.approx(np.sqrt(of), rel=1e-11)


@pytest.mark.parametrize(
    ("of", "status"),
    [(2.0, Status.CONVERGED), (-2.0, Status.MAX_ITERATIONS), (np.nan, Status.NOT_FINITE)],
    ids=["a root", "none", "no number"],
)
def test_how_it_ended_is_a_status_and_a_root_that_was_not_found_is_no_number(
    of: float, status: Status
) -> None:
    root = jax.jit(_square_root)(of * ONE)
    assert root.status() is status
    assert bool(np.isfinite(root.x).all()) is status.ok


def test_of_several_roots_the_worst_counts() -> None:
    roots = jax.jit(lambda of: jax.lax.map(_square_root, of))
    assert roots(np.array([[2.0], [3.0]])).status() is Status.CONVERGED
    assert roots(np.array([[2.0], [-2.0]])).status() is Status.MAX_ITERATIONS
    assert roots(np.array([[np.nan], [-2.0]])).status() is Status.NOT_FINITE
