"""Strain: a parameter that the data pull further from its sheet than its tolerance allows.

A model may miss nothing and still be wrong, if it does so with a spring ten standard deviations off its sheet. What
is held against the tolerances as they are is that one of them does not hold: its prior is as much wider as
:data:`WIDER` says. To first order about the mode, both evidences follow from where the data alone would have the
parameter, and how sharply.
"""

from math import log

import numpy as np

from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.engine.coordinates import Coordinates, Linear

WIDER = 10.0
"""By how much wider the prior is of a parameter whose tolerance does not hold."""


def strain_of(mode: Mode, nuisances: Coordinates) -> float:
    """Rise of the log evidence of a mode if one of the tolerances of ``nuisances`` may not hold, no matter which."""
    known = {each.name for each in nuisances if isinstance(each, Linear)}
    variance = np.diag(mode.covariance())
    gains = [
        _gain(float(x), float(v))
        for each, x, v in zip(mode.coordinates, mode.x, variance, strict=True)
        if each.name in known
    ]
    if not gains:
        return -np.inf
    best = max(gains)
    return best + log(sum(np.exp(each - best) for each in gains) / len(gains))


def _gain(x: float, variance: float) -> float:
    """The same of one parameter, with its coordinate at the mode and its variance there, less than one."""
    told = 1.0 - variance
    if told <= 0.0:
        return 0.0
    own, spread = x / told, variance / told
    narrow, wide = spread + 1.0, spread + WIDER**2
    return 0.5 * (own**2 * (1.0 / narrow - 1.0 / wide) + log(narrow / wide))
