"""The shipped campaign: recorded on a rig that other code simulated, whose truth is known.

The fast tests fit few dwells of it (``tests/cli/test_identify.py``), and the plant of two masses.
"""

import numpy as np
import pytest

from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE
from savgs_ident.plants.quarter_car.plant import CHANNELS
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak

from .bench import FEW, TRUTH, Bench

pytestmark = pytest.mark.slow


def pulls(fit: Fit) -> dict[str, float]:
    """Distance of every estimate from the truth in its standard errors."""
    return {e.name: (e.value - TRUTH.get(e.name, e.prior)) / e.stderr for e in fit.estimates}


def test_it_converges_in_every_dwell_and_is_to_be_trusted(nominal: Fit) -> None:
    assert nominal.status.ok
    assert all(status.ok for status in nominal.dwell_status)
    assert len(nominal.dwell_status) == 28
    assert nominal.verdict.identifiable
    assert nominal.trusted


@pytest.mark.parametrize(
    ("name", "share"), [("mu_r", 0.01), ("c_sd", 0.01), ("mu_t", 0.03), ("ydot_Hth", 0.03)]
)
def test_the_free_parameters_are_found(nominal: Fit, name: str, share: float) -> None:
    found = nominal.by_name[name]
    assert found.free
    assert found.value == pytest.approx(TRUTH[name], rel=share)
    assert abs(found.value - TRUTH[name]) <= 4.0 * found.stderr
    assert found.stderr < share * TRUTH[name] * 1.2


def test_what_was_off_the_drawing_is_found_along(nominal: Fit) -> None:
    """Spring and tyre are softer than their sheets say by 1.0 and 0.8 of its standard deviations."""
    for name in ("k_sd", "k_t"):
        found = nominal.by_name[name]
        assert not found.free
        assert abs(found.value - TRUTH[name]) <= 3.0 * found.stderr
        assert found.stderr < 0.6 * found.prior_sd
    assert (
        abs(nominal.by_name["k_t"].prior - nominal.by_name["k_t"].value) > 5.0 * nominal.by_name["k_t"].stderr
    )


def test_tolerance_parameters_stay_where_they_truly_are(nominal: Fit) -> None:
    """All others are exactly as drawn: their estimates scatter about the drawing by no more than their errors."""
    pull = np.array([value for name, value in pulls(nominal).items() if name not in FREE])
    assert np.max(np.abs(pull)) < 4.0
    for estimate in nominal.estimates:
        assert estimate.free or estimate.stderr <= 1.001 * estimate.prior_sd


def test_the_residuals_are_noise(nominal: Fit, measured: HarmonicResponse) -> None:
    assert nominal.chi2 / nominal.dof <= 1.6
    assert nominal.chi2 / nominal.dof >= 0.8
    names = (each.name for each in CHANNELS)
    for place, (channel, limit) in enumerate(zip(names, (0.0025, 0.0010), strict=True)):
        wanted = measured.harmonics[:, measured.channel(channel), 1:10]
        miss = nominal.predicted[:, place, 1:10] - wanted
        assert np.sqrt(np.sum(np.abs(miss) ** 2) / np.sum(np.abs(wanted) ** 2)) <= limit


def test_the_identified_model_peaks_where_the_recordings_do(nominal: Fit, measured: HarmonicResponse) -> None:
    """Around the resonance of the sprung mass; at 6 Hz the response is larger again."""
    around = (measured.frequency > 1.5) & (measured.frequency < 3.3)
    place = measured.channel("sprung_accel")
    reach = measured.peak_to_peak[around, place]
    every = np.ones(10, bool)
    identified = peak_to_peak(nominal.predicted[around, 0], every)
    frictionless = peak_to_peak(nominal.frictionless[around, 0], every)
    frequency = measured.frequency[around]
    recorded = frequency[np.argmax(reach)]
    sd = measured.peak_to_peak_sd[around, place][np.argmax(reach)]
    assert np.max(reach) - reach[np.argmax(identified)] < 4.0 * sd
    assert abs(frequency[np.argmax(identified)] - recorded) <= 0.11
    assert abs(frequency[np.argmax(frictionless)] - 2.0) <= 0.11
    assert recorded > frequency[np.argmax(frictionless)] + 0.1


def test_the_record_is_whole(nominal: Fit, rig: Rig) -> None:
    assert nominal.free_names == FREE
    assert nominal.effects == MODELS["simtr"]
    assert nominal.orders == 9
    assert nominal.dof == 28 * 2 * 9 * 2 - 4
    assert 0.0 < nominal.prior_chi2 < 20.0
    for estimate in nominal.estimates:
        assert nominal.model.rig.parameters[estimate.name].value == estimate.value
    untouched = set(rig.parameters) - {estimate.name for estimate in nominal.estimates}
    assert all(nominal.model.rig.parameters[name].value == rig.parameters[name].value for name in untouched)
    assert np.sqrt(np.diag(nominal.covariance)) == pytest.approx([e.stderr for e in nominal.estimates])
    assert np.diag(nominal.correlation) == pytest.approx(1.0)
    assert np.all(np.linalg.eigvalsh(nominal.correlation) > 0.0)


def test_it_is_far_better_than_what_it_started_from(nominal: Fit, measured: HarmonicResponse) -> None:
    place = measured.channel("sprung_accel")
    wanted = measured.harmonics[:, place, 1:10]
    before, after, without = (
        np.sum(np.abs(response[:, 0, 1:10] - wanted) ** 2)
        for response in (nominal.as_given, nominal.predicted, nominal.frictionless)
    )
    covariance = measured.covariance[:, measured.channel("sprung_accel"), 1:10]
    noise = np.sum(np.trace(covariance, axis1=-2, axis2=-1))
    assert noise < after < 1.15 * noise
    assert 900.0 * noise < before < without


def test_fixed_tolerances_on_a_rig_that_is_as_drawn(bench: Bench, few: HarmonicResponse) -> None:
    """With spring and tyre as they truly are and all else exact, few dwells identify the four parameters."""
    problem = bench.task.problem
    assert problem.free.tolerated == ()
    found = bench.fit(np.asarray(problem.target.measured))
    assert found.status.ok
    assert len(few.tests) == len(FEW)
    assert found.cost / (problem.target.entries - 4) < 1.6
    values = {name: float(value) for name, value in problem.parameters(found.u).items()}
    for name, share in {"mu_r": 0.01, "c_sd": 0.01, "mu_t": 0.03, "ydot_Hth": 0.03}.items():
        assert values[name] == pytest.approx(TRUTH[name], rel=share)
