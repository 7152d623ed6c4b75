"""The stabilised step: of order two, stable where it says so, and accurate beside what it does not follow."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.linalg import expm

from savgs_ident.control.closed_loop.run import stabilised_step

MILLISECOND = 1e-3
FASTEST = 9_800.0
"""Decay [1/s] that a step of a millisecond has to bear."""

Field = Callable[[Array, Array], Array]


def march(field: Field, start: NDArray[np.float64], end: float, count: int) -> NDArray[np.float64]:
    """The state at ``end`` after ``count`` equal steps from time 0."""
    step = jnp.asarray(end / count)

    @jax.jit
    def all_steps(state: Array) -> Array:
        def one(now: Array, number: Array) -> tuple[Array, None]:
            t = number * step
            after, _ = stabilised_step(lambda t, x, near: field(t, x), t, now, field(t, now), step)
            return after, None

        return jax.lax.scan(one, state, jnp.arange(count, dtype=jnp.float64))[0]

    return np.asarray(all_steps(jnp.asarray(start)))


def errors(
    field: Field, start: NDArray[np.float64], end: float, truth: NDArray[np.float64], counts: tuple[int, ...]
) -> NDArray[np.float64]:
    """Distances from the truth with so many steps."""
    return np.array([np.linalg.norm(march(field, start, end, count) - truth) for count in counts])


def left_of(decays: NDArray[np.float64], step: float = MILLISECOND) -> NDArray[np.float64]:
    """What a step leaves of motions that decay at these rates [1/s]."""
    rates = jnp.asarray(-decays)
    return march(lambda t, x: rates * x, np.ones(decays.size), step, 1)


def spiral(t: Array, x: Array) -> Array:
    """z' = z (1 - |z|^2) + i z |z|^2."""
    square = x @ x
    return (1.0 - square) * x + square * jnp.stack([-x[1], x[0]])


def test_the_error_of_a_nonlinear_motion_falls_fourfold_with_half_the_step() -> None:
    """|z|^2 = 1 / (1 + c exp(-2 t)), and the angle is the integral of it."""
    outside, end = 3.0, 2.0
    radius = 1.0 / np.sqrt(1.0 + outside * np.exp(-2.0 * end))
    angle = 0.5 * np.log((np.exp(2.0 * end) + outside) / (1.0 + outside))
    truth = radius * np.array([np.cos(angle), np.sin(angle)])
    found = errors(spiral, np.array([0.5, 0.0]), end, truth, (40, 80, 160, 320))
    assert found[:-1] / found[1:] == pytest.approx(np.full(3, 4.0), rel=0.05)
    assert found[-1] < 1e-5


def test_the_error_of_a_driven_motion_falls_fourfold_with_half_the_step() -> None:
    """y' = 2 t y has exp(t^2): the field at a stage is that of the stage's time."""
    found = errors(lambda t, y: 2.0 * t * y, np.ones(1), 1.0, np.array([np.e]), (20, 40, 80, 160))
    assert found[:-1] / found[1:] == pytest.approx(np.full(3, 4.0), rel=0.1)


@jax.jit
def _linear_rate(first: Array, second: Array, begin: Array, step: Array) -> Array:
    def field(t: Array, x: Array, near: Array) -> Array:
        return jnp.reshape(first + second * t, (1,))

    start = jnp.zeros(1)
    end, _ = stabilised_step(field, begin, start, field(begin, start, start), step)
    return end[0]


@given(first=st.floats(-5.0, 5.0), second=st.floats(-5.0, 5.0), begin=st.floats(-3.0, 3.0))
def test_a_rate_that_runs_linearly_is_integrated_exactly(first: float, second: float, begin: float) -> None:
    step = 0.7
    end = float(_linear_rate(*jnp.asarray([first, second, begin, step])))
    assert end == pytest.approx((first + second * (begin + 0.5 * step)) * step, abs=1e-12)


def test_a_small_step_is_the_exponential_up_to_the_third_power() -> None:
    """And no further: it is of order two, so that the third power can be seen to be another."""
    sizes = np.array([0.2, 0.1, 0.05])
    left = (left_of(sizes, 1.0) - np.exp(-sizes)) / sizes**3
    assert np.ptp(left) < 0.2 * np.abs(left[-1])
    assert 0.01 < abs(left[-1]) < 1.0 / 6.0


def test_no_decay_up_to_the_fastest_grows() -> None:
    assert np.max(np.abs(left_of(np.linspace(1.0, FASTEST, 20_001)))) < 1.0


def test_what_is_fast_is_gone_soon() -> None:
    """Not merely not growing: of any decay beyond 100/s less than a tenth is left after 0.1 s."""
    assert np.max(np.abs(left_of(np.linspace(100.0, FASTEST, 20_001)))) ** 100 < 0.1


def test_faster_decays_do_grow_so_that_the_promise_is_no_understatement() -> None:
    assert abs(left_of(np.array([1.02 * FASTEST]))[0]) > 1.0


def linear_errors(slopes: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of x' = slopes x after half a second of steps of 1, 0.5 and 0.25 ms."""
    matrix = jnp.asarray(slopes)
    truth = expm(0.5 * slopes) @ start
    return errors(lambda t, x: matrix @ x, start, 0.5, truth, (500, 1000, 2000))


@pytest.mark.slow
@pytest.mark.parametrize("decay", [1000.0, 3000.0, 5000.0, FASTEST])
@pytest.mark.parametrize("force", [0.0, 1.0])
def test_beside_a_fast_decay_the_slow_part_is_as_accurate_as_alone(decay: float, force: float) -> None:
    """A damped oscillation of 2 Hz whose force follows its place with a decay; it need not be there at the start."""
    square, start = (4.0 * np.pi) ** 2, np.array([1.0, 0.0, force])
    alone = linear_errors(np.array([[0.0, 1.0], [-square, -1.0]]), start[:2])
    slopes = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, -square], [decay, 0.0, -decay]])
    found = linear_errors(slopes, start)
    assert found[:-1] / found[1:] == pytest.approx(np.full(2, 4.0), rel=0.02)
    assert np.all(found < 1.05 * alone)
