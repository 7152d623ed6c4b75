"""The positioner as a plant of the engine: rows are the force that drives it, in time.

Under closed loop the position hides what a model lacks: the controller makes the carriage follow whatever the
friction. The force shows it. So the measured motion is taken as it is, and the force that each hypothesis says it
took is compared with the force that it did take.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.positioner.laws import BASELINE, CATALOGUE, LARGEST_PITCH, LEAST_PITCH, Law
from savgs_ident.diagnosis.positioner.preparation import ROWS_HZ, Motion
from savgs_ident.diagnosis.positioner.recording import PositionerRecording
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Coordinates

BLOCK_S = 1.0
"""A test is a block of so much time [s]."""


@dataclass(frozen=True)
class PositionerPlant:
    """The force along a measured motion.

    Attributes:
        motion: what the carriage did.
        catalogue: laws that may be missing.
    """

    motion: Motion
    catalogue: tuple[Law, ...] = CATALOGUE

    @property
    def nuisances(self) -> Coordinates:
        """Mass and viscous friction."""
        return tuple(each for law in BASELINE for each in law.term.coordinates)

    @property
    def candidates(self) -> tuple[Term, ...]:
        """The laws that may be missing, as terms."""
        return tuple(law.term for law in self.catalogue)

    def laws(self, terms: Sequence[str]) -> tuple[Law, ...]:
        """Those of the baseline and of ``terms``."""
        return BASELINE + tuple(self._law(name) for name in terms)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Force rows [N] with ``terms`` at ``values``, with slopes in ``names``; ``warm_start`` is not needed."""
        laws = self.laws(terms)
        force = np.sum([law.force(self.motion, values) for law in laws], axis=0)
        owner = {each.name: law for law in laws for each in law.term.coordinates}
        slopes = [owner[name].slope(self.motion, values, name) for name in names]
        rows = self.motion.thinned(np.stack([force, *slopes]))
        return Prediction(rows[0], rows[1:].T, Status.CONVERGED, None)

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """Nothing is started from nearby. Values are in SI."""
        return warm_start

    def columns(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """Rows per unit of each candidate's amplitudes, (tries, m, amplitudes); the same about every point."""
        return [self._columns(term) for term in candidates]

    def _columns(self, term: Term) -> NDArray[np.float64]:
        law, motion = self._law(term.name), self.motion
        return np.stack([motion.thinned(law.basis(motion, shapes)).T for shapes in term.tried])

    def _law(self, name: str) -> Law:
        return next(law for law in self.catalogue if law.term.name == name)


def pitch_choices(motion: Motion, law: Law) -> tuple[float, ...]:
    """Multiples [1] of a typical pitch that leave no pitch out: half a wave apart over the whole travel."""
    travel = float(np.ptp(motion.position))
    waves = np.arange(1.0 / LARGEST_PITCH, 1.0 / LEAST_PITCH, 0.5 / travel)
    return tuple(float(each) for each in 1.0 / (waves * law.term.shapes[0].centre))


def positioner_data(recording: PositionerRecording, motion: Motion, noise: float) -> Data:
    """The measured force as rows, with ``noise`` [N] for the standard deviation of each.

    A discrepancy of one would be a model that misses by as much as the force itself, whenever it does: the reach
    of every row is the root mean square of the force.
    """
    force = motion.thinned(recording.force)
    test = (np.arange(force.size) / (BLOCK_S * ROWS_HZ)).astype(np.intp)
    size = float(np.sqrt(np.mean(force**2)))
    return Data(force, np.full(force.size, noise**2), np.full(force.size, size), test)
