"""What is minimised: samples and priors, quadratic in the unknowns.

As Hessian IPOPT is given that of the objective alone (Gauss-Newton): where residuals are noise, the curvature of
the constraints weighs little, and along the constraints the objective is convex from the start, so that every
step leads downhill.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from savgs_ident.fit.collocation.radau import Points
from savgs_ident.fit.collocation.samples import Misfit
from savgs_ident.fit.collocation.unknowns import READINGS, Unknowns


class Objective(NamedTuple):
    """1/2 w' H w - c' w + rest over all unknowns w: half of chi2 of data and priors.

    ``slope`` c is (n,), for n unknowns.
    """

    curvature: csc_array
    slope: NDArray[np.float64]
    rest: float
    samples: int


def assemble_objective(
    unknowns: Unknowns, points: Points, misfits: list[dict[int, Misfit]], priors: NDArray[np.intp]
) -> Objective:
    """The objective of the misfits of all dwells by channel and of unit normal ``priors`` on some parameters.

    ``priors`` (k,) are the places of these parameters.
    """
    first = unknowns.states + unknowns.partners
    rows, columns, values = [priors], [priors], [np.ones(priors.size)]
    slope, rest, count = np.zeros(unknowns.size), 0.0, 0
    for dwell, channels in enumerate(misfits):
        here = np.flatnonzero(points.mesh.layout.dwell == dwell)
        for channel, misfit in channels.items():
            zero = unknowns.zeros[dwell, channel]
            places = np.append(unknowns.at_points[here, first + channel], zero)
            entries = coo_array(misfit.curvature)
            rows.append(places[entries.row])
            columns.append(places[entries.col])
            values.append(READINGS[channel] ** 2 * entries.data)
            slope[places] += READINGS[channel] * misfit.slope
            rest += misfit.rest
            count += misfit.samples
    unused = _unseen(unknowns, misfits)
    rows, columns, values = [*rows, unused], [*columns, unused], [*values, np.ones(unused.size)]
    joined = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    size = (unknowns.size, unknowns.size)
    return Objective(csc_array(coo_array(joined, shape=size)), slope, rest, count)


def _unseen(unknowns: Unknowns, misfits: list[dict[int, Misfit]]) -> NDArray[np.intp]:
    """Zeros of sensors that were not recorded: nothing else would hold them."""
    return np.array(
        [
            zero
            for channels, zeros in zip(misfits, unknowns.zeros, strict=True)
            for channel, zero in enumerate(zeros)
            if channel not in channels
        ],
        np.intp,
    )
