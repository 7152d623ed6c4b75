"""The identified parameters by direct collocation, from the samples of all dwells at once.

    found = fit_by_collocation(campaign, measured, model, free=FREE)
    found.by_name["mu_r"].value, found.by_name["mu_r"].stderr

The optimisation (:mod:`savgs_ident.fit.collocation.program`) starts from the model's values and the periodic motions
there. Parameters known to a tolerance are estimated along under their priors, as in the fit. IPOPT solves it, and its
outcome becomes a status.

What the samples say of the parameters follows from the solved program (:func:`information`). The constraints fix the
motions once the parameters are given: J_z dz = -J_u du. So the objective's curvature, taken along, is the information
on parameters and sensors' zeros; the latter are eliminated.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import casadi as ca
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.status import Status
from savgs_ident.fit.collocation.program import (
    Program,
    as_casadi,
    assemble_objective,
    assemble_program,
    start_vector,
)
from savgs_ident.fit.collocation.transcription import (
    Misfit,
    Points,
    find_recordings,
    misfit_of,
    radau_points,
    samples_of,
    unknowns_of,
)
from savgs_ident.fit.estimate import Estimate
from savgs_ident.fit.identifiability import INFORMED
from savgs_ident.inference.laplace import Spread, spread_of
from savgs_ident.inference.problem import ProblemSettings, Task, plan_task
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic

AMD = 0
"""The ordering of unknowns that MUMPS is to use: approximate minimum degree. It takes half the time of the one
that it would choose here, and loses less to rounding, which IPOPT would take for a wrong curvature."""

OBJECTIVE_UNIT = 1e4
"""The objective is given to IPOPT in these: so its slopes are of the order of those of the constraints."""

_OUTCOMES = {
    "Solve_Succeeded": Status.CONVERGED,
    "Maximum_Iterations_Exceeded": Status.MAX_ITERATIONS,
    "Invalid_Number_Detected": Status.NOT_FINITE,
}


class Solution(NamedTuple):
    """Scaled unknowns ``w`` [1], (n,), where IPOPT ended, the objective there [1], and its iterations."""

    w: NDArray[np.float64]
    objective: float
    status: Status
    iterations: int


def solve_program(
    program: Program, start: NDArray[np.float64], iterations: int, tolerance: float
) -> Solution:
    """IPOPT from scaled unknowns ``start`` [1], (n,), until constraints and scaled slopes are within ``tolerance``.

    Look at ``status`` of the solution: any end but the one asked for is a failure, and where IPOPT does not say
    more the problem counts as stalled.
    """
    solver = _solver(program, iterations, tolerance)
    found = solver(x0=start, lbg=0.0, ubg=0.0)
    w, said = np.array(found["x"]).ravel(), solver.stats()
    status = _OUTCOMES.get(said["return_status"], Status.STALLED)
    return Solution(w, float(found["f"]), status, int(said["iter_count"]))


def _solver(program: Program, iterations: int, tolerance: float) -> ca.Function:
    quadratic, size = program.quadratic, program.unknowns.size
    curvature = as_casadi(quadratic.curvature)
    w, nothing = ca.MX.sym("w", size), ca.MX.sym("nothing", 0)
    weight, prices = ca.MX.sym("weight"), ca.MX.sym("prices", program.constraints.size1_out(0))
    slope = ca.mtimes(curvature, w) - quadratic.slope
    value = 0.5 * ca.dot(w, slope - quadratic.slope) + quadratic.rest
    within = program.constraints(w)
    options: dict[str, Any] = {
        "grad_f": ca.Function("gradient", [w, nothing], [value, slope]),
        "jac_g": ca.Function("slopes", [w, nothing], [within, program.jacobian(w)]),
        "hess_lag": ca.Function("curvature", [w, nothing, weight, prices], [weight * ca.triu(curvature)]),
        "no_nlp_grad": True,
        "calc_lam_p": False,
        "show_eval_warnings": False,
        "print_time": False,
        "ipopt": {
            "max_iter": iterations,
            "tol": tolerance,
            "acceptable_iter": 0,
            "nlp_scaling_method": "none",
            "obj_scaling_factor": 1.0 / OBJECTIVE_UNIT,
            "hessian_constant": "yes",
            "mumps_pivot_order": AMD,
            "print_level": 0,
            "sb": "yes",
        },
    }
    return ca.nlpsol("crosscheck", "ipopt", {"x": w, "f": value, "g": within}, options)


def information(program: Program, w: NDArray[np.float64]) -> NDArray[np.float64]:
    """Information matrix (n, n) of the parameters' coordinates at the solution ``w`` [1], (m,), priors included.

    Raises :class:`RuntimeError` where the constraints do not fix the motions.
    """
    unknowns = program.unknowns
    n, first_zero = unknowns.parameters, unknowns.size - unknowns.zeros.size
    found = program.jacobian(w)
    colind, row = found.sparsity().get_ccs()
    jacobian = csc_array((np.array(found.nonzeros()), row, colind), shape=found.shape)
    motion = splu(csc_array(jacobian[:, n:first_zero]))
    follow = motion.solve(-jacobian[:, :n].toarray())
    along = np.zeros((unknowns.size, n + unknowns.zeros.size))
    along[:n, :n] = np.eye(n)
    along[n:first_zero, :n] = follow
    along[first_zero:, n:] = np.eye(unknowns.zeros.size)
    whole = along.T @ (program.quadratic.curvature @ along)
    coupling, of_zeros = whole[:n, n:], whole[n:, n:]
    reduced: NDArray[np.float64] = whole[:n, :n] - coupling @ np.linalg.solve(of_zeros, coupling.T)
    return reduced


def spread_at(program: Program, w: NDArray[np.float64]) -> Spread:
    """The spread of the parameters' coordinates; directions that the samples do not identify as in a fit.

    ``w`` [1], (m,), are the scaled unknowns of the solution.
    """
    values, axes = np.linalg.eigh(information(program, w))
    return spread_of((axes * np.sqrt(np.maximum(values, 0.0))).T)


@dataclass(frozen=True)
class CollocationFit:
    """What the cross-check found; arrays are read-only.

    Attributes:
        estimates: all estimated parameters, free ones first.
        covariance: of the estimates in their order [products of their units], (n, n).
        chi2: weighted sum of squared residuals of the samples.
        dof: samples less free parameters and zeros of sensors.
        prior_chi2: squared deviations of the tolerance parameters in their standard deviations.
        status: how IPOPT ended.
        iterations: how many it took.
        tests: names of the dwells.
        unknowns: variables of the optimisation.
        wall_s: time taken [s].
    """

    estimates: tuple[Estimate, ...]
    covariance: NDArray[np.float64]
    chi2: float
    dof: int
    prior_chi2: float
    status: Status
    iterations: int
    tests: tuple[str, ...]
    unknowns: int
    wall_s: float

    def __post_init__(self) -> None:
        self.covariance.flags.writeable = False

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """The estimates by parameter name."""
        return {estimate.name: estimate for estimate in self.estimates}


def assemble_result(task: Task, program: Program, end: Solution, wall_s: float) -> CollocationFit:
    """The whole, frozen result; without a solution there is no covariance."""
    problem, n = task.problem, program.unknowns.parameters
    u = jnp.asarray(end.w[:n])
    spread = spread_at(program, end.w) if end.status.ok else Spread(np.full((n, n), np.nan))
    slope = np.asarray(problem.slopes(u))
    prior = float(np.sum(np.asarray(problem.free.prior_residuals(u)) ** 2))
    known = len(problem.free.identified) + program.unknowns.zeros.size
    return CollocationFit(
        estimates=_estimates(task, u, slope * _identified_sd(spread, problem.free)),
        covariance=np.asarray(spread.covariance * np.outer(slope, slope), np.float64),
        chi2=2.0 * end.objective - prior,
        dof=program.quadratic.samples - known,
        prior_chi2=prior,
        status=end.status,
        iterations=end.iterations,
        tests=task.measured.tests,
        unknowns=program.unknowns.size,
        wall_s=wall_s,
    )


def _identified_sd(spread: Spread, free: FreeVector) -> NDArray[np.float64]:
    """Standard deviations of the coordinates, infinite where the data do not identify what they are asked for."""
    asked = np.arange(len(free.names)) < len(free.identified)
    return np.where(asked & (spread.sd >= INFORMED * free.widths), np.inf, spread.sd)


def _estimates(task: Task, u: Array, stderr: NDArray[np.float64]) -> tuple[Estimate, ...]:
    free, values = task.problem.free, task.problem.parameters(u)
    estimates = []
    for name, sd in zip(free.names, stderr, strict=True):
        known = task.table[name]
        estimates.append(
            Estimate(
                name=name,
                value=float(values[name]),
                stderr=float(sd),
                own_stderr=float(sd),
                unit=known.unit,
                free=name in free.identified,
                prior=known.value,
                prior_sd=known.tolerance,
            )
        )
    return tuple(estimates)


Progress = Callable[[str], None]


@dataclass(frozen=True)
class CollocationSettings:
    """How to solve.

    Attributes:
        fixed_tolerances: take the parameters with a tolerance as exact instead of estimating them along.
        iterations: most iterations of IPOPT.
        tolerance: largest violation of a constraint, and largest slope left, in units of typical sizes.
        periodic: how the motions to start from are solved; there are as many points as it has nodes.
    """

    fixed_tolerances: bool = False
    iterations: int = 100
    tolerance: float = 1e-8
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)


def fit_by_collocation(
    campaign: Campaign,
    measured: HarmonicResponse,
    model: Model,
    *,
    free: tuple[str, ...],
    settings: CollocationSettings | None = None,
    progress: Progress | None = None,
) -> CollocationFit:
    """Estimate ``free`` parameters of a model from the samples of the dwells of ``measured``.

    The response gives frequencies, noise, and the harmonics of the inputs; the samples of the channels come from
    ``campaign``. ``progress`` is called with what is being done. Look at the ``status`` of the result.

    Raises :class:`InputError` for names that do not exist or that the model does not use, and for recordings that do
    not belong to the response.
    """
    began, report = time.perf_counter(), progress or _silent
    settings = settings or CollocationSettings()
    planned = ProblemSettings(fixed_tolerances=settings.fixed_tolerances, periodic=settings.periodic)
    task = plan_task(measured, model, free, planned)
    report("solving the model as given")
    warm_start = simulate_periodic(task.problem.model, task.problem.fixed, task.excitation, settings.periodic)
    points = radau_points(warm_start.mesh)
    report("gathering the samples")
    misfits = _misfits(campaign, measured, model.plant, points)
    report("translating the equations")
    program = _program(task, points, misfits)
    report(f"IPOPT: {program.unknowns.size} unknowns, {program.quadratic.samples} samples")
    start = start_vector(task, program, points, warm_start)
    end = solve_program(program, start, settings.iterations, settings.tolerance)
    report(f"IPOPT: {end.iterations} iterations, {end.status.advice}")
    return assemble_result(task, program, end, time.perf_counter() - began)


def _silent(line: str) -> None:
    del line


def _misfits(
    campaign: Campaign,
    measured: HarmonicResponse,
    plant: AbstractPlant | type[AbstractPlant],
    points: Points,
) -> list[dict[int, Misfit]]:
    """For each dwell the misfit of each response channel that was recorded."""
    misfits, driven = [], plant.inputs[0].name
    names = [each.name for each in plant.channels]
    for dwell, recording in enumerate(find_recordings(campaign, measured)):
        nodes = np.asarray(points.mesh.phase)[points.mesh.layout.dwell == dwell]
        sd = {
            name: float(measured.noise_sd[dwell, measured.channel(name)])
            for name in names
            if name in measured.channels and measured.noise_sd[dwell, measured.channel(name)] > 0.0
        }
        samples = samples_of(recording, driven, float(measured.frequency[dwell]), sd)
        misfits.append({names.index(name): misfit_of(s, nodes) for name, s in samples.items()})
    return misfits


def _program(task: Task, points: Points, misfits: list[dict[int, Misfit]]) -> Program:
    unknowns = unknowns_of(task, points)
    quadratic = assemble_objective(unknowns, points, misfits, task.problem.free.widths)
    return assemble_program(task.problem, unknowns, points, task.excitation, quadratic)
