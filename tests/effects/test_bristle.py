"""The bristle against the play operator that it stands for: sticks, slides, does not drift."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.effects.base import (
    CREEP,
    Bristle,
    FrictionLimit,
    PortSignals,
    Presliding,
    bristle,
    held_within,
)

K, C, SLIDE = 1e7, 3e4, 150.0
"""Stiffness [N/m], damping [N s/m] and the force at which it slides [N]."""

STEP = 2e-5


def _at(seen: PortSignals, grip: Array, anchor: Array) -> Bristle:
    """With the same grip both ways."""
    return bristle(Presliding(jnp.asarray(K), jnp.asarray(C)), seen, FrictionLimit(grip, grip), anchor)


@jax.jit
def _march(displacement: Array, velocity: Array, grip: Array, start: Array) -> tuple[Array, Array]:
    """Force and anchor along a motion sampled every ``STEP``, by the bristle's own rate, backward Euler."""

    def advance(anchor: Array, at: tuple[Array, Array, Array]) -> tuple[Array, tuple[Array, Array]]:
        seen = PortSignals(at[0], at[1], jnp.zeros(()), jnp.zeros(()))

        def defect(now: Array) -> Array:
            return now - anchor - STEP * _at(seen, at[2], now).rate

        now = anchor
        for _ in range(3):
            now = now - defect(now) / jax.grad(defect)(now)
        return now, (_at(seen, at[2], now).force, now)

    return jax.lax.scan(advance, start, (displacement, velocity, grip))[1]


def _follow(
    displacement: NDArray[np.float64], grip: NDArray[np.float64] | float = SLIDE
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    velocity = np.gradient(displacement, STEP)
    grips = np.broadcast_to(grip, displacement.shape).astype(float)
    force, anchor = _march(displacement, velocity, grips, displacement[0])
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
    """Along dwells with a changing grip: the drag of the anchor and its creep do not show in the force."""
    seconds = STEP * np.arange(round(1.5 / frequency / STEP))
    turn = 2.0 * np.pi * frequency * seconds
    displacement = 0.013 * (np.sin(turn) + 0.1 * np.sin(3.0 * turn))
    velocity = np.gradient(displacement, STEP)
    grip = SLIDE * (1.0 + 0.3 * np.cos(turn + 0.4))
    force, _ = _follow(displacement, grip)
    expected = _play(displacement, velocity, grip)
    assert np.max(np.abs(force - expected)[2000:]) < 0.02 * SLIDE
    assert np.sqrt(np.mean((force - expected)[2000:] ** 2)) < 2e-3 * SLIDE


_force = jax.jit(
    lambda seen, up, down, anchor: bristle(Presliding(K, C), seen, FrictionLimit(up, down), anchor).force
)
grips = st.floats(0.0, 1e4, allow_subnormal=False)


@given(
    stretch=st.floats(-1e-3, 1e-3),
    velocity=st.floats(-2.0, 2.0),
    up=grips,
    down=grips,
    factor=st.floats(1.0, 10.0),
)
def test_it_resists_up_and_down_by_their_own_grips(
    stretch: float, velocity: float, up: float, down: float, factor: float
) -> None:
    def force(stretch: float, velocity: float, up: float, down: float) -> float:
        seen = PortSignals(*(np.float64(each) for each in (stretch, velocity, 0.0, 0.0)))
        return float(_force(seen, np.float64(up), np.float64(down), np.float64(0.0)))

    here = force(stretch, velocity, up, down)
    assert -up <= here <= down
    assert here == -force(-stretch, -velocity, down, up)
    if max(up, down) * factor < abs(K * stretch + C * velocity):
        more = force(stretch, velocity, factor * up, factor * down)
        assert more == pytest.approx(factor * here, rel=1e-12, abs=1e-290)


def test_a_grip_below_zero_holds_nothing() -> None:
    seen = PortSignals(jnp.asarray(1e-3), jnp.asarray(0.1), jnp.zeros(()), jnp.zeros(()))
    held = bristle(Presliding(K, C), seen, FrictionLimit(jnp.asarray(-5.0), jnp.asarray(20.0)), jnp.zeros(()))
    assert float(held.force) == 0.0


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


def test_limits_that_meet_let_through_the_slope_of_the_limit() -> None:
    """At a grip of zero, where ``jnp.clip`` would halve it."""

    def held(grip: Array, x: float) -> Array:
        return held_within(jnp.asarray(x), -grip, grip)

    assert [float(jax.grad(held)(jnp.zeros(()), x)) for x in (0.3, -0.3)] == [1.0, -1.0]


def test_the_rate_of_the_anchor_has_the_slope_of_the_grip_at_its_null() -> None:
    """Dragged less the more it grips, the same to either side."""

    def rate(grip: Array, stretch: float) -> Array:
        seen = PortSignals(jnp.asarray(stretch), jnp.asarray(0.3), jnp.zeros(()), jnp.zeros(()))
        return _at(seen, grip, jnp.zeros(())).rate

    there, back = (float(jax.grad(rate)(jnp.zeros(()), stretch)) for stretch in (1e-4, -1e-4))
    assert there == -back
    assert there < 0.0
