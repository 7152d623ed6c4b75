"""The cross-check: on recordings of our own with known parameters, and on the shipped ones beside the fit."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.status import Status
from savgs_ident.fit.collocation.crosscheck import CollocationFit, CollocationSettings, fit_by_collocation
from savgs_ident.fit.minimise import Minimiser
from savgs_ident.inference.laplace import spread_of
from savgs_ident.inference.prior import sheet_coordinate
from savgs_ident.inference.problem import ProblemSettings, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic

from .bench import TRUTH, only, silent
from .synthetic import NOISE, synthetic_campaign

pytestmark = pytest.mark.slow

THERE = {"mu_r": 0.034, "mu_t": 0.28, "ydot_Hth": 0.045, "c_sd": 5300.0}
"""What the synthetic rig has; the cross-check starts from 0.03, 0.25, 0.05 and 5792 [SI]."""

DWELLS = (2.0, 4.5, 6.0)
"""Slow enough to stick and fast enough to saturate the tyre's friction [Hz]."""

PRESLIDING = {"k_pre": 1e7, "c_pre": 3e4}
"""The bristle, as it truly is [SI]. The samples identify it two to three times as well as nine orders do, which see
little of the milliseconds of a reversal: there the two are not comparable in standard errors of the latter."""

EXACT = CollocationSettings(fixed_tolerances=True)


@pytest.fixture(scope="module")
def campaign(rig: Rig) -> Campaign:
    """Three dwells of a rig whose free parameters are known."""
    return synthetic_campaign(rig, MODELS["simtr"], THERE, DWELLS, seed=11)


@pytest.fixture(scope="module")
def response(campaign: Campaign) -> HarmonicResponse:
    """Their response."""
    return estimate_response(campaign, 9)


@pytest.fixture(scope="module")
def found(campaign: Campaign, response: HarmonicResponse, rig: Rig) -> CollocationFit:
    """Their cross-check, all but the free parameters known."""
    return fit_by_collocation(campaign, response, RigModel(rig, MODELS["simtr"]), free=FREE, settings=EXACT)


def test_it_finds_what_the_recordings_were_made_with(found: CollocationFit) -> None:
    assert found.status is Status.CONVERGED
    assert [estimate.name for estimate in found.estimates] == list(FREE)
    for name, value in THERE.items():
        estimate = found.by_name[name]
        assert abs(estimate.value - value) < 3.0 * estimate.stderr
        assert estimate.stderr < 0.03 * value


def test_what_is_left_is_the_noise(found: CollocationFit, response: HarmonicResponse, rig: Rig) -> None:
    samples = found.dof + len(FREE) + 2 * len(DWELLS)
    assert found.tests == response.tests
    assert found.chi2 / found.dof == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / samples) + 0.005)
    table = RigModel(rig, MODELS["simtr"]).table
    priors = [sheet_coordinate(table[name]).at(found.by_name[name].value) for name in FREE]
    assert found.prior_chi2 == pytest.approx(np.sum(np.square(priors)), rel=1e-6)
    for name, sd in NOISE.items():
        assert response.noise_sd[:, response.channel(name)] == pytest.approx(sd, rel=0.05)


def test_the_covariance_belongs_to_the_estimates(found: CollocationFit) -> None:
    sd = np.sqrt(np.diag(found.covariance))
    assert sd == pytest.approx([estimate.stderr for estimate in found.estimates])
    assert np.all(np.linalg.eigvalsh(found.covariance / np.outer(sd, sd)) > 0.0)
    assert not found.covariance.flags.writeable


def test_it_says_that_it_did_not_get_there(campaign: Campaign, response: HarmonicResponse, rig: Rig) -> None:
    """After two iterations: no error is stated for what was not found."""
    reported: list[str] = []
    found = fit_by_collocation(
        campaign,
        response,
        RigModel(rig, MODELS["simtr"]),
        free=FREE,
        settings=replace(EXACT, iterations=2),
        progress=reported.append,
    )
    assert found.status is Status.MAX_ITERATIONS
    assert found.iterations == 2
    assert all(np.isnan(estimate.stderr) for estimate in found.estimates)
    assert Status.MAX_ITERATIONS.advice in reported[-1]


def test_a_response_of_other_recordings_is_refused(
    campaign: Campaign, response: HarmonicResponse, rig: Rig
) -> None:
    first_only = replace(campaign, recordings=campaign.recordings[:1])
    with pytest.raises(InputError, match=r"dwell_4\.5Hz.*was not recorded"):
        fit_by_collocation(first_only, response, RigModel(rig, MODELS["simtr"]), free=FREE)


def test_clocks_that_drift_apart_are_refused(
    campaign: Campaign, response: HarmonicResponse, rig: Rig
) -> None:
    drifting = DataWarning("clock_rate_differs", "runs slow", channel="sprung_accel")
    with pytest.raises(InputError, match=r"sprung_accel.*different rates"):
        fit_by_collocation(
            campaign, replace(response, warnings=(drifting,)), RigModel(rig, MODELS["simtr"]), free=FREE
        )


def test_a_parameter_that_does_nothing_is_refused(
    campaign: Campaign, response: HarmonicResponse, rig: Rig
) -> None:
    with pytest.raises(InputError, match="does not depend on 'mu_r'"):
        fit_by_collocation(campaign, response, RigModel(rig, ()), free=("mu_r",))


@pytest.fixture(scope="module")
def crosschecked(few: HarmonicResponse, nominal_campaign: Path, rig: Rig) -> CollocationFit:
    """A few dwells of the shipped campaign, tolerances estimated along."""
    campaign = load_campaign(nominal_campaign)
    return fit_by_collocation(campaign, few, RigModel(rig, MODELS["simtr"]), free=FREE)


@pytest.fixture(scope="module")
def fitted(few: HarmonicResponse, rig: Rig) -> Mapping[str, tuple[float, float]]:
    """Least squares on the harmonics of the same dwells, with noise alone: value and standard error by name."""
    task = plan_task(few, RigModel(rig, MODELS["simtr"]), FREE, ProblemSettings())
    problem = task.problem
    first = simulate_periodic(problem.model, problem.fixed, task.excitation)
    u = problem.free.to_unconstrained(task.table.as_dict())
    best = Minimiser(problem).minimise(u, first, 40, silent)
    assert best.status.ok
    sd = spread_of(best.jacobian).sd * np.abs(np.asarray(problem.slopes(best.u)))
    values = problem.parameters(best.u)
    return {
        name: (float(values[name]), float(each)) for name, each in zip(problem.free.names, sd, strict=True)
    }


def test_on_the_shipped_campaign_it_agrees_with_least_squares(
    fitted: Mapping[str, tuple[float, float]], few: HarmonicResponse, crosschecked: CollocationFit
) -> None:
    """To half a standard error: the samples say a little more than nine orders do."""
    assert crosschecked.status.ok
    assert crosschecked.tests == few.tests
    for name in FREE:
        (value, stderr), by_samples = fitted[name], crosschecked.by_name[name]
        assert abs(by_samples.value - value) < 0.5 * stderr
        assert 0.85 < by_samples.stderr / stderr <= 1.01
    for name in set(fitted) - set(PRESLIDING):
        value, stderr = fitted[name]
        assert abs(crosschecked.by_name[name].value - value) < 1.5 * stderr


def test_on_the_shipped_campaign_it_finds_the_truth(crosschecked: CollocationFit) -> None:
    assert crosschecked.chi2 / crosschecked.dof == pytest.approx(1.0, abs=0.01)
    for name, value in {**TRUTH, **PRESLIDING}.items():
        estimate = crosschecked.by_name[name]
        assert abs(estimate.value - value) < 3.0 * estimate.stderr


def test_the_frictionless_rig_too(measured: HarmonicResponse, nominal_campaign: Path, rig: Rig) -> None:
    """It has no internal states; it does not explain the recordings, which shows in chi2."""
    campaign = load_campaign(nominal_campaign)
    one = only(measured, np.isin(np.round(measured.frequency, 2), (6.0,)))
    found = fit_by_collocation(campaign, one, RigModel(rig, ()), free=("c_sd",), settings=EXACT)
    assert found.status.ok
    assert found.chi2 / found.dof > 2.0
