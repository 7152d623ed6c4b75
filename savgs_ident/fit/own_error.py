"""Which part of an estimate's error is the campaign's own, and which is the same in every campaign of one rig.

Parameters known to a tolerance are estimated along under their priors. What such a part really is differs from its
drawing by an amount that is the same in all campaigns, and shifts what is identified in each by the same. To first
order, with the covariance C of the estimates and the precision P of the priors (zero for identified parameters),

    C = (C - C P C) + C P C

where the first term comes from the noise of the recordings and the second from the priors. Campaigns are compared by
the first alone; their mean has the second in full, however many they are.

>>> round(common_share([0.6, 0.0], [0.5, 2.0], [1.0, 2.0]), 3)
0.09
"""

import numpy as np
from numpy.typing import ArrayLike

_MOST = 1.0 - 1e-9
"""Largest share: noise is never nothing, and what is left of it is divided by."""


def common_share(correlation: ArrayLike, stderr: ArrayLike, prior_sd: ArrayLike) -> float:
    """The share of an estimate's variance that all campaigns have in common, 0 to 1.

    ``correlation`` (n,) is that of the estimate with the n parameters that are known to a tolerance, ``stderr`` their
    standard errors after the fit and ``prior_sd`` those before, in the same units.
    """
    known, after, before = (np.asarray(each, dtype=np.float64) for each in (correlation, stderr, prior_sd))
    return float(np.clip(np.sum((known * after / before) ** 2), 0.0, _MOST))
