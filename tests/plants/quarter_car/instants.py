"""Random instants of the rig's motion, and the model as functions of flat vectors of them.

An instant is (z_s, theta_LW), their first and second derivatives, road height and velocity, link angle and
velocity: a vector (10,) in SI.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.rig import Rig

LARGEST = np.array([0.03, 0.25, 0.5, 2.0, 8.0, 40.0, 0.02, 0.5, np.pi / 2.0, 8.0])
"""Half ranges of what is drawn; the road is drawn about the wheel, the link angle about its middle."""

WHEEL_LIFT = 0.37
"""Rise of the wheel over the angle of the lower wishbone, about [m/rad]."""

NOMINAL = np.array([0.0] * 8 + [np.pi / 2.0, 0.0])
"""The nominal state, at rest."""


def draw_instants(seed: int, count: int) -> NDArray[np.float64]:
    """Instants (count, 10): the tyre on the plate and off it, sliding and hardly moving."""
    rng = np.random.default_rng(seed)
    drawn = rng.uniform(-1.0, 1.0, (count, 10)) * LARGEST
    drawn[:, 2:4] *= 10.0 ** rng.uniform(-3.0, 0.0, (count, 2))
    drawn[:, 6] += drawn[:, 0] + WHEEL_LIFT * drawn[:, 1]
    drawn[:, 8] += np.pi / 2.0
    return drawn


def motion_of(instant: Array) -> Motion:
    """The motion of an instant."""
    return Motion(*(Coordinates(instant[i], instant[i + 1]) for i in (0, 2, 4)))


def inputs_of(instant: Array) -> Inputs:
    """Road and link of an instant."""
    return Inputs(Road(instant[6], instant[7]), Link(instant[8], instant[9]))


def all_parameters(rig: Rig) -> ParameterTable:
    """The rig's parameters and those of the whole catalogue."""
    brought = (ParameterTable(effect.parameters) for effect in CATALOGUE.values())
    return merge_parameters(rig.parameters, *brought)


def as_values(values: Mapping[str, float]) -> Values:
    """Numbers as the model takes them."""
    return {name: np.asarray(value, np.float64) for name, value in values.items()}


def shifted(values: Mapping[str, float], seed: int, metres: float = 0.003) -> dict[str, float]:
    """Another rig: hardpoints and centres of gravity moved by up to ``metres``, the rest by up to 5 %."""
    rng = np.random.default_rng(seed)
    exact = {"theta_0", "psi_nominal", "l_free", "r_free"}
    out = {}
    for name, value in values.items():
        if name.endswith(("_y", "_z")):
            out[name] = value + metres * rng.uniform(-1.0, 1.0)
        else:
            out[name] = value if name in exact else value * (1.0 + 0.05 * rng.uniform(-1.0, 1.0))
    return out
