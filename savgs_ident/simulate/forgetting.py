"""Whether a plant has forgotten how its motion in a window began where the comparison begins."""

from typing import cast

import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.responses.harmonic_response import ComparedPart
from savgs_ident.simulate.periodic import PeriodicSolution

REMEMBERED = 0.01
"""Largest share of how a motion began that may be left where the comparison in a window begins [1]."""


def require_forgetting(solution: PeriodicSolution) -> None:
    """See that the motion in every window has forgotten how it began where the comparison begins.

    A deviation of the states, each in units of its largest value in the window, is followed along the linearised
    motion. Raises :class:`InputError` if more than :data:`REMEMBERED` of one is left in any window, which are of one
    length.
    """
    layout, part = solution.mesh.layout, solution.excitation.part
    windows, nodes = len(layout.counts), layout.counts[0]
    steps = np.asarray(solution.linearised.factors.steps)
    by_node = np.moveaxis(steps.reshape(*steps.shape[:2], windows, nodes), (3, 2), (0, 1))
    phase = np.asarray(solution.mesh.phase).reshape(windows, nodes)
    left = np.broadcast_to(np.eye(steps.shape[0]), by_node.shape[1:])
    for node in range(nodes):
        before = phase[:, node] < np.asarray(cast(ComparedPart, part).begin)
        left = np.where(before[:, None, None], by_node[node] @ left, left)
    largest = np.abs(np.asarray(solution.trajectory.x)).reshape(-1, windows, nodes).max(axis=2).T
    size = np.maximum(largest, np.finfo(float).tiny)
    share = float(np.linalg.norm(left * size[:, None, :] / size[:, :, None], axis=1).max())
    if not share < REMEMBERED:
        raise InputError(
            f"the model remembers {100.0 * share:.2g} % of how a motion began where windows are compared",
            remedy="record dwells: a plant that rings for so long is not identified from windows",
        )
