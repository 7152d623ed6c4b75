"""Outcomes of solvers as values, each with a sentence that says what to do.

>>> Status.CONVERGED.ok, Status.NOT_IDENTIFIABLE.ok
(True, False)
"""

from enum import Enum


class Status(Enum):
    """How a computation ended; ``value`` is advice for the reader of a report."""

    CONVERGED = "converged"
    MAX_ITERATIONS = "stopped at the iteration limit before converging: raise the limit or start nearer"
    STALLED = "no step reduced the residual: the problem is stiff or not smooth here, refine the time grid"
    NOT_FINITE = "met a value that is not finite: a parameter has left the range where the model exists"
    NOT_IDENTIFIABLE = "the data cannot tell every free parameter: see the identifiability verdict"

    @property
    def ok(self) -> bool:
        """Whether the result may be trusted as it is."""
        return self is Status.CONVERGED

    @property
    def advice(self) -> str:
        """The outcome in a sentence."""
        return self.value
