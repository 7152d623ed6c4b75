"""The whole optimisation: an objective, constraints and their exact derivatives, and where it starts.

What is minimised is quadratic in the unknowns: the misfits of the samples, and the priors
(:func:`assemble_objective`).

Constraints are the equations of the points, and the rule of the steps, which is linear. The equations of a point,
the model's residual and what the sensors read, know the parameters and the unknowns of that point only: so one
small dense Jacobian, translated to CasADi once (:func:`point_equations`) and evaluated at all points, is put in its
places of the large sparse one.

As Hessian IPOPT is given that of the objective alone (Gauss-Newton): where residuals are noise, the curvature of
the constraints weighs little, and along the constraints the objective is convex from the start, so that every
step leads downhill. It starts at the model's values and the periodic motions there (:func:`start_vector`).
"""

from typing import NamedTuple

import casadi as ca
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array

from savgs_ident.effects.base import InputSignal
from savgs_ident.fit.collocation.transcription import Misfit, Points, Unknowns, step_rule
from savgs_ident.inference.problem import Problem, Task
from savgs_ident.plants.base import Excitation, Motion
from savgs_ident.simulate.excitation import signals_at
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.symbolic.translate import to_casadi


class Objective(NamedTuple):
    """1/2 w' H w - c' w + rest over all unknowns w: half of chi2 of data and priors.

    ``slope`` c is (n,), for n unknowns.
    """

    curvature: csc_array
    slope: NDArray[np.float64]
    rest: float
    samples: int


def assemble_objective(
    unknowns: Unknowns, points: Points, misfits: list[dict[int, Misfit]], widths: NDArray[np.float64]
) -> Objective:
    """The objective of the misfits of all dwells by channel, and of the priors of the parameters.

    ``widths`` (n,) are the standard deviations of their coordinates before the data [1].
    """
    first = unknowns.states + unknowns.algebraic
    places = np.arange(widths.size)
    rows, columns, values = [places], [places], [widths**-2.0]
    slope, rest, count = np.zeros(unknowns.size), 0.0, 0
    for dwell, channels in enumerate(misfits):
        here = np.flatnonzero(points.mesh.layout.dwell == dwell)
        for channel, misfit in channels.items():
            zero = unknowns.zeros[dwell, channel]
            places = np.append(unknowns.at_points[here, first + channel], zero)
            entries = coo_array(misfit.curvature)
            rows.append(places[entries.row])
            columns.append(places[entries.col])
            values.append(unknowns.readings[channel] ** 2 * entries.data)
            slope[places] += unknowns.readings[channel] * misfit.slope
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


def point_equations(problem: Problem, unknowns: Unknowns) -> ca.Function:
    """(z, u, drive) -> equations, all in units of their typical sizes.

    ``z`` are the unknowns of a point, ``u`` the parameters' coordinates, ``drive`` value and rate of each input
    [SI].
    """
    states, algebraic, plant = unknowns.states, unknowns.algebraic, problem.model
    n, signals = len(plant.coordinates), len(plant.inputs)

    def equations(z: Array, u: Array, drive: Array) -> Array:
        here = jnp.asarray(unknowns.scale) * z
        x, y, readings = jnp.split(here, [states, states + algebraic])
        p = problem.parameters(u)
        parts = (x[:n], x[n : 2 * n], y[:n])
        motion = Motion(*(plant.coordinate_type(*(part[i] for i in range(n))) for part in parts))
        inputs = plant.drive(tuple(InputSignal(drive[2 * i], drive[2 * i + 1]) for i in range(signals)))
        balance = plant.residual(p, motion, x[2 * n :], y[n:], inputs)
        seen = jnp.stack(plant.read(p, motion, x[2 * n :], y[n:], inputs))
        return jnp.concatenate([balance, seen - readings]) / jnp.asarray(unknowns.residual_scale)

    inputs = {
        "z": np.zeros(unknowns.width),
        "u": np.zeros(unknowns.parameters),
        "drive": np.zeros(2 * signals),
    }
    return to_casadi("point", equations, inputs, ["equations"])


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
    drive = _drive(problem, points, excitation)
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


def _drive(problem: Problem, points: Points, excitation: Excitation) -> NDArray[np.float64]:
    signals, _ = signals_at(problem.model, excitation, points.mesh)
    return np.stack([np.asarray(part) for signal in signals for part in signal])


def _scaled_rule(unknowns: Unknowns, points: Points, frequency: NDArray[np.float64]) -> csc_array:
    """The step rule in units of the states' typical sizes."""
    states, scale = unknowns.states, unknowns.scale
    seconds = points.step / (2.0 * np.pi * frequency[points.mesh.layout.dwell[::2]])
    at = unknowns.at_points
    q = len(unknowns.coordinates)
    velocities = list(range(q, 2 * q))
    algebraic = list(range(states, states + unknowns.algebraic))
    rule = step_rule(points, seconds, at[:, :states], at[:, velocities + algebraic])
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


def start_vector(
    task: Task, program: Program, points: Points, warm_start: PeriodicSolution
) -> NDArray[np.float64]:
    """All unknowns, scaled [1], (n,).

    The model's values, the motions there, ``warm_start``, and what the sensors would read of these.
    """
    unknowns = program.unknowns
    w = np.zeros(unknowns.size)
    w[: unknowns.parameters] = task.problem.free.to_unconstrained(task.table.as_dict())
    known = unknowns.states + unknowns.algebraic
    at = unknowns.at_points
    w[at[:, :known]] = _at_points(points, warm_start) / unknowns.scale[:known]
    missed = np.array(program.constraints(w)).ravel()[: unknowns.points * unknowns.residual_scale.size]
    w[at[:, known:]] = missed.reshape(unknowns.points, -1)[:, unknowns.algebraic :]
    return w


def _at_points(points: Points, warm_start: PeriodicSolution) -> NDArray[np.float64]:
    """The motions at the points by straight lines, (P, states and algebraic variables)."""
    values = np.concatenate([warm_start.trajectory.x, warm_start.trajectory.y]).T
    found = np.empty_like(values)
    for dwell in range(len(warm_start.mesh.layout.counts)):
        mine = warm_start.mesh.layout.dwell == dwell
        nodes, wanted = np.asarray(warm_start.mesh.phase)[mine], np.asarray(points.mesh.phase)[mine]
        columns = [np.interp(wanted, nodes, column, period=2.0 * np.pi) for column in values[mine].T]
        found[mine] = np.stack(columns, axis=1)
    return found
