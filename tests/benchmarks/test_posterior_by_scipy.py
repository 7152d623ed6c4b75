"""emcee with a likelihood by scipy: it integrates what the package solves, and what is extrapolated is right."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.campaign import read_dwells, response_of
from benchmarks.motion import period_harmonics
from benchmarks.posterior_by_scipy import extrapolated
from benchmarks.posterior_problem import PosteriorProblem, pose_posterior
from benchmarks.scipy_likelihood import Dwell, ScipyDwells
from benchmarks.stretch_moves import Stretching, autocorrelation_time, stretch
from benchmarks.task import QUICK_HZ, TOLERANCE_PERCENT, errors_percent
from benchmarks.task import Task as Work
from savgs_ident.inference.problem import ProblemSettings, Task, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics


@pytest.fixture(scope="module")
def task(rig: Rig) -> Task:
    """Two dwells as they were recorded, tolerances free."""
    return plan_task(
        response_of(read_dwells((4.5, 6.0))), RigModel(rig, MODELS["simtr"]), FREE, ProblemSettings()
    )


def test_only_the_dwells_asked_for_are_kept() -> None:
    """What the noise is estimated from, the standstill, stays."""
    campaign = read_dwells(QUICK_HZ)
    assert [each.frequency_hz for each in campaign.of_kind("dwell")] == list(QUICK_HZ)
    assert len(campaign.of_kind("standstill")) == 1


@pytest.mark.slow
def test_scipy_integrates_the_recorded_dwell_that_the_package_solves(task: Task) -> None:
    """Somewhere in the posterior's neighbourhood, road and link as recorded, within what counts as the same."""
    problem, dwell = task.problem, 1
    u = problem.free.to_unconstrained(task.table.as_dict())
    u = u + 0.1 * jnp.asarray(np.random.default_rng(5).standard_normal(u.size))
    values = problem.parameters(u)
    states = ScipyDwells(problem, task.excitation).integration(np.asarray(u), dwell)()
    work = Work(
        problem.model,
        dict(values),
        np.asarray(task.excitation.frequency)[[dwell]],
        np.nan,
        np.nan,
        section_curves(values),
        np.zeros(0),
    )
    found = period_harmonics(work, states[None])
    solution = simulate_periodic(problem.model, values, task.excitation)
    solved = np.asarray(harmonics(problem.model, values, solution, problem.orders))[[dwell]]
    assert errors_percent(found, solved)[0] < TOLERANCE_PERCENT
    given = simulate_periodic(problem.model, problem.fixed, task.excitation)
    elsewhere = np.asarray(harmonics(problem.model, problem.fixed, given, problem.orders))[[dwell]]
    assert errors_percent(found, elsewhere)[0] > 10.0 * TOLERANCE_PERCENT


def test_road_and_link_move_as_their_harmonics_say() -> None:
    random, omega = np.random.default_rng(6), 7.0
    road, link = random.standard_normal((4, 2)), random.standard_normal((3, 2))
    dwell = Dwell(
        {}, SectionCurves(jnp.zeros((22, 1))), jnp.asarray(omega), jnp.asarray(road), jnp.asarray(link)
    )
    phase = jnp.asarray(1.3)
    inputs, rates = jax.jvp(dwell.inputs, (phase,), (jnp.asarray(omega),))
    for parts, value, speed, slope in (
        (road, inputs.road.height, inputs.road.velocity, rates.road.height),
        (link, inputs.link.angle, inputs.link.velocity, rates.link.angle),
    ):
        turn = np.exp(1j * np.arange(len(parts)) * 1.3)
        assert float(value) == pytest.approx(((parts[:, 0] + 1j * parts[:, 1]) * turn).real.sum())
        assert float(speed) == pytest.approx(float(slope))


def test_an_effective_draw_costs_as_many_evaluations_as_the_autocorrelation_time() -> None:
    outcome = extrapolated(Stretching(500.0, 30_000), 20.0, 300)
    assert outcome.figures["posterior_ess_per_s_scipy"] == pytest.approx(1.0 / (500.0 * 20.0))
    assert "EXTRAPOLATED" in outcome.notes[0]
    assert "rough" not in outcome.notes[1]


def test_a_run_that_was_too_short_is_called_so() -> None:
    outcome = extrapolated(Stretching(500.0, 20_000), 20.0, 300)
    assert "40 times" in outcome.notes[1]
    assert "rough" in outcome.notes[1]


@pytest.mark.parametrize("steps", [600, 6000])
def test_autocorrelation_time_of_a_known_process(steps: int) -> None:
    """x' = a x + noise has (1 + a) / (1 - a); the slower of two quantities counts, also in a short run."""
    random, walkers, kept = np.random.default_rng(7), 200, np.array([0.5, 0.98])
    values = np.empty((steps, walkers, 2))
    values[0] = random.standard_normal((walkers, 2))
    for step in range(1, steps):
        values[step] = kept * values[step - 1] + np.sqrt(1.0 - kept**2) * random.standard_normal((walkers, 2))
    assert autocorrelation_time(values) == pytest.approx(1.98 / 0.02, rel=0.1)


def test_walkers_that_do_not_move_have_forgotten_nothing() -> None:
    """Half of them stand still, half forget at once: a mean over all walkers is worth half of them alone."""
    random = np.random.default_rng(8)
    values = random.standard_normal((300, 100, 1))
    values[:, :50] = values[0, :50]
    assert autocorrelation_time(values) > 0.3 * 300


@pytest.fixture(scope="module")
def posed() -> PosteriorProblem:
    return pose_posterior((2.0, 4.5, 6.0), lambda line: None)


@pytest.mark.slow
def test_moves_go_on_an_affine_map_of_the_same_density(posed: PosteriorProblem) -> None:
    """The same density up to a constant, though the surrogate's own coordinates are sheared."""
    points = posed.draw(40, 1)
    straight, sheared = posed.straight, posed.surrogate
    v, t = straight.coordinates(points), sheared.coordinates(points)
    assert np.max(np.abs(v - t)) > 0.01
    np.testing.assert_allclose(straight.points(v), points, rtol=1e-9, atol=1e-9)
    theirs = np.array([float(straight(jnp.asarray(each))) for each in v])
    ours = np.array([float(sheared(jnp.asarray(each))) for each in t])
    np.testing.assert_allclose(theirs - theirs[0], ours - ours[0], atol=1e-6)


@pytest.mark.slow
def test_the_stretch_move_needs_hundreds_of_evaluations(posed: PosteriorProblem) -> None:
    """In forty dimensions one step of a walker is worth little; a short run says so too."""
    found = stretch(posed, 5000, lambda line: None)
    assert found.steps == 5000
    assert 100.0 < found.autocorrelation < 0.5 * found.steps
    assert not found.trusted
