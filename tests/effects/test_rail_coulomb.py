"""The rail's bristle against the play operator that it stands for: sticks, slides, does not drift."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.effects.rail_coulomb import CREEP, RailCoulomb
from savgs_ident.model.effect import PortSignals

K, C, MU, LOAD = 1e7, 3e4, 0.03, 5000.0
SLIDE = MU * LOAD
"""Force at which it slides [N]."""

VALUES = {"mu_r": np.float64(MU), "k_pre": np.float64(K), "c_pre": np.float64(C)}
STEP = 2e-5

RAIL = RailCoulomb()


@jax.jit
def _march(displacement: Array, velocity: Array, load: Array, start: Array) -> tuple[Array, Array]:
    """Force and anchor along a motion sampled every ``STEP``, by the effect's own rate, backward Euler."""

    def advance(anchor: Array, signals: PortSignals) -> tuple[Array, tuple[Array, Array]]:
        def defect(now: Array) -> Array:
            return now - anchor - STEP * RAIL.rate(VALUES, signals, now)

        now = anchor
        for _ in range(3):
            now = now - defect(now) / jax.jacfwd(defect)(now)[:, 0]
        return now, (RAIL.force(VALUES, signals, now), now[0])

    return jax.lax.scan(advance, start[None], PortSignals(displacement, velocity, load))[1]


def _follow(
    displacement: NDArray[np.float64], load: NDArray[np.float64] | float = LOAD
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    velocity = np.gradient(displacement, STEP)
    loads = np.broadcast_to(load, displacement.shape).astype(float)
    force, anchor = _march(displacement, velocity, loads, displacement[0])
    return np.asarray(force), np.asarray(anchor)


def _play(
    displacement: NDArray[np.float64], velocity: NDArray[np.float64], limit: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The law of the rig's sheet: bristle deflection follows the sliding, held in -Fc/k..Fc/k."""
    stretch, force = 0.0, np.zeros_like(displacement)
    for i in range(1, displacement.size):
        moved = stretch + displacement[i] - displacement[i - 1]
        stretch = min(max(moved, -limit[i] / K), limit[i] / K)
        force[i] = -min(max(K * stretch + C * velocity[i], -limit[i]), limit[i])
    return force


def test_a_slow_pull_sticks_with_its_stiffness_then_slides_at_the_friction_force() -> None:
    speed = 1e-4
    pulled = speed * STEP * np.arange(20_000)
    force, _ = _follow(pulled)
    sticking = pulled < 0.8 * SLIDE / K
    slope = np.polyfit(pulled[sticking][1000:], -force[sticking][1000:], 1)[0]
    assert slope == pytest.approx(K, rel=0.01)
    assert -force[pulled > 1.1 * SLIDE / K] == pytest.approx(SLIDE, rel=1e-12)


def test_pulled_back_it_takes_twice_the_presliding_to_slide_the_other_way() -> None:
    there = np.linspace(0.0, 1e-4, 50_000)
    force, _ = _follow(np.concatenate([there, there[::-1]]))
    back = force[50_000:]
    distance = (there[-1] - there)[::-1]
    turned = distance[np.argmax(back > 0.999 * SLIDE)]
    assert turned == pytest.approx(2.0 * SLIDE / K, rel=0.02)
    assert back[-1] == pytest.approx(SLIDE, rel=1e-12)


def test_below_the_friction_force_it_holds() -> None:
    """A load of 80 % that trembles for two seconds moves the anchor by the creep and no more."""
    seconds = STEP * np.arange(100_000)
    trembling = 0.8 * SLIDE / K * (1.0 + 0.2 * np.sin(2.0 * np.pi * 5.0 * seconds))
    trembling *= np.minimum(1.0, seconds / 0.1)
    _, anchor = _follow(trembling)
    assert abs(anchor[-1]) <= 1.05 * CREEP * seconds[-1] * 0.8 * SLIDE / K
    assert abs(anchor[-1]) < 0.02 * SLIDE / K


@pytest.mark.parametrize("frequency", [0.5, 2.0, 6.0])
def test_it_is_the_play_operator_of_the_sheet(frequency: float) -> None:
    """Along dwells with a changing load: the drag of the anchor and its creep do not show in the force."""
    seconds = STEP * np.arange(round(1.5 / frequency / STEP))
    turn = 2.0 * np.pi * frequency * seconds
    displacement = 0.013 * (np.sin(turn) + 0.1 * np.sin(3.0 * turn))
    velocity = np.gradient(displacement, STEP)
    load = LOAD * (1.0 + 0.3 * np.cos(turn + 0.4))
    force, _ = _follow(displacement, load)
    expected = _play(displacement, velocity, MU * load)
    assert np.max(np.abs(force - expected)[2000:]) < 0.02 * SLIDE
    assert np.sqrt(np.mean((force - expected)[2000:] ** 2)) < 2e-3 * SLIDE


@given(
    stretch=st.floats(-1e-3, 1e-3),
    velocity=st.floats(-2.0, 2.0),
    load=st.floats(0.0, 1e5),
    factor=st.floats(1.0, 10.0),
)
def test_it_is_odd_bounded_by_its_load_and_sliding_in_proportion_to_it(
    stretch: float, velocity: float, load: float, factor: float
) -> None:
    def force(stretch: float, velocity: float, load: float) -> float:
        signals = PortSignals(np.float64(stretch), np.float64(velocity), np.float64(load))
        return float(_force(signals))

    here = force(stretch, velocity, load)
    assert here == -force(-stretch, -velocity, load)
    assert abs(here) <= MU * load
    slides = abs(K * stretch + C * velocity) > MU * load * factor
    if slides:
        assert force(stretch, velocity, factor * load) == pytest.approx(factor * here, rel=1e-12, abs=1e-290)
        assert here * (K * stretch + C * velocity) <= 0.0


_force = jax.jit(lambda signals: RAIL.force(VALUES, signals, jnp.zeros(1)))


@given(amplitude=st.floats(1e-6, 2e-2), seed=st.integers(0, 1000))
def test_any_motion_loses_energy(amplitude: float, seed: int) -> None:
    """The work done on it never falls below zero, along any motion from an unstretched bristle."""
    rng = np.random.default_rng(seed)
    seconds = STEP * np.arange(4000)
    order = np.arange(1, 6)[:, None] * 12.5
    waves = rng.standard_normal((5, 1)) * np.sin(2.0 * np.pi * order * seconds)
    displacement = amplitude / 5.0 * np.sum(waves, axis=0)
    work = -np.cumsum(_follow(displacement)[0] * np.gradient(displacement, STEP)) * STEP
    held = SLIDE**2 / (2.0 * K)
    assert np.min(work) > -1e-3 * held


def test_its_null_has_the_slope_of_the_friction_to_either_side() -> None:
    """Right at mu_r = 0 the derivative is the load opposing the motion, up and down alike."""

    def force(mu: Array, velocity: float) -> Array:
        signals = PortSignals(jnp.zeros(()), jnp.asarray(velocity), jnp.asarray(LOAD))
        return RAIL.force({**VALUES, "mu_r": mu}, signals, jnp.zeros(1))

    slope = jax.grad(force)
    assert [float(slope(jnp.zeros(()), velocity)) for velocity in (0.3, -0.3)] == [-LOAD, LOAD]
    anchor = jax.grad(partial(_anchor_rate, velocity=0.3))
    assert float(anchor(jnp.zeros(()), 1e-4)) == pytest.approx(-float(anchor(jnp.zeros(()), -1e-4)))


def _anchor_rate(mu: Array, stretch: float, velocity: float) -> Array:
    signals = PortSignals(jnp.asarray(stretch), jnp.asarray(velocity), jnp.asarray(LOAD))
    return RAIL.rate({**VALUES, "mu_r": mu}, signals, jnp.zeros(1))[0]
