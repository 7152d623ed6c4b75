"""What the engine asks of a plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.coordinates import Coordinates


class Prediction(NamedTuple):
    """A plant at a point: rows (m,), their slopes in the named values (m, n), and what it starts from nearby.

    ``solved`` says whether the rows are to be trusted.
    """

    rows: NDArray[np.float64]
    slopes: NDArray[np.float64]
    solved: bool
    near: Any


@dataclass(frozen=True)
class Term:
    """A candidate: something that may be missing in the plant's baseline.

    Attributes:
        name: its name.
        place: where in the plant it sits.
        amplitudes: coordinates at whose centres it vanishes.
        shapes: coordinates that say nothing while it vanishes.
    """

    name: str
    place: str
    amplitudes: Coordinates
    shapes: Coordinates = ()

    @property
    def coordinates(self) -> Coordinates:
        """All its coordinates."""
        return self.amplitudes + self.shapes


class Plant(Protocol):
    """A differentiable prediction with terms that may be added."""

    @property
    def nuisances(self) -> Coordinates:
        """The baseline's own parameters, free ones and tolerances."""

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], near: Any
    ) -> Prediction:
        """Rows with the given terms at ``values``, with slopes in ``names``, started from ``near`` if not None."""

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], near: Any) -> Any:
        """What to start from nearby, made as precise as it can be."""

    def columns(
        self, terms: tuple[str, ...], values: Mapping[str, float], near: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, for some choices of its shapes.

        Shape (choices, m, amplitudes) each, about a point where the plant has ``near``.
        """
