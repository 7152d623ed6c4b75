"""The same campaign from other files: the same samples, and the same tests with other clocks and noise."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.fit.result import Fit
from savgs_ident.fit.small_errors import SETTLED
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse

from .bench import TRUTH


@pytest.mark.slow
def test_the_same_samples_in_json_give_the_same_fit(
    nominal: Fit, measured: HarmonicResponse, shared_rig: Path, rig: Rig
) -> None:
    campaign = load_campaign(shared_rig / "nominal" / "campaign_json.mcap")
    response = estimate_response(campaign, 9)
    sd = np.sqrt(np.trace(measured.covariance, axis1=-2, axis2=-1))
    assert np.max(np.abs(response.harmonics - measured.harmonics)[measured.valid] / sd[measured.valid]) < 1e-4
    # This file says when its tests began, over which parameters may drift; the other says their order alone.
    undated = replace(response, recorded=measured.recorded)
    fit = fit_least_squares(undated, RigModel(rig, MODELS["simtr"]), free=FREE)
    for estimate in nominal.estimates:
        other = fit.by_name[estimate.name]
        # Where a search ends is known to what its last step promised.
        assert abs(other.value - estimate.value) < np.sqrt(2.0 * SETTLED) * estimate.stderr
        assert other.stderr == pytest.approx(estimate.stderr, rel=1e-3)
    assert fit.chi2 == pytest.approx(nominal.chi2, rel=1e-4)


@pytest.mark.slow
def test_other_clocks_rates_and_noise_give_the_same_parameters_within_their_errors(
    nominal: Fit, shared_rig: Path, rig: Rig
) -> None:
    response = estimate_response(load_campaign(shared_rig / "nominal" / "campaign_ros2.mcap"), 9)
    fit = fit_least_squares(response, RigModel(rig, MODELS["simtr"]), free=FREE)
    assert fit.trusted
    assert fit.chi2 / fit.dof < 1.6
    for name, share in {"mu_r": 0.01, "c_sd": 0.01, "mu_t": 0.03, "ydot_Hth": 0.03}.items():
        here, there = fit.by_name[name], nominal.by_name[name]
        assert here.value == pytest.approx(TRUTH[name], rel=share)
        assert abs(here.value - TRUTH[name]) <= 4.0 * here.stderr
        assert abs(here.value - there.value) <= 4.0 * np.hypot(here.stderr, there.stderr)
