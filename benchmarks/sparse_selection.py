"""Sparse regressions as peers of the diagnosis: which term matters most, if any does.

    peer(regression)        # what it says, at each of its settings

A peer that has a threshold says something for each of :data:`THRESHOLDS`, so that the best can be chosen knowing all
answers. pySINDy's two greedy optimisers have one: sequentially thresholded least squares, and forward orthogonal
least squares.
"""

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.trial_regression import Regression

THRESHOLDS = tuple(np.geomspace(2.0, 200.0, 41).tolist())
"""Thresholds tried, in standard deviations of a coefficient."""

Said = str | None
"""The term that matters most; None if none does."""

Peer = Callable[[Regression], tuple[Said, ...]]


def by_stlsq(regression: Regression) -> tuple[Said, ...]:
    """Sequentially thresholded least squares: the largest of the terms that are left, at each threshold."""
    from pysindy import STLSQ

    return tuple(
        _largest(regression, _coefficients(STLSQ(threshold=limit, alpha=1e-6), regression), limit)
        for limit in THRESHOLDS
    )


def by_frols(regression: Regression) -> tuple[Said, ...]:
    """Forward orthogonal least squares: the first term, if its coefficient is above each threshold."""
    from pysindy import FROLS

    found = _coefficients(FROLS(max_iter=1, alpha=1e-6), regression)
    return tuple(_largest(regression, found, limit) for limit in THRESHOLDS)


PEERS: Mapping[str, Peer] = {"stlsq": by_stlsq, "frols": by_frols}
"""The peers by the name that they have in figures."""


def _coefficients(optimizer: Any, regression: Regression) -> NDArray[np.float64]:
    """The coefficients (k,) that an optimiser of pySINDy finds."""
    with warnings.catch_warnings():
        # Where nothing is left it warns; that is an answer here.
        warnings.simplefilter("ignore")
        optimizer.fit(regression.library, regression.residual[:, None])
    found: NDArray[np.float64] = np.asarray(optimizer.coef_)[0]
    return found


def _largest(regression: Regression, coefficients: NDArray[np.float64], threshold: float) -> Said:
    sizes = np.abs(coefficients)
    place = int(np.argmax(sizes))
    return regression.names[place] if sizes[place] >= threshold else None
