"""The nodes of a motion, and the rate of a signal at them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.simulate.periodic import PeriodicSolution

Signal = NDArray[np.float64]


class Nodes(NamedTuple):
    """Phase [rad], dwell and angular frequency [rad/s] of the nodes, (P,) each."""

    phase: Signal
    dwell: NDArray[np.intp]
    omega: Signal


def nodes_of(solution: PeriodicSolution) -> Nodes:
    """The nodes of a motion."""
    layout = solution.mesh.layout
    omega = 2.0 * np.pi * np.asarray(solution.excitation.frequency)[layout.dwell]
    return Nodes(np.asarray(solution.mesh.phase), np.asarray(layout.dwell), omega)


def rate_of(signal: Signal, nodes: Nodes, solution: PeriodicSolution) -> Signal:
    """Time derivative [unit/s], (P,), of a signal (P,) at the nodes, by differences to both neighbours."""
    layout, gap = solution.mesh.layout, np.asarray(solution.mesh.gap)
    ahead, behind = gap, gap[layout.preceding]
    forward = (signal[layout.following] - signal) / ahead
    backward = (signal - signal[layout.preceding]) / behind
    return np.asarray(nodes.omega * (forward * behind + backward * ahead) / (ahead + behind))
