"""Sparse regressions as peers of the diagnosis: which term matters most, if any does.

    peer(regression)        # what it says, at each of its settings

A peer that has a threshold says something for each of :data:`THRESHOLDS`, so that the best can be chosen knowing all
answers. pySINDy's two greedy optimisers have one: sequentially thresholded least squares, and forward orthogonal
least squares.

L1 selection has none. Along the path of the LASSO

    min over c >= 0 of |residual - library @ c|^2 / 2 + alpha sum(c)

the Bayesian information criterion chooses alpha, |residual - library @ c|^2 + (number of terms) log m: not
cross-validation, which is made to predict and keeps terms that are not there, and whose folds are not independent
where rows share errors; and the criterion knows the noise, which is one. Nothing is missing where it keeps no term.
Else the verdict is the effect whose columns together contribute most at that alpha: the effect that enters first
would be the first term of FROLS again. In pure noise it keeps something about once in sqrt(m) times, for along the
first stretch of the path the misfit falls by about twice an exponential variable (Lockhart et al. 2014).

Sources: Tibshirani 1996, Journal of the Royal Statistical Society B 58(1); Zou, Hastie, Tibshirani 2007, Annals of
Statistics 35(5), on the degrees of freedom; Lockhart, Taylor, Tibshirani, Tibshirani 2014, Annals of Statistics
42(2).
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


def by_lasso(regression: Regression) -> tuple[Said, ...]:
    """L1 selection at the best information criterion: the effect that contributes most."""
    from sklearn.linear_model import LassoLarsIC

    names, library, either_sign, residual = regression
    # A size that may be negative has a column for each sign.
    signed = np.concatenate([library, -library[:, either_sign]], axis=1)
    owners = [*names, *(name for name, either in zip(names, either_sign, strict=True) if either)]
    model = LassoLarsIC(criterion="bic", fit_intercept=False, positive=True, noise_variance=1.0)
    with warnings.catch_warnings():
        # The path ends early where columns are nearly dependent; what it has until then counts.
        warnings.simplefilter("ignore")
        model.fit(signed, residual)
    parts: dict[str, NDArray[np.float64]] = {}
    for place in np.flatnonzero(model.coef_):
        part = model.coef_[place] * signed[:, place]
        parts[owners[place]] = parts.get(owners[place], 0.0) + part
    return (max(parts, key=lambda name: float(np.linalg.norm(parts[name])), default=None),)


PEERS: Mapping[str, Peer] = {"stlsq": by_stlsq, "frols": by_frols, "lasso": by_lasso}
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
