"""Periodic motions by the Radau IIA rule with two points a step, the model's residual holding at each point.

    x_i = x_0 + h sum_j a_ij xd_j,    a = ((5/12, -1/12), (3/4, 1/4)),    points at 1/3 and 1 of the step

of third order, and stable however stiff the model: what a friction's bristle asks for. The steps are pairs of
those of an earlier solution on a :class:`savgs_ident.simulate.mesh.Mesh`, so that there are as many points as
that has nodes, dense where it is.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from savgs_ident.simulate.mesh import Mesh

A = np.array([[5.0 / 12.0, -1.0 / 12.0], [3.0 / 4.0, 1.0 / 4.0]])
"""The rule's coefficients."""

C = np.array([1.0 / 3.0, 1.0])
"""Where in the step its points stand."""


class Points(NamedTuple):
    """Points of all dwells, two a step, flat in the mesh's layout.

    ``mesh`` has the points in place of its nodes; ``step`` [rad] is the length of each step and ``before`` the
    point at which it begins, both (P / 2,).
    """

    mesh: Mesh
    step: NDArray[np.float64]
    before: NDArray[np.intp]


def radau_points(mesh: Mesh) -> Points:
    """Points in the steps between every other node of ``mesh``."""
    layout = mesh.layout
    gap = np.asarray(mesh.gap).reshape(-1, 2)
    start, step = np.asarray(mesh.phase)[::2], gap.sum(axis=1)
    phase = (start[:, None] + step[:, None] * C).ravel()
    first = np.zeros(layout.total, bool)
    first[layout.starts] = True
    ends = np.arange(1, layout.total, 2)
    before = np.where(first[::2], layout.preceding[::2], ends - 2)
    gaps = _gaps(phase, layout.following)
    return Points(Mesh(layout, phase, gaps, gaps / (2.0 * np.pi)), step, before)


def _gaps(phase: NDArray[np.float64], following: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.mod(phase[following] - phase, 2.0 * np.pi)


def step_rule(
    points: Points, seconds: NDArray[np.float64], states: NDArray[np.intp], rates: NDArray[np.intp]
) -> csr_array:
    """The rule as a matrix that vanishes on what keeps it: rows (P m,), columns the unknowns of all points.

    ``states`` and ``rates`` (P, m) are the columns of the m states and of their time derivatives at each point;
    ``seconds`` (P / 2,) is the length of each step [s].
    """
    total, width = states.shape
    row = np.arange(total * width).reshape(total, width)
    pair = np.arange(total).reshape(-1, 2)
    entries = [(row, states, np.ones_like(row, float))]
    begin = np.repeat(points.before, 2)
    entries.append((row, states[begin], -np.ones_like(row, float)))
    for i in range(2):
        for j in range(2):
            weight = -A[i, j] * seconds[:, None] * np.ones(width)
            entries.append((row[pair[:, i]], rates[pair[:, j]], weight))
    rows, columns, values = (
        np.concatenate([part.ravel() for part in each]) for each in zip(*entries, strict=True)
    )
    size = 1 + int(max(states.max(), rates.max()))
    return csr_array(coo_array((values, (rows, columns)), shape=(total * width, size)))
