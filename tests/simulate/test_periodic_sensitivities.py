"""Sensitivities of the harmonics against finite differences through the whole solver."""

import numpy as np
import pytest

from savgs_ident.core.values import Values
from savgs_ident.inference.problem import used_parameters
from savgs_ident.plants.quarter_car.catalogue import MODELS, model_parameters
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSolution, resolve
from savgs_ident.simulate.sensitivity import harmonic_sensitivities

from .programme import altered, orders

pytestmark = pytest.mark.slow

STEP = 1e-5
"""Relative: long enough for the digits of a small sensitivity, short enough not to meet another branch."""


def _difference(model: QuarterCar, p: Values, solution: PeriodicSolution, name: str) -> np.ndarray:
    """Central difference of the harmonics on the same nodes."""
    value = float(p[name])
    step = STEP * max(abs(value), 1e-3)
    ends = [altered(p, {name: value + side * step}) for side in (-1.0, 1.0)]
    low, high = (orders(model, each, resolve(model, each, solution)) for each in ends)
    return (high - low) / (2.0 * step)


@pytest.fixture(scope="module")
def sensitivities(friction: QuarterCar, numbers: Values, few: PeriodicSolution) -> dict[str, np.ndarray]:
    """By the implicit function theorem, of every parameter, (D, 2, 10) each."""
    names = tuple(numbers)
    found = np.asarray(harmonic_sensitivities(friction, numbers, few, names, 9))
    return dict(zip(names, found, strict=True))


def test_they_are_finite_differences_of_the_solver(
    friction: QuarterCar,
    numbers: Values,
    few: PeriodicSolution,
    sensitivities: dict[str, np.ndarray],
    rig: Rig,
) -> None:
    used = used_parameters(friction, model_parameters(rig, MODELS["simtr"]))
    assert {"mu_r", "mu_t", "ydot_Hth", "c_sd", "k_pre", "c_pre", "C_y", "m_s", "z_tb", "l_free"} <= used
    for name in sorted(used):
        found = sensitivities[name]
        size = np.max(np.abs(found), axis=-1, keepdims=True)
        miss = np.abs(_difference(friction, numbers, few, name) - found)
        assert np.all(miss <= 1e-5 * size), f"{name}: {np.max(miss / size):.2g}"


def test_what_the_model_does_not_use_has_none(
    sensitivities: dict[str, np.ndarray], friction: QuarterCar, rig: Rig
) -> None:
    used = used_parameters(friction, model_parameters(rig, MODELS["simtr"]))
    unused = set(sensitivities) - used
    assert "motor_gear_ratio" in unused
    assert all(np.all(sensitivities[name] == 0.0) for name in unused)
    assert all(np.any(sensitivities[name] != 0.0) for name in used)
