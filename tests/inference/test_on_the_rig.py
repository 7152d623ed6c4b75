"""The posterior's ingredients on the model itself, on a few dwells of the shipped campaign."""

from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.inference.expansion import Expansion, expand
from savgs_ident.inference.harmonic_question import Question, density_of, locate, plan
from savgs_ident.inference.posterior_mode import PosteriorDensity, PosteriorMode, find_mode
from savgs_ident.inference.samplers.chains import SamplingSettings
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.simulate.periodic import resolve
from savgs_ident.simulate.readings import harmonics

from ..fit.bench import only, silent, true_rig

pytestmark = pytest.mark.slow

DWELLS = (1.4, 2.35, 4.5, 6.0)


@pytest.fixture(scope="module")
def question(nominal_campaign: Path, rig: Rig) -> Question:
    measured = estimate_response(load_campaign(nominal_campaign), 9)
    kept = only(measured, np.isin(np.round(measured.frequency, 2), DWELLS))
    return Question(kept, RigModel(true_rig(rig), MODELS["simtr"]), {}, FREE)


@pytest.fixture(scope="module")
def posterior(question: Question) -> PosteriorDensity:
    return density_of(plan(question, SETTINGS))


@pytest.fixture(scope="module")
def mode(posterior: PosteriorDensity, question: Question) -> PosteriorMode:
    return locate(posterior, plan(question, SETTINGS), question, silent)


@pytest.fixture(scope="module")
def expansion(posterior: PosteriorDensity, mode: PosteriorMode) -> Expansion:
    return expand(posterior, mode.linearisation_point, silent)


SETTINGS = SamplingSettings(fixed_tolerances=True)


def test_the_mode_is_found_from_the_drawing(mode: PosteriorMode) -> None:
    assert mode.status.ok


def test_the_density_falls_away_from_the_mode_in_every_direction(
    posterior: PosteriorDensity, mode: PosteriorMode, expansion: Expansion
) -> None:
    middle = mode.linearisation_point.point[:-2]
    steps = np.asarray(expansion.surrogate.scale)[:-2, :-2].T
    around = np.concatenate([middle + 0.5 * steps, middle - 0.5 * steps])
    rows, solved = expansion.exact.rows(around)
    assert solved.all()
    points = np.concatenate([around, np.tile(mode.linearisation_point.point[-2:], (len(around), 1))], axis=1)
    assert all(
        posterior.density(row, point) < mode.linearisation_point.value
        for row, point in zip(rows, points, strict=True)
    )


def test_the_model_near_its_anchor_is_the_model(expansion: Expansion) -> None:
    """Predicted to first order and solved to a looser tolerance, against the solver of every fit."""
    problem, anchor = expansion.exact.problem, expansion.exact.anchor
    points = expansion.surrogate.points(np.random.default_rng(2).standard_normal((4, 6)))[:, :-2]
    found = expansion.exact.responses(points)
    assert found.solved.all()
    for u, response in zip(points, found.harmonics, strict=True):
        p = problem.parameters(jnp.asarray(u))
        expected = np.asarray(
            harmonics(problem.model, p, resolve(problem.model, p, anchor.solution), problem.orders)
        )
        first = np.abs(expected[..., 1:2])
        assert np.max(np.abs(response - expected) / first) < 1e-6


def test_slopes_are_those_of_finite_differences(mode: PosteriorMode, expansion: Expansion) -> None:
    """In standard deviations of the noise, over half a standard deviation to either side."""
    axes = np.asarray(expansion.surrogate.scale)[:-2, :-2].T
    ahead, _ = expansion.exact.rows(mode.linearisation_point.point[:-2] + 0.25 * axes)
    behind, _ = expansion.exact.rows(mode.linearisation_point.point[:-2] - 0.25 * axes)
    weight = 1.0 / np.sqrt(np.asarray(expansion.exact.likelihood.variance))
    slopes = (mode.linearisation_point.slopes @ axes.T).T
    np.testing.assert_allclose((ahead - behind) / 0.5 * weight, slopes * weight, atol=0.02)


def test_the_surrogate_is_of_second_order(expansion: Expansion) -> None:
    """What it leaves out is a small part of what a linear one leaves out, and of the noise."""
    ts = np.random.default_rng(3).standard_normal((8, 6))
    points = expansion.surrogate.points(ts)
    exact, _ = expansion.exact.rows(points[:, :-2])
    weight = 1.0 / np.sqrt(np.asarray(expansion.exact.likelihood.variance))
    stand_in = np.stack([np.asarray(expansion.surrogate.predicted(jnp.asarray(t))) for t in ts])
    assert np.linalg.norm((stand_in - exact) * weight, axis=1).max() < 0.3


@pytest.mark.parametrize("miss", [0.01, 0.03])
def test_a_model_that_misses_is_found_to_miss_by_as_much(
    posterior: PosteriorDensity, mode: PosteriorMode, question: Question, miss: float
) -> None:
    """The mode of the discrepancy, from 144 rows of which it moves most: its own error is about a tenth."""
    likelihood = posterior.likelihood
    errors = np.random.default_rng(4).standard_normal(mode.linearisation_point.rows.size) * np.asarray(
        likelihood.discrepancy_scale
    )
    off = eqx.tree_at(
        lambda each: each.measured, likelihood, likelihood.measured + jnp.asarray(miss * errors)
    )
    u = jnp.asarray(mode.linearisation_point.point[:-2])
    found = find_mode(posterior._replace(likelihood=off), u, mode.linearisation_point.warm_start, silent)
    assert found.status.ok
    assert float(likelihood.scales.miss(jnp.asarray(found.linearisation_point.point))) == pytest.approx(
        miss, rel=0.3
    )
