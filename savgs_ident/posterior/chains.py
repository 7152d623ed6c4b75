"""What a sampler hands over, whichever it is."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float


class Chains(NamedTuple):
    """Draws so far, in S steps of C chains.

    Attributes:
        points: free coordinates and nuisance scales [1], (S, C, n + 2).
        log_density: log density of the exact model, (S, C).
        accepted: whether the step moved, (S, C).
        log_ratio: log ratio of exact to surrogate density at the proposals; empty where proposals depend on
            each other.
        divergences: of the gradient-based sampler.
        evaluations: responses of the exact model.
        unsolved: of these without a periodic motion.
    """

    points: Float[np.ndarray, "S C n+2"]
    log_density: Float[np.ndarray, "S C"]
    accepted: Bool[np.ndarray, "S C"]
    log_ratio: Float[np.ndarray, " k"]
    divergences: int
    evaluations: int
    unsolved: int


def unsettled(log_density: Float[np.ndarray, "S C"]) -> int:
    """Leading steps at which some chain has been nowhere yet where the model is solved.

    ``log_density`` [1] is minus infinity there.
    """
    solved = np.isfinite(log_density).all(axis=1)
    return int(np.argmax(solved)) if solved.any() else len(solved)
