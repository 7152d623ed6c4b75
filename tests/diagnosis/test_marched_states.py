"""States that are marched along port signals until they repeat."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from savgs_ident.diagnosis import effect_sensitivities

INSTANTS, STEP, MOST = 40, 0.025, 16


@partial(jax.jit, static_argnums=2)
def _marched(signals: Array, times: Array, most: int) -> Array:
    """A state that follows a signal within a time of its own; both are seen at every instant."""

    def defect(now: Array, before: Array, at: tuple[Array, Array], step: Array) -> Array:
        signal, within = at
        return (now - before) / step - (signal - now) / within

    def output(now: Array, before: Array, at: tuple[Array, Array], step: Array) -> Array:
        del before, at, step
        return now

    every = signals, jnp.broadcast_to(times[:, None], signals.shape)
    steps = jnp.full(times.size, STEP)
    return effect_sensitivities._repeat(defect, output, 1, every, steps, most)


def test_what_forgets_slowly_is_marched_as_long_as_may_be_beside_what_repeats_at_once() -> None:
    """Against the implicit rule of Euler, all periods marched out by hand."""
    turns = np.arange(INSTANTS) / INSTANTS
    signals = np.stack([np.cos(2.0 * np.pi * turns), 1.0 + np.sin(2.0 * np.pi * turns)])
    times = np.array([0.02, 8.0])
    state, wanted = np.zeros(2), np.zeros_like(signals)
    for _ in range(MOST):
        for i in range(INSTANTS):
            state = (state + STEP / times * signals[:, i]) / (1.0 + STEP / times)
            wanted[:, i] = state
    found = np.asarray(_marched(jnp.asarray(signals), jnp.asarray(times), MOST))[..., 0]
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-8)
    # Of the slow one a period less would show, and it has not come to rest.
    less = np.asarray(_marched(jnp.asarray(signals), jnp.asarray(times), MOST - 1))[..., 0]
    assert np.max(np.abs(less[0] - wanted[0])) < 1e-8
    assert np.max(np.abs(less[1] - wanted[1])) > 1e-2
