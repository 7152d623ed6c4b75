"""Records with spikes and dropouts."""

import numpy as np
from numpy.typing import NDArray


def spike(values: NDArray[np.float64], share: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """A share of the samples moved by 0.2 to 1.5 times the peak-to-peak value, either way."""
    bad = values.copy()
    count = max(round(share * values.size), 1)
    places = rng.choice(values.size, count, replace=False)
    bad[places] += np.ptp(values) * rng.uniform(0.2, 1.5, count) * rng.choice([-1.0, 1.0], count)
    return bad


def drop(values: NDArray[np.float64], share: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Runs of one to five zeros, ``share`` of the samples in all."""
    bad = values.copy()
    for start in rng.choice(values.size - 5, max(round(share * values.size / 3), 1), replace=False):
        bad[start : start + rng.integers(1, 6)] = 0.0
    return bad
