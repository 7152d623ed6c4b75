"""The samples of a dwell against values at nodes of its period, as a quadratic form.

A sample at phase phi is predicted by interpolation between nodes, linear in the values m there: W m + o, with
o the unknown zero of the sensor. So the sum of squares over all samples,

    |y - W m - o|^2 / sd^2,

is a quadratic form of (m, o): thousands of samples become a band matrix over the nodes, with nothing lost.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, hstack

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.clocks import group_by_clock, highest_fitted_order
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis

ROAD = "road_height"

_POINTS = 4
"""Nodes that a sample is interpolated between: a cubic."""


class Samples(NamedTuple):
    """Samples of one channel of one dwell: ``phase`` [rad] of each, ``values`` [unit], both (N,); ``sd`` [unit]."""

    phase: NDArray[np.float64]
    values: NDArray[np.float64]
    sd: float


class Misfit(NamedTuple):
    """Half the weighted sum of squares, 1/2 v' H v - c' v + rest, of v = (values at the nodes, zero of the sensor).

    ``curvature`` H (n + 1, n + 1), ``slope`` c (n + 1,), of so many ``samples``. It has no dimension [1]: v
    is in the unit of the channel, c in one over it.
    """

    curvature: csr_array
    slope: NDArray[np.float64]
    rest: float
    samples: int


def find_recordings(campaign: Campaign, measured: HarmonicResponse) -> tuple[Recording, ...]:
    """The recordings behind the dwells of a response, in its order.

    Raises :class:`InputError` for a dwell that the campaign does not hold, or for channels whose clocks run at
    different rates: their stamps would have to be corrected first.
    """
    by_name = {recording.name: recording for recording in campaign.of_kind("dwell")}
    for test in measured.tests:
        if test not in by_name:
            raise InputError(
                "the response has a dwell that was not recorded",
                source=campaign.source,
                test=test,
                remedy="take response and samples from the same campaign",
            )
    for warning in measured.warnings:
        if warning.code == "clock_rate_differs":
            raise InputError(
                "the clocks of its channels run at different rates",
                source=campaign.source,
                channel=warning.channel,
                remedy="correct the time stamps, the cross-check takes them as they are",
            )
    return tuple(by_name[test] for test in measured.tests)


def samples_of(recording: Recording, frequency: float, sd: dict[str, float]) -> dict[str, Samples]:
    """Samples of the channels named in ``sd``, those that were recorded.

    ``frequency`` [Hz] is the dwell's measured fundamental, ``sd`` the noise of one sample by channel [unit].
    Phases count from where the road's fundamental is at its highest, as those of the harmonics do.
    """
    road = recording.channels[ROAD]
    middle = 0.5 * float(road.time[0] + road.time[-1])
    groups = group_by_clock(recording, middle, {})
    lead = next(group for group in groups if ROAD in group.names)
    highest = highest_fitted_order(lead, frequency)
    height = lead.values[lead.names.index(ROAD)][None]
    fit = fit_periodic(plan_basis(lead.time, frequency, highest), height, highest, 0)
    ahead = float(np.angle(fit.amplitude[0, 1]))
    found = {}
    for group in groups:
        phase = np.mod(2.0 * np.pi * frequency * group.time + ahead, 2.0 * np.pi)
        for name, values in zip(group.names, group.values, strict=True):
            if name in sd:
                found[name] = Samples(phase, values, sd[name])
    return found


def interpolation(nodes: NDArray[np.float64], phase: NDArray[np.float64]) -> csr_array:
    """Weights (N, n) of periodic values at ``nodes`` (n,) [rad], growing, for their values at ``phase`` (N,)."""
    count = nodes.size
    first = np.searchsorted(nodes, phase, side="right") - _POINTS // 2
    near = first[:, None] + np.arange(_POINTS)
    turns, places = np.divmod(near, count)
    at = nodes[places] + 2.0 * np.pi * turns
    weights = np.ones_like(at)
    for i in range(_POINTS):
        for j in range(_POINTS):
            if j != i:
                weights[:, i] *= (phase - at[:, j]) / (at[:, i] - at[:, j])
    rows = np.repeat(np.arange(phase.size), _POINTS)
    return csr_array((weights.ravel(), (rows, places.ravel())), shape=(phase.size, count))


def misfit_of(samples: Samples, nodes: NDArray[np.float64]) -> Misfit:
    """The misfit of samples against values at ``nodes`` (n,) [rad]."""
    count = samples.values.size
    inner = interpolation(nodes, samples.phase)
    ones = csr_array(np.ones((count, 1)))
    design = hstack([inner, ones], format="csr") / samples.sd
    y = samples.values / samples.sd
    return Misfit(csr_array(design.T @ design), design.T @ y, 0.5 * float(y @ y), count)
