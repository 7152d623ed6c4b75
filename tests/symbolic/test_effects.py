"""The law of every effect in CasADi against the same in JAX: one that is added is tested at once.

What sensors do is no part of the rig's equations and is not translated.
"""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.effects.base import AbstractInputLaw, AbstractNumberLaw
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.symbolic.translate import to_casadi

from ..effects.kinds import MECHANISMS, effects_of, outcome, outcomes, seen_by
from ..in_one_test import over
from ..plants.quarter_car.instants import all_parameters, as_values

COUNT = 400


@pytest.fixture(scope="module")
def numbers(rig: Rig) -> Mapping[str, float]:
    """All parameters of the rig and of the catalogue, SI."""
    return all_parameters(rig).as_dict()


@over("effect", effects_of(*MECHANISMS, AbstractNumberLaw, AbstractInputLaw))
def test_its_law_is_the_same(effect: Effect, numbers: Mapping[str, float]) -> None:
    """Along a cycle, and from hardly moving to sliding, at loads of either sign; at its value and at its null."""
    names, rng = list(numbers), np.random.default_rng(9)
    along = seen_by(effect, as_values(numbers), seed=9)
    along = along[rng.integers(0, len(along), COUNT)]
    factor = 10.0 ** rng.uniform(-5.0, 0.0, along.shape) * rng.choice([-1.0, 1.0], along.shape)
    seen = np.where(np.arange(COUNT)[:, None] % 2, along, along * factor)

    def law(seen: Array, parameters: Array) -> Array:
        return outcome(effect, dict(zip(names, jnp.unstack(parameters), strict=True)), seen)

    p = np.array(list(numbers.values()))
    translated = to_casadi("law", law, {"seen": seen[0], "p": p}, ["law"]).map(COUNT)
    for values in (dict(numbers), dict(numbers) | dict(effect.null)):
        p = np.array([values[name] for name in names])
        expected = outcomes(effect, as_values(values), seen)
        found = np.array(translated(seen.T, np.tile(p[:, None], (1, COUNT)))).T
        largest = np.max(np.abs(expected), axis=0)
        assert np.isfinite(expected).all()
        assert np.max(np.abs(found - expected) - 1e-12 * (np.abs(expected) + largest)) <= 0.0
