"""Outcomes of solvers as values, each with a sentence of advice.

>>> Status.CONVERGED.ok, Status.NOT_IDENTIFIABLE.ok
(True, False)
"""

from collections.abc import Iterable
from enum import Enum


class Status(Enum):
    """How a computation ended; ``value`` is the advice to the reader of a report."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "stopped at the iteration limit before converging: start from better values"
    STALLED = "no step reduced the residual: the problem is stiff or not smooth here, refine the time grid"
    HOPELESS = "given up: far below another hypothesis, and what its next step promised is little beside that"
    NOT_FINITE = "met a value that is not finite: a parameter has left the range where the model exists"
    NOT_IDENTIFIABLE = "the data do not identify every free parameter: see the identifiability verdict"

    @property
    def ok(self) -> bool:
        """Whether the result may be trusted."""
        return self is Status.CONVERGED

    @property
    def advice(self) -> str:
        """The outcome in a sentence."""
        return self.value


def joint_status(statuses: Iterable[Status]) -> Status:
    """How computations ended that are needed together: the first outcome that is not to be trusted, if there is one.

    >>> joint_status([Status.CONVERGED, Status.STALLED]).name
    'STALLED'
    """
    return next((each for each in statuses if not each.ok), Status.CONVERGED)
