"""Products of tall, narrow matrices without threads."""

import numpy as np
from numpy.typing import NDArray

_ROWS = 128
"""So few rows that the linear algebra library does not start threads: handing over to them costs more than
the product itself, and many times more on a machine that is busy."""


def normal_products(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """A' A of ``columns`` of any unit, (N, p), shape (p, p), for a p of a few tens."""
    total = np.zeros((columns.shape[1], columns.shape[1]))
    for start in range(0, columns.shape[0], _ROWS):
        part = columns[start : start + _ROWS]
        total += part.T @ part
    return total
