"""Where the optimisation starts: the rig file's values, and the periodic motions there."""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.fit.collocation.program import Program
from savgs_ident.fit.collocation.radau import Points
from savgs_ident.fit.task import Task
from savgs_ident.simulate.periodic import PeriodicSolution


def start_vector(task: Task, program: Program, points: Points, near: PeriodicSolution) -> NDArray[np.float64]:
    """All unknowns, scaled [1], (n,).

    The rig's values, the motions ``near`` them, and what the sensors would read of these.
    """
    unknowns = program.unknowns
    w = np.zeros(unknowns.size)
    w[: unknowns.parameters] = task.problem.free.to_unconstrained(task.table.as_dict())
    known = unknowns.states + unknowns.partners
    at = unknowns.at_points
    w[at[:, :known]] = _at_points(points, near) / unknowns.scale[:known]
    missed = np.array(program.constraints(w)).ravel()[: unknowns.points * unknowns.residual_scale.size]
    w[at[:, known:]] = missed.reshape(unknowns.points, -1)[:, unknowns.partners :]
    return w


def _at_points(points: Points, near: PeriodicSolution) -> NDArray[np.float64]:
    """The motions at the points by straight lines, (P, states and their partners)."""
    values = np.concatenate([near.trajectory.x, near.trajectory.y]).T
    found = np.empty_like(values)
    for dwell in range(len(near.mesh.layout.counts)):
        mine = near.mesh.layout.dwell == dwell
        nodes, wanted = np.asarray(near.mesh.phase)[mine], np.asarray(points.mesh.phase)[mine]
        columns = [np.interp(wanted, nodes, column, period=2.0 * np.pi) for column in values[mine].T]
        found[mine] = np.stack(columns, axis=1)
    return found
