"""Eq. (3): odd, growing with the scrub velocity, saturating, in proportion to the load."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.model.effect import PortSignals

MU, SHAPING = 0.25, 0.05

TINY = 1e-290
"""Forces [N] below which XLA may take a product for zero."""

_force = jax.jit(lambda p, signals: TyreFriction().force(p, signals, jnp.zeros(0)))


def _friction(velocity: float, load: float, mu: float = MU, shaping: float = SHAPING) -> float:
    values = {"mu_t": np.float64(mu), "ydot_Hth": np.float64(shaping)}
    return float(_force(values, PortSignals(np.float64(0.65), np.float64(velocity), np.float64(load))))


velocities = st.floats(-2.0, 2.0)
loads = st.floats(0.0, 2e4)


@given(velocity=velocities, load=loads)
def test_it_is_the_equation_of_the_paper(velocity: float, load: float) -> None:
    expected = -np.sign(velocity) * min(1.0, abs(velocity) / SHAPING) * MU * load
    assert _friction(velocity, load) == pytest.approx(expected, rel=1e-14, abs=TINY)


@given(velocity=velocities, load=loads)
def test_it_is_odd_and_opposes_the_scrub(velocity: float, load: float) -> None:
    assert _friction(velocity, load) == -_friction(-velocity, load)
    assert _friction(velocity, load) * velocity <= 0.0


@given(velocity=st.floats(SHAPING, 5.0), load=loads)
def test_it_saturates_at_the_friction_coefficient(velocity: float, load: float) -> None:
    assert _friction(velocity, load) == pytest.approx(-MU * load, rel=1e-15, abs=TINY)


@given(velocity=velocities, load=loads, factor=st.floats(0.0, 5.0))
def test_it_is_proportional_to_the_load_and_gone_with_it(velocity: float, load: float, factor: float) -> None:
    expected = factor * _friction(velocity, load)
    assert _friction(velocity, factor * load) == pytest.approx(expected, rel=1e-12, abs=TINY)
    assert _friction(velocity, 0.0) == 0.0


@given(velocity=st.floats(-0.5 * SHAPING, 0.5 * SHAPING), load=loads, factor=st.floats(0.6, 4.0))
def test_below_saturation_only_the_ratio_counts(velocity: float, load: float, factor: float) -> None:
    scaled = _friction(velocity, load, MU * factor, SHAPING * factor)
    assert scaled == pytest.approx(_friction(velocity, load), rel=1e-12, abs=TINY)
