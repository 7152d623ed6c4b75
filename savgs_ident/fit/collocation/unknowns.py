"""Which unknowns there are, in which units, and where they stand in one long vector.

    [ parameters (n) | point 0: x, y, m | point 1: x, y, m | ... | zeros of the sensors (D, C) ]

with x the states, y their algebraic partners (accelerations and rates of internal states), m what the sensors
read. Parameters stand as unconstrained coordinates, everything else in units of its typical size, so that all
unknowns are of the order of one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.sensors import RESPONSE_CHANNELS

COORDINATES = (1e-2, 3e-2)
"""Typical displacement of z_s [m] and theta_LW [rad]."""

VELOCITIES = (0.1, 0.3)
"""Their typical rates [1/s]."""

ACCELERATIONS = (1.0, 3.0)
"""Theirs in turn [1/s^2]."""

PACE = 10.0
"""Typical rate of change of an internal state, in its typical sizes [1/s]."""

READINGS = (1.0, 1e-2)
"""Typical acceleration [m/s^2] and deflection [m] that the sensors read."""

BALANCES = (320.0, 20.0)
"""Typical force [N] and moment [N m] in the two equations of motion."""


@dataclass(frozen=True)
class Unknowns:
    """Sizes and scales.

    ``parameters`` n, ``points`` P, ``dwells`` D, ``internal`` sizes of internal states [SI].
    """

    parameters: int
    points: int
    dwells: int
    internal: tuple[float, ...]

    @property
    def states(self) -> int:
        """Entries of x."""
        return 4 + len(self.internal)

    @property
    def partners(self) -> int:
        """Entries of y."""
        return 2 + len(self.internal)

    @property
    def width(self) -> int:
        """Unknowns of a point."""
        return self.states + self.partners + len(RESPONSE_CHANNELS)

    @property
    def size(self) -> int:
        """All unknowns."""
        return self.parameters + self.points * self.width + self.dwells * len(RESPONSE_CHANNELS)

    @property
    def scale(self) -> NDArray[np.float64]:
        """Typical sizes of the unknowns of a point [SI], (width,)."""
        rates = tuple(PACE * size for size in self.internal)
        return np.array([*COORDINATES, *VELOCITIES, *self.internal, *ACCELERATIONS, *rates, *READINGS])

    @property
    def residual_scale(self) -> NDArray[np.float64]:
        """Typical sizes of the equations of a point [SI], (rows,).

        The model's residual, then what the sensors read.
        """
        return np.array([*BALANCES, *(PACE * size for size in self.internal), *READINGS])

    @property
    def at_points(self) -> NDArray[np.intp]:
        """Places of the unknowns of the points, (P, width)."""
        places = np.arange(self.points * self.width).reshape(self.points, self.width)
        return self.parameters + places

    @property
    def zeros(self) -> NDArray[np.intp]:
        """Places of the sensors' zeros, (D, C)."""
        count = self.dwells * len(RESPONSE_CHANNELS)
        return np.arange(self.size - count, self.size).reshape(self.dwells, -1)


def unknowns_of(model: QuarterCar, parameters: int, points: int, dwells: int) -> Unknowns:
    """The unknowns for a model."""
    return Unknowns(parameters, points, dwells, tuple(state.scale for state in model.states))
