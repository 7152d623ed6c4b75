"""Data as the engine sees them: independent rows with their noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Data:
    """m independent numbers, each in a unit of its own.

    Attributes:
        measured: the numbers, (m,).
        variance: variance of their noise, (m,).
        reach: by how much a relative discrepancy of one of the model moves them, (m,).
        test: which test each belongs to, counted from 0, (m,).
    """

    measured: NDArray[np.float64]
    variance: NDArray[np.float64]
    reach: NDArray[np.float64]
    test: NDArray[np.intp]

    @property
    def tests(self) -> int:
        """How many tests there are."""
        return int(self.test.max()) + 1
