"""Windows in which a plant has forgotten how its motion began where the comparison begins."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.values import as_values
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation, only_tests
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic

REMEMBERED = 0.01
"""Largest share of how a motion began that may be left where the comparison in a window begins [1]."""


def lasting_windows(response: HarmonicResponse, model: Model) -> HarmonicResponse:
    """The windows of a response in which a model forgets how the motion began; dwells as they are.

    With a warning ``window_remembers`` for each that is left out: friction may stick through its beginning. Raises
    :class:`InputError` if the model has no motion or forgets in no window.
    """
    if response.part is None:
        return response
    plant, p = model.build(), as_values(model.table.as_dict())
    solution = simulate_periodic(plant, p, measured_excitation(plant, response, model.table))
    left = remembered(solution, response.part)
    kept = np.flatnonzero(left < REMEMBERED)
    if kept.size == 0:
        raise InputError(
            f"the model remembers {100.0 * np.min(left):.2g} % of how a motion began where windows are compared",
            remedy="record dwells: a plant that rings or sticks for so long is not identified from windows",
        )
    gone = [d for d in range(left.size) if d not in kept]
    warnings = tuple(
        DataWarning(
            "window_remembers",
            f"is left out: the model remembers {100.0 * left[d]:.2g} % of how the motion in it began",
            test=response.tests[d],
            remedy="let the plant move for some seconds before what matters",
        )
        for d in gone
    )
    return replace(only_tests(response, kept), warnings=(*response.warnings, *warnings)) if gone else response


def remembered(solution: PeriodicSolution, part: ComparedPart) -> NDArray[np.float64]:
    """What is left of how the motion in each window began where the comparison begins [1], (D,).

    A deviation of the states, each in units of its largest value in the window, is followed along the linearised
    motion; the windows are of one length. Infinite where there is no motion.
    """
    windows, nodes = len(solution.mesh.layout.counts), solution.mesh.layout.counts[0]
    steps = np.asarray(solution.linearised.factors.steps)
    by_node = np.moveaxis(steps.reshape(*steps.shape[:2], windows, nodes), (3, 2), (0, 1))
    phase = np.asarray(solution.mesh.phase).reshape(windows, nodes)
    left = np.broadcast_to(np.eye(steps.shape[0]), by_node.shape[1:])
    for node in range(nodes):
        before = phase[:, node] < part.begin
        left = np.where(before[:, None, None], by_node[node] @ left, left)
    largest = np.abs(np.asarray(solution.trajectory.x)).reshape(-1, windows, nodes).max(axis=2).T
    size = np.maximum(largest, np.finfo(float).tiny)
    share = np.linalg.norm(left * size[:, None, :] / size[:, :, None], axis=1).max(axis=1)
    solved = np.array([each.ok for each in solution.status()])
    return np.where(solved & np.isfinite(share), share, np.inf)
