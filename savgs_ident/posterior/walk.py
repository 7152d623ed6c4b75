"""Walks on a surrogate that leave it as it is: what emcee's proposals are made of.

Preconditioned Crank-Nicolson steps t' = sqrt(1 - b^2) t + b xi are reversible with respect to the unit
normal; accepting them by the ratio of the surrogate to that normal makes them reversible with respect to the
surrogate. The length b of every step is drawn anew: all steps are then the same kernel, and any number of them
one after the other is reversible too. (Lengths in a fixed order would not be: backwards is another order.)
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.simulate.stored import placed, stored

STEPS = 60
"""Steps of one walk: enough to forget where it began."""

LENGTHS = (0.2, 0.5, 0.8)
"""The b of steps, drawn at random: long ones travel, short ones get through where the surrogate is not normal."""


def walk(
    surrogate: Surrogate, seed: int, start: Float[np.ndarray, "W n+2"], rounds: int = 1
) -> tuple[Float[np.ndarray, "W n+2"], Float[np.ndarray, " W"], Float[np.ndarray, " W"]]:
    """Walks of ``rounds`` times :data:`STEPS` steps from ``start`` (W, n + 2) in t.

    Gives where they end, and the surrogate's log density at the start and there, (W,).
    """
    key = jax.random.PRNGKey(seed)
    args = placed((surrogate, key, jnp.asarray(start), jnp.asarray(rounds * STEPS)))
    end, before, after = _walked(*args)
    return np.asarray(end), np.asarray(before), np.asarray(after)


@eqx.filter_jit
def _walked(*args: Any) -> tuple[Array, ...]:
    return stored(_walk, *args)


def _walk(surrogate: Surrogate, key: Array, start: Array, steps: Array) -> tuple[Array, ...]:
    density = jax.vmap(surrogate)

    def step(count: Array, at: tuple[Array, Array]) -> tuple[Array, Array]:
        t, value = at
        to_choose, to_move, to_decide = jax.random.split(jax.random.fold_in(key, count), 3)
        length = jax.random.choice(to_choose, jnp.asarray(LENGTHS), (value.size, 1))
        moved = jnp.sqrt(1.0 - length**2) * t + length * jax.random.normal(to_move, t.shape)
        there = density(moved)
        ratio = there - value + 0.5 * (jnp.sum(moved**2, axis=1) - jnp.sum(t**2, axis=1))
        taken = jnp.log(jax.random.uniform(to_decide, value.shape)) < ratio
        return jnp.where(taken[:, None], moved, t), jnp.where(taken, there, value)

    begin = density(start)
    end, value = jax.lax.fori_loop(0, steps, step, (start, begin))
    return end, begin, value
