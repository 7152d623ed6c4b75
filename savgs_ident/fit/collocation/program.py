"""The whole optimisation: an objective, constraints and their exact derivatives.

Constraints are the equations of the points, and the rule of the steps, which is linear. The equations of a point
know the parameters and the unknowns of that point only: so one small dense Jacobian, told to CasADi once and
evaluated at all points, is put in its places of the large sparse one.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from savgs_ident.fit.collocation.objective import Objective
from savgs_ident.fit.collocation.point import point_equations
from savgs_ident.fit.collocation.radau import Points, step_rule
from savgs_ident.fit.collocation.unknowns import Unknowns
from savgs_ident.fit.problem import Problem
from savgs_ident.simulate.excitation import Excitation, inputs_at

THREADS = 2
"""The points are evaluated in so many threads."""


class Program(NamedTuple):
    """The objective, and constraints that are to vanish with their ``jacobian``, as CasADi functions of w."""

    unknowns: Unknowns
    quadratic: Objective
    constraints: ca.Function
    jacobian: ca.Function


def assemble_program(
    problem: Problem, unknowns: Unknowns, points: Points, excitation: Excitation, quadratic: Objective
) -> Program:
    """Constraints and their Jacobian for all points."""
    drive = _drive(points, excitation)
    rule = _scaled_rule(unknowns, points, np.asarray(excitation.frequency))
    point = point_equations(problem, unknowns)
    w = ca.MX.sym("w", unknowns.size)
    z = ca.reshape(
        w[unknowns.parameters : unknowns.parameters + unknowns.points * unknowns.width],
        unknowns.width,
        unknowns.points,
    )
    u = ca.repmat(w[: unknowns.parameters], 1, unknowns.points)
    linear = as_casadi(rule)
    equations = point.map(unknowns.points, "thread", THREADS)(z, u, drive)
    constraints = ca.Function("constraints", [w], [ca.vertcat(ca.vec(equations), ca.mtimes(linear, w))])
    slopes, pattern = _point_slopes(point)
    found = slopes.map(unknowns.points, "thread", THREADS)(z, u, drive)
    jacobian = _placed(unknowns, pattern, ca.vec(found), rule, w)
    return Program(unknowns, quadratic, constraints, jacobian)


def _drive(points: Points, excitation: Excitation) -> NDArray[np.float64]:
    at = inputs_at(excitation, points.mesh)
    return np.stack([np.asarray(part) for part in (*at.road, *at.link)])


def _scaled_rule(unknowns: Unknowns, points: Points, frequency: NDArray[np.float64]) -> csc_array:
    """The step rule in units of the states' typical sizes."""
    states, scale = unknowns.states, unknowns.scale
    seconds = points.step / (2.0 * np.pi * frequency[points.mesh.layout.dwell[::2]])
    at = unknowns.at_points
    velocities = [2, 3]
    partners = list(range(states, states + unknowns.partners))
    rule = step_rule(points, seconds, at[:, :states], at[:, velocities + partners])
    rule.resize((rule.shape[0], unknowns.size))
    sizes = np.ones(unknowns.size)
    sizes[at.ravel()] = np.tile(scale, unknowns.points)
    rows = np.tile(scale[:states], unknowns.points)
    entries = coo_array(rule)
    values = entries.data * sizes[entries.col] / rows[entries.row]
    return csc_array(coo_array((values, (entries.row, entries.col)), shape=rule.shape))


def _point_slopes(point: ca.Function) -> tuple[ca.Function, ca.Sparsity]:
    z, u, drive = (ca.SX.sym(point.name_in(i), point.size1_in(i)) for i in range(3))
    jacobian = ca.jacobian(point(z, u, drive), ca.vertcat(u, z))
    return ca.Function("slopes", [z, u, drive], [jacobian.nz[:]]), jacobian.sparsity()


def _placed(unknowns: Unknowns, pattern: ca.Sparsity, found: ca.MX, rule: csc_array, w: ca.MX) -> ca.Function:
    """The sparse Jacobian of all constraints from the nonzeros of all points."""
    row, column = (np.array(each, np.intp) for each in pattern.get_triplet())
    count, offset = unknowns.residual_scale.size, unknowns.parameters
    point = np.arange(unknowns.points)[:, None]
    rows = (point * count + row).ravel()
    local = column >= offset
    columns = np.where(local, offset + point * unknowns.width + column - offset, column).ravel()
    entries = coo_array(rule)
    rows = np.concatenate([rows, entries.row + unknowns.points * count])
    columns = np.concatenate([columns, entries.col])
    shape = (unknowns.points * count + rule.shape[0], unknowns.size)
    order = np.lexsort((rows, columns))
    starts = np.searchsorted(columns[order], np.arange(shape[1] + 1))
    sparsity = ca.Sparsity(*shape, starts.tolist(), rows[order].tolist())
    values = ca.vertcat(found, ca.DM(entries.data))
    return ca.Function("jacobian", [w], [ca.MX(sparsity, values[order.tolist()])])


def as_casadi(matrix: csc_array) -> ca.DM:
    """A sparse matrix as CasADi has it."""
    matrix = csc_array(matrix)
    matrix.sort_indices()
    rows, columns = matrix.shape
    sparsity = ca.Sparsity(rows, columns, matrix.indptr.tolist(), matrix.indices.tolist())
    return ca.DM(sparsity, matrix.data)
