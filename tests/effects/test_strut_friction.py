"""Seals that stick before they slide; their anchor counts from the drawing."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.effects.strut_friction import STRETCH, StrutFriction
from savgs_ident.model.kinematics import strut_length
from savgs_ident.model.values import Values

from ..model.instants import as_values
from .laws import follow, signals

SEALS = StrutFriction()
STEP = 2e-4


@pytest.fixture(scope="module")
def p(numbers: dict[str, float]) -> Values:
    return as_values(numbers)


@pytest.fixture(scope="module")
def drawn(p: Values) -> float:
    """The strut's length in the drawing's nominal state [m]."""
    return float(strut_length(p, jnp.zeros(()), p["psi_nominal"]))


def test_as_drawn_it_neither_pushes_nor_moves_its_anchor(p: Values, drawn: float) -> None:
    """So that periodic motions and standstills begin near the anchor's own zero."""
    seen = signals(displacement=drawn)
    assert abs(float(SEALS.force(p, seen, jnp.zeros(1)))) < 1e-9
    assert abs(float(SEALS.rate(p, seen, jnp.zeros(1))[0])) < 1e-12


def test_pushed_and_pulled_it_slides_at_its_force(p: Values, drawn: float) -> None:
    force = float(p["strut_friction_force"])
    moved = 5e-3 * np.sin(2.0 * np.pi * 0.2 * STEP * np.arange(50_000))
    along = follow(SEALS, p, drawn + moved, STEP, 0.0)
    velocity = np.gradient(moved, STEP)
    turning = np.sqrt(1.0 - 0.9**2)
    sliding = np.abs(velocity) > turning * np.max(np.abs(velocity))
    past = np.arange(moved.size) > 1000
    assert along[sliding & past] == pytest.approx(-force * np.sign(velocity[sliding & past]), rel=1e-9)
    last = slice(25_000, None)
    work = -np.sum(along[last] * np.gradient(moved)[last])
    assert work == pytest.approx(4.0 * force * (5e-3 - STRETCH), rel=0.01)
