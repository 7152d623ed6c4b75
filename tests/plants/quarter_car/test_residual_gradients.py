"""The residual's derivative in every parameter of the rig file, and what the residual is made of."""

from collections import Counter
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.dynamics import TRAVEL, Section, section, section_curves
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from ..primitives import MAPPABLE, TABLE_LOOK_UP, primitives_of
from .instants import as_values, draw_instants, inputs_of, motion_of, shifted

COUNT = 40
FORCE = 5e3
"""Size of the forces in the rig [N]."""

ELSEWHERE = ("accel_gain", "deflection_gain", "cam_peak_to_peak", "psi_nominal")
"""Parameters of sensors, road and reference, which the equations of motion do not know."""

Residuals = Callable[[Values], NDArray[np.float64]]


def _residual(model: QuarterCar, p: Values, instant: Array, stretch: Array) -> Array:
    anchor = (instant[0] - stretch)[None]
    return model.residual(p, motion_of(instant), anchor, jnp.zeros(1), inputs_of(instant))


@pytest.fixture(scope="module")
def instants() -> NDArray[np.float64]:
    """Where derivatives are compared."""
    return draw_instants(21, COUNT)


@pytest.fixture(scope="module")
def stretches() -> NDArray[np.float64]:
    """Stretches of the rail's bristle [m] on either side of where it slides."""
    return np.random.default_rng(22).uniform(-4e-5, 4e-5, COUNT)


@pytest.fixture(scope="module")
def residuals(simtr: QuarterCar, instants: NDArray[np.float64], stretches: NDArray[np.float64]) -> Residuals:
    """Residuals of SimTR at the instants (COUNT, 3)."""

    @jax.jit
    def at(p: Values) -> Array:
        return jax.vmap(lambda instant, stretch: _residual(simtr, p, instant, stretch))(instants, stretches)

    return lambda p: np.asarray(at(p))


@pytest.fixture(scope="module")
def slopes(
    simtr: QuarterCar,
    numbers: dict[str, float],
    instants: NDArray[np.float64],
    stretches: NDArray[np.float64],
) -> dict[str, NDArray[np.float64]]:
    """Derivatives of the residuals in each parameter, (COUNT, 3)."""

    @jax.jit
    def along(p: Values, direction: Values) -> Array:
        def at(q: Values) -> Array:
            return jax.vmap(lambda instant, stretch: _residual(simtr, q, instant, stretch))(
                instants, stretches
            )

        return jax.jvp(at, (p,), (direction,))[1]

    p, still = as_values(shifted(numbers, 7)), as_values(dict.fromkeys(numbers, 0.0))
    return {name: np.asarray(along(p, still | {name: np.asarray(1.0)})) for name in numbers}


@pytest.mark.slow
def test_every_parameter_of_the_drawing_counts_and_no_other(
    rig: Rig, slopes: dict[str, NDArray[np.float64]]
) -> None:
    expected = {
        name for name in rig.parameters if not name.startswith(("motor_", "servo_")) and name not in ELSEWHERE
    }
    assert {name for name in rig.parameters if np.any(slopes[name] != 0.0)} == expected


@pytest.mark.slow
def test_derivatives_in_every_parameter_are_those_of_differences(
    rig: Rig,
    numbers: dict[str, float],
    residuals: Residuals,
    slopes: dict[str, NDArray[np.float64]],
) -> None:
    """Central differences of fourth order; instants at which a friction changes sides within are left out."""
    moved = shifted(numbers, 7)
    left_out = 0
    for name in rig.parameters:
        step = 2e-5 if name.endswith(("_y", "_z")) else 2e-5 * abs(moved[name])

        def at(offset: float, name: str = name) -> NDArray[np.float64]:
            return residuals(as_values(moved | {name: moved[name] + offset}))

        near, far = at(step) - at(-step), at(2.0 * step) - at(-2.0 * step)
        expected = (8.0 * near - far) / (12.0 * step)
        size = np.max(np.abs(slopes[name]), axis=0)
        rounding = np.array([FORCE, FORCE, 1.0]) * 1e-13 / step
        smooth = np.abs(far - 2.0 * near) / (4.0 * step) < 1e-4 * size + rounding
        left_out += np.sum(~smooth)
        wrong = np.abs(slopes[name] - expected) > 1e-7 * size + rounding
        assert not np.any(wrong & smooth), name
    assert left_out < 0.01 * len(rig.parameters) * COUNT * 3


def test_the_residual_is_made_of_what_can_be_translated(simtr: QuarterCar, numbers: dict[str, float]) -> None:
    used = Counter(
        primitives_of(
            lambda p, z, x: _residual(simtr, p, z, x), as_values(numbers), np.zeros(10), np.float64(0.0)
        )
    )
    assert set(used) <= MAPPABLE
    # One look-up of the damper's table, for its coefficients and for its origin, and nothing else.
    assert sum(used[name] for name in TABLE_LOOK_UP) <= 2


def _flat(at: Section) -> Array:
    return jnp.concatenate([jnp.stack(at[:11]), at.inertia.ravel()])


@pytest.mark.slow
def test_curves_of_the_linkage_are_its_closed_form(numbers: dict[str, float]) -> None:
    """Over the whole range of the curves: what they give, and how it changes with the angle and the parameters."""
    p = as_values(shifted(numbers, 3))
    angle = np.linspace(-TRAVEL, TRAVEL, 101)
    turned, still = (dict.fromkeys(p, np.float64(0.0)), 1.0), ({name: 0.1 * p[name] for name in p}, 0.0)

    def compared(at: Callable[[Values, Array], Section]) -> NDArray[np.float64]:
        @jax.jit
        def found(values: Values) -> list[Array]:
            def one(theta: Array) -> list[Array]:
                def whole(values: Values, theta: Array) -> Array:
                    return _flat(at(values, theta))

                given = (values, theta)
                return [whole(*given), *(jax.jvp(whole, given, each)[1] for each in (turned, still))]

            return jax.vmap(one)(angle)

        return np.stack(found(p))

    exact, curved = compared(section), compared(lambda values, theta: section_curves(values)(theta))
    size = np.maximum(np.max(np.abs(exact), axis=(0, 1)), 1e-3)
    deviation = np.max(np.abs(curved - exact) / size, axis=(1, 2))
    assert np.all(deviation < [1e-11, 1e-9, 1e-11])
