"""The whole optimisation: its objective, its constraints and their exact derivatives.

The objective is quadratic in the unknowns (:mod:`savgs_ident.fit.collocation.samples`); constraints are the
equations of the points and the rule of the steps, which is linear. As Hessian IPOPT is given that of the
objective alone (Gauss-Newton): where residuals are noise, the curvature of the constraints weighs little, and
the reduced Hessian is positive definite from the start, so that every step leads downhill.
"""

from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from savgs_ident.fit.collocation.point import point_equations
from savgs_ident.fit.collocation.radau import Points, step_rule
from savgs_ident.fit.collocation.samples import Misfit
from savgs_ident.fit.collocation.unknowns import READINGS, Unknowns
from savgs_ident.fit.problem import Problem
from savgs_ident.simulate.excitation import Excitation, inputs_at


class Objective(NamedTuple):
    """1/2 w' H w - c' w + rest over all unknowns w: half of chi2 of data and priors."""

    curvature: csc_array
    slope: NDArray[np.float64]
    rest: float
    samples: int


class Program(NamedTuple):
    """The objective, and constraints that are to vanish with their ``jacobian``, as CasADi functions of w."""

    unknowns: Unknowns
    quadratic: Objective
    constraints: ca.Function
    jacobian: ca.Function


def assemble_objective(
    unknowns: Unknowns, points: Points, misfits: list[dict[int, Misfit]], priors: NDArray[np.intp]
) -> Objective:
    """The objective of the misfits of all dwells by channel and of unit normal ``priors`` on some parameters."""
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
    equations = point.map(unknowns.points, "thread", 2)(z, u, drive)
    constraints = ca.Function("constraints", [w], [ca.vertcat(ca.vec(equations), ca.mtimes(linear, w))])
    slopes, pattern = _point_slopes(point)
    found = slopes.map(unknowns.points, "thread", 2)(z, u, drive)
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
