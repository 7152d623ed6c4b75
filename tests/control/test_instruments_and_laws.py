"""What stands between rig and controller: steps and noise of the instruments, the law's recursion and its guards."""

import control
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.signal import dlsim

from savgs_ident.control.closed_loop.laws import (
    ENDS,
    GUARD_RATE,
    JUMP,
    KINDS,
    NOTHING,
    AbstractControlLaw,
    HinfLaw,
    hinf_law,
    hold_law,
    ideal_instruments,
    make_failure,
    sheet_instruments,
)
from savgs_ident.control.design import DigitalController
from savgs_ident.control.linear_equivalent import AlphaMap, equivalents
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.plant import QuarterCar

from ..in_one_test import over

GEAR = 40.0
SAMPLE = 1e-3
FASTEST = 100.0 * np.pi / GEAR * SAMPLE
"""What a motor at 3000 rpm turns the link in a sample [rad]."""

NOMINAL = np.pi / 2.0

A = np.array([[0.9, 0.2], [-0.1, 0.7]])
B = np.array([[0.02, -3.0, 5.0], [0.01, 2.0, -4.0]])
C = np.array([[0.5, -0.3]])
D = np.array([[0.004, 0.2, -0.7]])

_read = jax.jit(lambda instruments, truth, normal: instruments.read(truth, normal))
_command = jax.jit(lambda law, state, readings, fastest: law.command(state, readings, fastest))


def by_hand(gain: float = 1.0) -> HinfLaw:
    """The law of a small controller whose numbers were chosen, on a rig whose alpha is a parabola."""
    space = control.ss(A, B, gain * C, gain * D, SAMPLE)
    alpha = AlphaMap(jnp.asarray(NOMINAL), jnp.array([-0.016, 0.001, 0.006]))
    return hinf_law(DigitalController(space, alpha))


@jax.jit
def _follow(law: AbstractControlLaw, readings: Array) -> tuple[Array, Array]:
    def one(state: Array, reading: Array) -> tuple[Array, tuple[Array, Array]]:
        after, asked = law.command(state, reading, jnp.asarray(FASTEST))
        return after, (after, asked)

    return jax.lax.scan(one, law.start(), readings)[1]


def follow(
    law: AbstractControlLaw, readings: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States after, and velocities asked at, each of the readings (n, 3), from the law's start."""
    states, asked = _follow(law, jnp.asarray(readings))
    return np.asarray(states), np.asarray(asked)


def small_readings(count: int = 200) -> NDArray[np.float64]:
    """A quiet rig: noise in acceleration and deflection, a link that swings slowly by 0.3 rad."""
    chance = np.random.default_rng(3)
    angle = NOMINAL + 0.3 * np.sin(0.02 * np.arange(count))
    return np.column_stack([chance.normal(0.0, 0.2, count), chance.normal(0.0, 1e-3, count), angle])


@given(truth=st.tuples(st.floats(-30.0, 30.0), st.floats(-0.1, 0.1), st.floats(0.0, 3.1)))
def test_a_reading_is_a_whole_number_of_steps_and_the_nearest(truth: tuple[float, float, float]) -> None:
    instruments, exact = sheet_instruments(GEAR), np.array(truth)
    step = np.asarray(instruments.step)
    read = np.asarray(_read(instruments, jnp.asarray(exact), jnp.zeros(3)))
    assert read / step == pytest.approx(np.round(read / step), abs=1e-6)
    assert np.all(np.abs(read - exact) <= 0.5 * step * (1.0 + 1e-6))


def test_the_steps_are_those_of_the_converters_and_of_the_encoder() -> None:
    found = np.asarray(sheet_instruments(GEAR).step)
    assert found == pytest.approx([20.0 * 9.81 / 2**16, 0.3 / 2**16, 2.0 * np.pi / 65536.0 / GEAR])


def test_the_noise_has_the_deviation_of_the_sheet_and_that_of_the_rounding() -> None:
    instruments, count = sheet_instruments(GEAR), 40_000
    normal = jnp.asarray(np.random.default_rng(0).standard_normal((count, 3)))
    truth = jnp.array([0.37, 1.234e-3, 1.3])
    read = np.asarray(jax.jit(jax.vmap(instruments.read, (None, 0)))(truth, normal))
    expected = np.sqrt(np.array([0.05, 1e-4]) ** 2 + np.asarray(instruments.step[:2]) ** 2 / 12.0)
    # Four deviations of what so many samples tell.
    assert np.std(read[:, :2], axis=0) == pytest.approx(expected, rel=4.0 / np.sqrt(2.0 * count))
    away = np.mean(read[:, :2], axis=0) - np.asarray(truth[:2])
    assert np.all(np.abs(away) < 4.0 * expected / np.sqrt(count))
    assert np.ptp(read[:, 2]) == 0.0


@given(
    truth=st.tuples(*[st.floats(-30.0, 30.0, allow_subnormal=False)] * 3),
    normal=st.tuples(*[st.floats(-4.0, 4.0)] * 3),
)
def test_ideal_instruments_show_the_truth(
    truth: tuple[float, float, float], normal: tuple[float, float, float]
) -> None:
    read = _read(ideal_instruments(), jnp.asarray(truth), jnp.asarray(normal))
    assert np.asarray(read).tolist() == list(truth)


@over("kind", KINDS)
def test_a_failure_changes_nothing_before_its_time_and_what_it_is_named_for_after(kind: str) -> None:
    failure, readings = make_failure(kind, 2.0), jnp.array([1.0, 2.0, 3.0])
    before, after = jnp.asarray(1.999), jnp.asarray(2.0)
    assert np.asarray(failure.shown(before, readings)).tolist() == [1.0, 2.0, 3.0]
    assert float(failure.drive_at(before)) == 1.0
    lost = ("accelerometer", "potentiometer", "encoder")
    left = [0.0 if kind == name else number for name, number in zip(lost, (1.0, 2.0, 3.0), strict=True)]
    assert np.asarray(failure.shown(after, readings)).tolist() == left
    weaker = kind in ("actuator-off", "actuator-weak")
    assert (float(failure.drive_at(after)) < 1.0) == weaker
    assert (kind == NOTHING) == (left == [1.0, 2.0, 3.0] and not weaker)


def test_a_held_link_comes_back_as_a_loop_of_ten_hertz_and_asks_nothing_at_its_place() -> None:
    law = hold_law(jnp.asarray(NOMINAL), 1.0 / SAMPLE)
    angle, count = NOMINAL + 0.1, 50
    for _ in range(count):
        _, asked = _command(law, law.start(), jnp.array([3.0, 0.1, angle]), jnp.asarray(FASTEST))
        angle += float(asked) * SAMPLE
    left = 0.1 * (1.0 - 2.0 * np.pi * 10.0 * SAMPLE) ** count
    assert angle - NOMINAL == pytest.approx(left, rel=1e-9)
    _, asked = _command(law, law.start(), jnp.array([3.0, 0.1, NOMINAL]), jnp.asarray(FASTEST))
    assert float(asked) == 0.0


def test_between_the_guards_a_command_is_met_within_half_a_per_cent(
    controller: DigitalController, friction: QuarterCar, numbers: Values
) -> None:
    """The velocity of z_lin that the link makes of one is alpha over the law's polynomial."""
    angles = jnp.linspace(*ENDS, 281)
    exact = np.asarray(equivalents(friction, numbers, jnp.zeros(281), angles).alpha)
    assert np.asarray(jax.vmap(controller.alpha.alpha)(angles)) == pytest.approx(exact, rel=0.005)


def test_the_recursion_is_that_of_the_state_space_and_the_command_is_divided_by_alpha() -> None:
    law, readings = by_hand(), small_readings()
    states, asked = follow(law, readings)
    seen = readings.copy()
    turned = readings[:, 2] - NOMINAL
    seen[:, 2] = turned * (-0.016 + turned * (0.0005 + turned * 0.002))
    alpha = -0.016 + turned * (0.001 + turned * 0.006)
    _, commands, inner = dlsim((A, B, C, D, SAMPLE), seen)
    assert asked * alpha == pytest.approx(commands[:, 0], rel=1e-10, abs=1e-14)
    assert states[:-1, :2] == pytest.approx(inner[1:], rel=1e-10, abs=1e-14)
    response = control.forced_response(control.ss(A, B, C, D, SAMPLE), inputs=seen.T)
    assert asked * alpha == pytest.approx(np.ravel(response.outputs), rel=1e-10, abs=1e-14)
    assert np.std(asked) > 0.1


@given(
    angle=st.one_of(st.floats(-0.5, ENDS[0]), st.floats(ENDS[1], 3.6)),
    inner=st.tuples(*[st.floats(-100.0, 100.0)] * 2),
    readings=st.tuples(st.floats(-50.0, 50.0), st.floats(-0.1, 0.1)),
)
def test_beyond_an_end_the_link_is_never_asked_further_out(
    angle: float, inner: tuple[float, float], readings: tuple[float, float]
) -> None:
    law = by_hand()
    state = jnp.array([*inner, angle, 0.0])
    _, asked = _command(law, state, jnp.array([*readings, angle]), jnp.asarray(FASTEST))
    assert float(asked) * np.sign(angle - NOMINAL) <= 0.0


@given(seed=st.integers(0, 10_000), gain=st.floats(0.0, 30.0), angle=st.floats(*ENDS))
def test_a_link_that_follows_never_passes_an_end(seed: int, gain: float, angle: float) -> None:
    """Whatever the controller asks, and whatever acceleration and deflection are."""
    law, chance = by_hand(gain), np.random.default_rng(seed)
    state = law.start().at[2].set(angle)
    for _ in range(40):
        readings = jnp.array([chance.normal(0.0, 10.0), chance.normal(0.0, 0.03), angle])
        state, asked = _command(law, state, readings, jnp.asarray(1.0))
        angle += float(asked) * SAMPLE
        assert ENDS[0] - 1e-12 <= angle <= ENDS[1] + 1e-12


@pytest.mark.parametrize("end", ENDS)
def test_towards_an_end_the_link_is_asked_ever_slower(end: float) -> None:
    """A controller that pushes outward for ever leaves exp(-6 pi t) of the way."""
    law = by_hand(1e4)
    outward = float(np.sign(end - NOMINAL))
    angle, count, way = end - 0.2 * outward, 200, 0.2
    state = law.start().at[2].set(angle)
    push = -outward * 50.0 / float(D[0, 0])
    for _ in range(count):
        # alpha is negative: a negative command turns the link to greater angles.
        state = state.at[:2].set(0.0)
        state, asked = _command(law, state, jnp.array([push, 0.0, angle]), jnp.asarray(1.0))
        angle += float(asked) * SAMPLE
    assert abs(end - angle) == pytest.approx(way * (1.0 - GUARD_RATE * SAMPLE) ** count, rel=1e-9)
    assert (1.0 - GUARD_RATE * SAMPLE) ** count == pytest.approx(np.exp(-6.0 * np.pi * 0.2), rel=0.05)


@given(jump=st.floats(-1.5, 1.5).filter(lambda jump: abs(abs(jump) - JUMP * FASTEST) > 1e-9))
def test_only_an_angle_that_jumps_is_disbelieved_and_for_good(jump: float) -> None:
    law, readings = by_hand(), small_readings(60)
    readings[:, 2] = NOMINAL
    true, _ = follow(law, readings)
    jumped = readings.copy()
    jumped[30, 2] += jump
    states, asked = follow(law, jumped)
    assert states[:30] == pytest.approx(true[:30])
    if abs(jump) > JUMP * FASTEST:
        # The angle comes back, belief in it does not.
        assert np.all(asked[30:] == 0.0)
        assert np.all(states[30:, 2] == readings[29, 2])
    else:
        assert np.any(asked[30:] != 0.0)
        assert states[-1, 2] == readings[-1, 2]
    assert np.all(np.isfinite(states))


def test_a_motor_at_its_limit_is_believed() -> None:
    """Turning as fast as it can for a tenth of a second, and 5 % faster, as it does for moments."""
    readings = np.zeros((100, 3))
    readings[:, 2] = NOMINAL - 0.4 + 1.05 * FASTEST * np.arange(100)
    law = by_hand()
    state = law.start().at[2].set(readings[0, 2])
    for reading in readings:
        state, asked = _command(law, state, jnp.asarray(reading), jnp.asarray(FASTEST))
    assert float(state[3]) == 0.0
    assert float(asked) != 0.0
