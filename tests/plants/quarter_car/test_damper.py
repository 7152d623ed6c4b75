"""The damper's curve: monotone, smooth, through its table, scaled by its energy."""

import dataclasses
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.integrate import simpson

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.forces import (
    REFERENCE_VELOCITY,
    DamperCurve,
    damper_curve,
    equivalent_damping,
)
from savgs_ident.plants.quarter_car.rig import Rig


@eqx.filter_jit
def _evaluate(curve: DamperCurve, velocity: Array) -> tuple[Array, Array]:
    return jax.vmap(curve)(velocity), jax.vmap(jax.grad(lambda v: curve(v)))(velocity)


def _values(curve: DamperCurve, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(_evaluate(curve, jnp.asarray(velocity))[0])


def _slopes(curve: DamperCurve, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(_evaluate(curve, jnp.asarray(velocity))[1])


def _by_hand(curve: DamperCurve, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
    """The curve without JAX, which would compile anew for every size of table."""
    pieces = np.sum(velocity[:, None] >= curve.knots, axis=1)
    cubic, square, slope, constant = curve.coefficients[:, pieces]
    offset = velocity - curve.origins[pieces]
    return np.asarray(((cubic * offset + square) * offset + slope) * offset + constant)


def _energy_equivalent(curve: DamperCurve, amplitude: float) -> float:
    """1/(pi V) times the integral of F(V sin tau) sin tau over a cycle, by Simpson's rule between corners."""
    knots = np.asarray(curve.knots)
    corners = np.arcsin(np.unique(np.clip(np.concatenate([knots / amplitude, [-1.0, 1.0]]), -1.0, 1.0)))
    energy = 0.0
    for start, end in itertools.pairwise(corners):
        turn = np.linspace(start, end, 201)
        energy += simpson(_values(curve, amplitude * np.sin(turn)) * np.sin(turn), x=turn)
    return float(2.0 * energy / (np.pi * amplitude))


@pytest.fixture(scope="module")
def curve(rig: Rig) -> DamperCurve:
    """The curve of the shipped rig."""
    return damper_curve(rig)


def test_it_passes_through_the_table(rig: Rig, curve: DamperCurve) -> None:
    velocity, force = np.array(rig.damper_velocity), np.array(rig.damper_force)
    found = _values(curve, velocity)
    assert _by_hand(curve, velocity) == pytest.approx(found, abs=1e-15)
    scale = equivalent_damping(velocity, force, REFERENCE_VELOCITY)
    assert found * scale == pytest.approx(force, rel=1e-13, abs=1e-9)
    assert scale == pytest.approx(rig.parameters["c_sd"].value, rel=5e-3)


def test_it_never_falls_within_the_table_and_beyond(curve: DamperCurve) -> None:
    assert np.min(np.diff(_values(curve, np.linspace(-4.0, 4.0, 80_001)))) > 0.0


def test_its_slope_is_continuous_and_constant_beyond_the_table(curve: DamperCurve) -> None:
    tiny = 1e-9
    before, after = _slopes(curve, curve.knots - tiny), _slopes(curve, curve.knots + tiny)
    assert before == pytest.approx(after, rel=1e-6)
    assert _slopes(curve, np.array([-9.0, -2.0])) == pytest.approx(before[0], rel=1e-12)
    assert _slopes(curve, np.array([2.0, 9.0])) == pytest.approx(after[-1], rel=1e-12)


def test_unit_damping_takes_the_energy_of_a_unit_viscous_damper(curve: DamperCurve) -> None:
    assert _energy_equivalent(curve, REFERENCE_VELOCITY) == pytest.approx(1.0, abs=1e-9)


@st.composite
def _tables(draw: st.DrawFn) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Tables as the rig file allows them, coarse or fine, narrow or wide."""
    below = draw(st.integers(1, 4))
    above = draw(st.integers(1, 4))
    steps = draw(st.lists(st.floats(0.005, 0.5), min_size=below + above, max_size=below + above))
    rises = draw(st.lists(st.floats(0.0, 900.0), min_size=below + above, max_size=below + above))
    velocity, force = (np.concatenate([[0.0], np.cumsum(part)]) for part in (steps, rises))
    force[below + 1 :] += 50.0
    force -= force[below]
    force[:below] -= 50.0
    velocity -= velocity[below]
    return tuple(float(x) for x in velocity), tuple(float(x) for x in force)


@given(table=_tables())
def test_any_table_gives_a_monotone_curve_of_unit_damping(
    rig: Rig, table: tuple[tuple[float, ...], tuple[float, ...]]
) -> None:
    velocity, force = table
    curve = damper_curve(dataclasses.replace(rig, damper_velocity=velocity, damper_force=force))
    found = _by_hand(curve, np.linspace(-1.0, 1.0, 2001))
    assert np.min(np.diff(found)) > -1e-12
    speed = REFERENCE_VELOCITY * np.sin((np.arange(20_000) + 0.5) / 20_000 * 2.0 * np.pi)
    power = np.mean(_by_hand(curve, speed) * speed)
    assert power / (REFERENCE_VELOCITY**2 / 2.0) == pytest.approx(1.0, abs=1e-6)


def test_a_table_without_force_is_refused(rig: Rig) -> None:
    flat = dataclasses.replace(rig, damper_velocity=(-1.0, 0.0, 1.0), damper_force=(0.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r"damper table takes no energy at 0\.15 m/s"):
        damper_curve(flat)
