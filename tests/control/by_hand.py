"""The linkage by root finding and finite differences: none of the derivatives under test."""

from collections.abc import Callable

import jax
import numpy as np
from scipy.optimize import brentq

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import strut_length, suspension_travel

_length = jax.jit(strut_length)
_travel = jax.jit(suspension_travel)

FURTHEST = 0.34
"""Largest wishbone angle at which roots are looked for [rad]."""


def length(p: Values, wishbone: float, link: float) -> float:
    """Length of the strut [m] at two angles [rad]."""
    return float(_length(p, np.float64(wishbone), np.float64(link)))


def travel(p: Values, wishbone: float) -> float:
    """Suspension deflection from the drawing [m] at an angle [rad]."""
    return float(_travel(p, np.float64(wishbone)))


def wishbone_at_length(p: Values, wanted: float, link: float) -> float:
    """Angle of the wishbone [rad] at which the strut has a length [m]."""
    return float(
        brentq(lambda angle: length(p, angle, link) - wanted, -FURTHEST, FURTHEST, xtol=1e-15, rtol=1e-14)
    )


def wishbone_at_travel(p: Values, wanted: float) -> float:
    """Angle of the wishbone [rad] at which the wheel is at a deflection [m]."""
    return float(brentq(lambda angle: travel(p, angle) - wanted, -FURTHEST, FURTHEST, xtol=1e-15, rtol=1e-14))


def slope(function: Callable[[float], float], at: float, step: float) -> float:
    """Derivative by central differences of fourth order."""
    near = function(at + step) - function(at - step)
    far = function(at + 2.0 * step) - function(at - 2.0 * step)
    return (8.0 * near - far) / (12.0 * step)
