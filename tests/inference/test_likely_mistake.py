"""Units, signs and exchanged channels are told from models that lack something or have wrong numbers."""

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.inference.likely_mistake import likely_mistake
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass, closed_form

FREQUENCY = np.array([1.0, 1.4, 2.0, 3.0, 5.0, 8.0, 12.0])
TRUE = {"k": 4.5e4, "c": 3.0e3}

Readings = NDArray[np.complex128]


def _of(values: dict[str, float]) -> Readings:
    return closed_form(PARAMETERS.with_values(values).as_dict(), FREQUENCY)[:, :, None]


def _said(factors: tuple[complex, complex], true: dict[str, float] = TRUE, alone: bool = False) -> str:
    measured = _of(true) * np.array(factors)[:, None]
    used = np.ones(measured.shape, bool)
    used[:, 1] = not alone
    return likely_mistake(measured, _of({}), used, TwoMass)


@pytest.mark.parametrize(
    ("factors", "name", "words"),
    [
        ((1.0 / 9.80665, 1.0), "body_accel", "as if g had been taken for m/s^2"),
        ((9.80665, 1.0), "body_accel", "as if m/s^2 had been taken for g"),
        ((1.0, 1.0 / 25.4), "susp_deflection", "as if inches had been taken for millimetres"),
        ((1.0, 1000.0), "susp_deflection", "as if millimetres had been taken for metres"),
        ((10.0, 10.0), "road_height", "as if centimetres had been taken for millimetres"),
        ((-1.0, 1.0), "body_accel", "goes the other way"),
        ((1.0, -1.0), "susp_deflection", "goes the other way"),
        ((-1.0, -1.0), "road_height", "goes the other way"),
        ((4.0, 1.0), "body_accel", "look at its unit and its scale"),
    ],
)
def test_a_unit_or_a_sign_is_told(factors: tuple[float, float], name: str, words: str) -> None:
    said = _said(factors)
    assert said.startswith(f"{name} ")
    assert words in said


def test_two_mistakes_are_both_said() -> None:
    said = _said((1.0 / 9.80665, -1.0))
    assert "as if g had been taken" in said
    assert "susp_deflection goes the other way" in said


def test_exchanged_channels_are_told() -> None:
    accel, deflection = np.moveaxis(_of(TRUE), 1, 0)
    exchanged = np.stack([1e3 * deflection, 1e-3 * accel], axis=1)
    said = likely_mistake(exchanged, _of({}), np.ones(exchanged.shape, bool), TwoMass)
    assert "as if the two had been exchanged" in said


def test_of_one_channel_alone_it_may_be_the_input() -> None:
    said = _said((10.0, 1.0), alone=True)
    assert said.startswith("body_accel, or road_height the other way round, is ")
    assert _said((-1.0, 1.0), alone=True).startswith("body_accel, or road_height, goes the other way")


@pytest.mark.parametrize(
    "true",
    [
        {},
        {"k": 2e4, "c": 1e3},
        {"k": 1.5e5, "c": 6e3},
        {"c": 400.0},
        {"m_s": 160.0},
        {"k_t": 1e5},
        {"k": 2e5, "c": 200.0, "m_u": 90.0},
    ],
)
def test_a_model_with_wrong_numbers_is_no_mistake_of_the_recording(true: dict[str, float]) -> None:
    assert _said((1.0, 1.0), true) == ""


def test_a_lag_and_delays_are_none() -> None:
    turn = 2j * np.pi * FREQUENCY
    for change in (1.0 / (1.0 + 0.03 * turn), np.exp(-0.02 * turn), np.exp(-1.0 / FREQUENCY)):
        measured = _of(TRUE) * np.stack([change, np.ones_like(change)], axis=1)[:, :, None]
        assert likely_mistake(measured, _of({}), np.ones(measured.shape, bool), TwoMass) == ""


def test_nothing_is_said_where_nothing_is_compared_or_solved() -> None:
    measured = _of(TRUE)
    none = np.zeros(measured.shape, bool)
    assert likely_mistake(measured, measured, none, TwoMass) == ""
    lost = np.full(measured.shape, np.nan + 0j)
    assert likely_mistake(measured, lost, ~none, TwoMass) == ""
