"""The force that a plant needs from its drive along a measured motion, as rows that a fit compares.

    problem = DriveForce(model, table, motion, nuisances)
    mode = find_map(search_of(problem, force_data(motion)), (), values, None)

The force (:mod:`savgs_ident.simulate.along_motion`) is low-passed and thinned like the measured one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values, as_values
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Coordinates
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.simulate.along_motion import force_slopes, needed_force
from savgs_ident.simulate.driven_plant import samples_of
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.sensitivity import unit_tangents

WIDTH = 48
"""Room for slopes in one program, or multiples of it: a program for each number of them would have to be compiled."""

PRECISION = 1e-6
"""Largest Newton step that may remain in a state, in its typical size [1]."""


class ForceRows(NamedTuple):
    """Rows of the needed force [N], (m,), their slopes [N per SI unit], (m, n), and how the states were found."""

    rows: NDArray[np.float64]
    slopes: NDArray[np.float64]
    status: Status


def force_rows(model: AbstractPlant, p: Values, motion: DrivenMotion, names: Sequence[str]) -> ForceRows:
    """The force that a model needs along a motion with parameters ``p`` [SI], with slopes in those named."""
    p, samples = placed(dict(p)), samples_of(motion, model)
    if names:
        directions = placed(unit_tangents(p, names, ceil(len(names) / WIDTH) * WIDTH))
        wanted = placed(np.asarray(len(names)))
        needed, along = force_slopes(model, p, samples, motion.step, directions, wanted)
        slopes = motion.rows(np.asarray(along)[: len(names)]).T
    else:
        needed = needed_force(model, p, samples, motion.step)
        slopes = np.zeros((motion.row_times.size, 0))
    status = Status.CONVERGED if float(needed.step_left) < PRECISION else Status.STALLED
    return ForceRows(motion.rows(np.asarray(needed.force)), slopes, status)


def force_data(motion: DrivenMotion) -> Data:
    """The measured force as data; rows of a second of time are one test.

    A relative discrepancy of one moves every row by the root mean square of the force: a model misses by as much
    whenever it does.
    """
    force = motion.rows(motion.drive)
    size = float(np.sqrt(np.mean(force**2)))
    variance, scale = (np.full(force.size, each) for each in (motion.noise**2, size))
    return Data(force, variance, scale, motion.blocks)


def relative_miss(measured: NDArray[np.float64], rows: NDArray[np.float64]) -> float:
    """By how much rows (m,) miss the measured ones, relative to these [1]."""
    return float(np.linalg.norm(measured - rows) / np.linalg.norm(measured))


def relative_noise(motion: DrivenMotion) -> float:
    """The noise of a row of force, relative to the rms of the rows [1]."""
    return motion.noise / float(np.sqrt(np.mean(motion.rows(motion.drive) ** 2)))


@dataclass(frozen=True)
class DriveForce:
    """A model along a measured motion, with nothing that may be added; the plant of a search.

    Attributes:
        model: the plant with its effects.
        table: all its parameters.
        motion: what was measured.
        nuisances: the coordinates that are searched.
    """

    model: AbstractPlant
    table: ParameterTable
    motion: DrivenMotion
    nuisances: Coordinates

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows [N] at ``values`` [SI], with slopes in ``names``; no ``terms`` can be asked for."""
        assert not terms, terms
        found = force_rows(self.model, as_values(self.table.as_dict() | dict(values)), self.motion, names)
        return Prediction(found.rows, lambda: found.slopes, found.status, warm_start)

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """Nothing: the motion is known."""
        return warm_start

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """Of no candidates."""
        assert not candidates, candidates
        return []
