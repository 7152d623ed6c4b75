"""The optimisation problem: exact derivatives, and constraints that the model's own motions nearly meet."""

from typing import NamedTuple

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_array

from savgs_ident.fit.collocation.program import Program, assemble_objective, assemble_program, start_vector
from savgs_ident.fit.collocation.transcription import (
    Points,
    Samples,
    interpolation,
    misfit_of,
    radau_points,
    unknowns_of,
)
from savgs_ident.inference.problem import ProblemSettings, Task, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic

from .bench import FEW

pytestmark = pytest.mark.slow


class Posed(NamedTuple):
    """A program for the shipped dwells, with samples made up, and where it starts."""

    task: Task
    points: Points
    program: Program
    start: NDArray[np.float64]
    samples: Samples


@pytest.fixture(scope="module")
def posed(few: HarmonicResponse, rig: Rig) -> Posed:
    """Deflections of the first dwell only, all tolerances free."""
    task = plan_task(few, RigModel(rig, MODELS["simtr"]), FREE, ProblemSettings())
    near = simulate_periodic(task.problem.model, task.problem.fixed, task.excitation)
    points = radau_points(near.mesh)
    layout, free = points.mesh.layout, task.problem.free
    unknowns = unknowns_of(task, points)
    rng = np.random.default_rng(1)
    samples = Samples(rng.uniform(0.0, 2.0 * np.pi, 300), 0.01 * rng.standard_normal(300), 1e-3)
    misfit = misfit_of(samples, np.asarray(points.mesh.phase)[layout.dwell == 0])
    quadratic = assemble_objective(unknowns, points, [{1: misfit}] + [{}] * (len(FEW) - 1), free.widths)
    program = assemble_program(task.problem, unknowns, points, task.excitation, quadratic)
    return Posed(task, points, program, start_vector(task, program, points, near), samples)


def _constraints(posed: Posed, w: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.array(posed.program.constraints(w)).ravel()


def test_the_periodic_motions_nearly_keep_the_constraints(posed: Posed) -> None:
    """They were solved by another rule and interpolated, so they miss, but by little of the typical sizes."""
    left = np.abs(_constraints(posed, posed.start))
    assert np.max(left) < 0.2
    assert np.mean(left) < 1e-3
    moved = posed.start.copy()
    moved[posed.program.unknowns.at_points[:, 0]] *= 1.1
    assert np.max(np.abs(_constraints(posed, moved))) > 1.0


def test_the_jacobian_is_that_of_the_constraints(posed: Posed) -> None:
    """Along directions of everything, of the parameters alone, and of the motions alone."""
    unknowns, rng = posed.program.unknowns, np.random.default_rng(4)
    jacobian = posed.program.jacobian(posed.start)
    for part in (slice(None), slice(0, unknowns.parameters), slice(unknowns.parameters, None)):
        along = np.zeros(unknowns.size)
        along[part] = rng.standard_normal(unknowns.size)[part]
        step = 1e-7 * along
        here = _constraints(posed, posed.start)
        ahead = (_constraints(posed, posed.start + step) - here) / 1e-7
        behind = (here - _constraints(posed, posed.start - step)) / 1e-7
        found = np.array(ca.mtimes(jacobian, along)).ravel()
        # The few others sit on a corner of a friction law within the difference.
        smooth = np.abs(ahead - behind) <= 1e-4 * (1.0 + np.abs(ahead))
        assert np.mean(smooth) > 0.99
        difference = 0.5 * (ahead + behind)
        assert np.all((np.abs(found - difference) <= 1e-5 * (1.0 + np.abs(difference)))[smooth])


def test_what_the_sensors_read_is_met_at_the_start(posed: Posed) -> None:
    unknowns = posed.program.unknowns
    rows = unknowns.points * unknowns.residual_scale.size
    left = _constraints(posed, posed.start)[:rows].reshape(unknowns.points, -1)
    assert np.max(np.abs(left[:, -2:])) < 1e-12


def test_the_objective_counts_samples_and_priors(posed: Posed) -> None:
    unknowns, quadratic = posed.program.unknowns, posed.program.quadratic
    rng = np.random.default_rng(8)
    w = rng.standard_normal(unknowns.size)
    w[unknowns.zeros] = 0.0
    w[unknowns.zeros[0, 1]] = zero = 0.3
    found = 0.5 * w @ (quadratic.curvature @ w) - quadratic.slope @ w + quadratic.rest
    here = posed.points.mesh.layout.dwell == 0
    deflection = unknowns.readings[1] * w[unknowns.at_points[here, -1]]
    weights: csr_array = interpolation(np.asarray(posed.points.mesh.phase)[here], posed.samples.phase)
    left = (posed.samples.values - weights @ deflection - unknowns.readings[1] * zero) / posed.samples.sd
    known = w[: unknowns.parameters] / posed.task.problem.free.widths
    assert found == pytest.approx(0.5 * (left @ left + known @ known), rel=1e-10)
    assert quadratic.samples == 300
