"""The top of a surrogate, free or with one direction held."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.simulate.stored import placed, stored

_STEPS = 300
_TOLERANCE = 1e-5


class Top(eqx.Module):
    """Where a surrogate is highest: t (n + 2,), the log density there, and whether the search ended well."""

    t: Float[np.ndarray, " n+2"]
    value: float
    found: bool


def ascend(
    surrogate: Surrogate,
    start: Float[np.ndarray, " n+2"],
    held: Float[np.ndarray, " n+2"] | None = None,
    level: float = 0.0,
) -> Top:
    """The highest point of ``surrogate`` from ``start``; with ``held . t = level`` if a direction is held.

    Points are in standard deviations of the surrogate's coordinates t [1].
    """
    direction = np.zeros_like(start) if held is None else held / np.linalg.norm(held)
    place = 0.0 if held is None else level / float(np.linalg.norm(held))
    args = placed((surrogate, jnp.asarray(start), jnp.asarray(direction), jnp.asarray(place)))
    t, value, found = _searched(*args)
    return Top(np.asarray(t), float(value), bool(found) and bool(np.isfinite(value)))


@eqx.filter_jit
def _searched(*args: Any) -> tuple[Array, ...]:
    return stored(_search, *args)


def _search(surrogate: Surrogate, start: Array, direction: Array, place: Array) -> tuple[Array, ...]:
    def on_plane(t: Array) -> Array:
        return t + direction * (place - direction @ t)

    def depth(t: Array, _: None) -> Array:
        return -surrogate(on_plane(t))

    solver: Any = optx.BFGS(rtol=_TOLERANCE, atol=_TOLERANCE)
    found: Any = optx.minimise(depth, solver, start, None, max_steps=_STEPS, throw=False)
    t = on_plane(found.value)
    return t, surrogate(t), jnp.asarray(found.result == optx.RESULTS.successful)
