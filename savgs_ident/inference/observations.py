"""What a search asks of a plant, and the data that it is held against: independent rows with their noise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.inference.prior import Coordinates, EffectCoordinates, Scales

MULTIPLES = (0.4, 1.0, 2.5)
"""Shapes are tried at these multiples of their typical values, unless a term says otherwise."""


class Prediction(NamedTuple):
    """A plant at a point: rows (m,), their slopes in the named values (m, n), and what it starts from nearby.

    ``status`` says how the solution of the plant ended. Rows are in their own units, slopes in those per
    unit of the value.
    """

    rows: NDArray[np.float64]
    slopes: NDArray[np.float64]
    status: Status
    warm_start: Any

    @property
    def solved(self) -> bool:
        """Whether the rows are to be trusted."""
        return self.status.ok


@dataclass(frozen=True)
class Term:
    """A candidate: something that may be missing in the plant's baseline.

    Attributes:
        name: its name.
        place: where in the plant it acts.
        amplitudes: coordinates at whose centres it vanishes.
        shapes: coordinates that say nothing while it vanishes.
        tries: values of shapes [SI] by name at which it is looked for; typical ones where left out.
    """

    name: str
    place: str
    amplitudes: EffectCoordinates
    shapes: EffectCoordinates = ()
    tries: tuple[Mapping[str, float], ...] = ()

    @property
    def coordinates(self) -> EffectCoordinates:
        """All its coordinates."""
        return self.amplitudes + self.shapes

    @cached_property
    def tried(self) -> tuple[dict[str, float], ...]:
        """All its shapes [SI] by name, for every try."""
        typical = {each.name: each.centre for each in self.shapes}
        if self.tries or not self.shapes:
            return tuple(typical | dict(each) for each in self.tries or ({},))
        return tuple(self._at(multiple) for multiple in MULTIPLES)

    def at_multiples(self, multiples: Sequence[float]) -> "Term":
        """The same term, looked for at other multiples [1] of its typical shapes."""
        return replace(self, tries=tuple(self._at(multiple) for multiple in multiples))

    def _at(self, multiple: float) -> dict[str, float]:
        return {each.name: min(max(multiple * each.centre, each.lower), each.upper) for each in self.shapes}


class Plant(Protocol):
    """A differentiable prediction with terms that may be added."""

    @property
    def nuisances(self) -> Coordinates:
        """The baseline's own parameters, free ones and tolerances."""

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows with the given terms at ``values``, with slopes in ``names``, started from ``warm_start`` if not None.

        Values are in SI.
        """

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """What to start from nearby, made as precise as it can be. Values are in SI."""

    def columns(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, wherever it is tried.

        Shape (tries, m, amplitudes) each, about a point where the plant has ``warm_start``.
        """


@dataclass(frozen=True)
class Data:
    """m independent numbers, each in a unit of its own.

    Attributes:
        measured: the numbers, (m,).
        variance: variance of their noise, (m,).
        reach: by how much a relative discrepancy of one of the model moves them, (m,).
        test: which test each belongs to, counted from 0, (m,).
        scales: what is known beforehand of noise scale and discrepancy.
    """

    measured: NDArray[np.float64]
    variance: NDArray[np.float64]
    discrepancy_scale: NDArray[np.float64]
    test: NDArray[np.intp]
    scales: Scales = field(default_factory=Scales)

    def part(self, mask: NDArray[np.bool_]) -> "Data":
        """The numbers that ``mask`` (m,) picks."""
        return Data(
            self.measured[mask],
            self.variance[mask],
            self.discrepancy_scale[mask],
            self.test[mask],
            self.scales,
        )

    @property
    def tests(self) -> int:
        """How many tests there are."""
        return int(self.test.max()) + 1
