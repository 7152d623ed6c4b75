"""A drive whose force has another sign is told from a model that lacks a friction."""

import numpy as np
import pytest

from savgs_ident.inference.likely_mistake import mistaken_drive
from savgs_ident.plants.axis import Axis

TIME = np.linspace(0.0, 20.0, 2000)
SPEED = np.sin(TIME) + 0.3 * np.sin(3.1 * TIME)
NEEDED = 80.0 * np.gradient(SPEED, TIME) + 50.0 * SPEED
"""What a model without friction asks for [N]."""


@pytest.mark.parametrize("friction", [0.0, 30.0, 200.0])
def test_a_friction_that_is_missing_is_no_mistake(friction: float) -> None:
    assert mistaken_drive(NEEDED + friction * np.sign(SPEED) - 5.0, NEEDED, Axis) == ""


@pytest.mark.parametrize("friction", [0.0, 30.0, 200.0])
def test_a_wrong_sign_is_said_whatever_the_friction(friction: float) -> None:
    assert "look at its sign" in mistaken_drive(-(NEEDED + friction * np.sign(SPEED)), NEEDED, Axis)


@pytest.mark.parametrize("factor", [1e-2, 1e2])
def test_another_unit_of_force_is_no_mistake(factor: float) -> None:
    assert mistaken_drive(factor * NEEDED, NEEDED, Axis) == ""


def test_nothing_is_said_of_what_is_no_number() -> None:
    assert mistaken_drive(NEEDED, np.full(NEEDED.size, np.nan), Axis) == ""
    assert mistaken_drive(NEEDED, np.zeros(NEEDED.size), Axis) == ""
