"""Strain: a parameter that the data pull further from its sheet than its tolerance allows.

A model may miss nothing and still be wrong, if it does so with a spring ten standard deviations off its sheet. What
is held against the tolerances as they are is that one of them does not hold: its prior is as much wider as
:data:`WIDER` says. To first order about the mode, both evidences follow from where the data alone would have the
parameter, and how sharply.
"""

from math import exp, inf, log
from typing import NamedTuple

import numpy as np

from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.engine.coordinates import Coordinates, Linear

WIDER = 10.0
"""By how much wider the prior is of a parameter whose tolerance does not hold."""


class Strain(NamedTuple):
    """What speaks for a tolerance that does not hold.

    Attributes:
        gain: rise of the log evidence of the mode if one of the tolerances may not hold, no matter which.
        parameter: the one that is strained most; empty where none is known to a tolerance.
        tolerances: how many of its tolerances (standard deviations) it is off its sheet.
    """

    gain: float
    parameter: str
    tolerances: float


def strain_of(mode: Mode, nuisances: Coordinates) -> Strain:
    """The strain of a mode in those of its ``nuisances`` that are known to a tolerance."""
    known = {each.name for each in nuisances if isinstance(each, Linear)}
    variance = np.diag(mode.covariance())
    gains = {
        each.name: (_gain(float(x), float(v)), float(x))
        for each, x, v in zip(mode.coordinates, mode.x, variance, strict=True)
        if each.name in known
    }
    if not gains:
        return Strain(-inf, "", 0.0)
    name, (best, off) = max(gains.items(), key=lambda each: each[1][0])
    return Strain(best + log(sum(exp(each - best) for each, _ in gains.values()) / len(gains)), name, off)


def _gain(x: float, variance: float) -> float:
    """The same of one parameter, with its coordinate at the mode and its variance there, less than one."""
    told = 1.0 - variance
    if told <= 0.0:
        return 0.0
    own, spread = x / told, variance / told
    narrow, wide = spread + 1.0, spread + WIDER**2
    return 0.5 * (own**2 * (1.0 / narrow - 1.0 / wide) + log(narrow / wide))
