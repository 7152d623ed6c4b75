"""Parameters on coordinates of which the prior is the unit normal.

An amplitude is linear in its coordinate, value = centre + scale x, held within its bounds; what is positive by
nature is logarithmic, value = centre exp(scale x). A bound that an amplitude begins at cuts its prior in half.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf, log

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class AbstractCoordinate:
    """One parameter, its prior and bounds.

    Attributes:
        name: name of the parameter.
        unit: its unit, SI.
        centre: the value at x = 0 [unit].
        scale: one standard deviation of the prior [unit, or 1 for a logarithmic coordinate].
        lower: smallest value [unit].
        upper: largest value [unit].
    """

    name: str
    unit: str
    centre: float
    scale: float
    lower: float = -inf
    upper: float = inf

    @abstractmethod
    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""

    @abstractmethod
    def slope(self, x: float) -> float:
        """d value / dx [unit]."""

    @abstractmethod
    def at(self, value: float) -> float:
        """The coordinate [1] of a value [unit]."""

    @property
    def halved(self) -> bool:
        """Whether the prior begins at its own centre."""
        return self.centre in (self.lower, self.upper)

    @property
    def reach(self) -> tuple[float, float]:
        """The coordinates of the bounds [1]."""
        return self.at(self.lower), self.at(self.upper)


@dataclass(frozen=True)
class Linear(AbstractCoordinate):
    """value = centre + scale x."""

    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""
        return min(max(self.centre + self.scale * x, self.lower), self.upper)

    def slope(self, x: float) -> float:
        """d value / dx [unit]."""
        return self.scale

    def at(self, value: float) -> float:
        """The coordinate of a value."""
        return (value - self.centre) / self.scale


@dataclass(frozen=True)
class Logarithmic(AbstractCoordinate):
    """value = centre exp(scale x), for what is positive."""

    def value(self, x: float) -> float:
        """The parameter [unit] at a coordinate."""
        return min(max(self.centre * exp(self.scale * x), self.lower), self.upper)

    def slope(self, x: float) -> float:
        """d value / dx [unit]."""
        return self.scale * self.value(x)

    def at(self, value: float) -> float:
        """The coordinate of a value; far below any for zero."""
        return log(value / self.centre) / self.scale if value > 0.0 else -inf


Coordinates = tuple[AbstractCoordinate, ...]


def values_at(coordinates: Coordinates, x: NDArray[np.float64]) -> dict[str, float]:
    """The parameters at coordinates (n,), by name, SI."""
    return {each.name: each.value(float(at)) for each, at in zip(coordinates, x, strict=True)}


def slopes_at(coordinates: Coordinates, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """d value / dx of every parameter [its unit], (n,)."""
    return np.array([each.slope(float(at)) for each, at in zip(coordinates, x, strict=True)])


def reach_of(coordinates: Sequence[AbstractCoordinate]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper bounds of the coordinates [1], (n,) each."""
    bounds = np.array([each.reach for each in coordinates]).reshape(-1, 2)
    return bounds[:, 0], bounds[:, 1]
