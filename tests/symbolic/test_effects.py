"""Every effect of the catalogue in CasADi against the same in JAX: one that is added is tested at once."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.model.effect import AbstractEffect, PortSignals
from savgs_ident.symbolic.translate import to_casadi

from ..model.instants import all_parameters

COUNT = 400


@pytest.fixture(scope="module")
def numbers(rig: Rig) -> Mapping[str, float]:
    """All parameters of the rig and of the catalogue, SI."""
    return all_parameters(rig).as_dict()


@pytest.mark.parametrize("place", ["value", "null"])
@pytest.mark.parametrize("effect", CATALOGUE.values(), ids=CATALOGUE)
def test_force_and_rates_are_the_same(
    effect: AbstractEffect, numbers: Mapping[str, float], place: str
) -> None:
    """At velocities and stretches from the hardly moving to the sliding, and at loads of either sign."""
    values = numbers | (dict(effect.null) if place == "null" else {})
    names = list(values)

    def law(signals: Array, state: Array, parameters: Array) -> Array:
        p = dict(zip(names, jnp.unstack(parameters), strict=True))
        at = PortSignals(*jnp.unstack(signals))
        return jnp.concatenate([effect.force(p, at, state)[None], effect.rate(p, at, state)])

    rng = np.random.default_rng(9)
    largest = np.array([0.02, 1.0, 5000.0]) * 10.0 ** np.column_stack(
        [rng.uniform(-1.0, 0.0, COUNT), rng.uniform(-5.0, 0.0, COUNT), rng.uniform(-1.0, 0.0, COUNT)]
    )
    signals = largest * rng.uniform(-1.0, 1.0, (COUNT, 3))
    scale = np.array([state.scale for state in effect.states])
    stretch = 10.0 ** rng.uniform(-5.0, 0.0, (COUNT, 1)) * rng.standard_normal((COUNT, scale.size))
    state = signals[:, :1] + scale * stretch
    p = np.array(list(values.values()))
    expected = np.asarray(jax.vmap(law, in_axes=(0, 0, None))(signals, state, p))
    told = to_casadi("law", law, {"signals": signals[0], "state": state[0], "p": p}, ["force_and_rates"])
    found = np.array(told.map(COUNT)(signals.T, state.T, np.tile(p[:, None], (1, COUNT)))).T
    np.testing.assert_allclose(
        found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected), initial=1.0)
    )
