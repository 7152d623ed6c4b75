"""From the dwells up to 4 Hz alone the tyre's friction never saturates, and the fit says so."""

import re

import numpy as np
import pytest

from savgs_ident.fit.identifiability import LARGEST_SD
from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse

from .bench import TRUTH, only

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def slow_dwells(measured: HarmonicResponse, rig: Rig) -> Fit:
    """The paper's fit of the dwells up to 4 Hz."""
    response = only(measured, measured.frequency < 4.1)
    assert len(response.tests) == 24
    return fit_least_squares(response, RigModel(rig, MODELS["simtr"]), free=FREE)


def _number(fit: Fit, pattern: str) -> tuple[float, ...]:
    for sentence in fit.verdict.sentences:
        found = re.search(pattern, sentence)
        if found:
            return tuple(float(each) for each in found.groups())
    raise AssertionError(f"'{pattern}' is not in {fit.verdict.sentences}")


def test_it_converges_and_is_not_to_be_trusted(slow_dwells: Fit) -> None:
    assert slow_dwells.status.ok
    assert all(status.ok for status in slow_dwells.dwell_status)
    assert slow_dwells.chi2 / slow_dwells.dof < 1.6
    assert not slow_dwells.verdict.identifiable
    assert not slow_dwells.trusted


def test_it_names_what_cannot_be_distinguished(slow_dwells: Fit) -> None:
    assert slow_dwells.verdict.confounded == (("mu_t", "ydot_Hth"),)
    words = " ".join(slow_dwells.verdict.sentences)
    assert "mu_t and ydot_Hth cannot be distinguished" in words
    assert slow_dwells.by_name["mu_t"].stderr > LARGEST_SD * TRUTH["mu_t"]
    assert slow_dwells.by_name["ydot_Hth"].stderr > LARGEST_SD * TRUTH["ydot_Hth"]


def test_it_states_the_ratio_with_its_error(slow_dwells: Fit) -> None:
    ratio, percent = _number(slow_dwells, r"mu_t/ydot_Hth = (\S+) 1/\(m/s\), to (\S+) %")
    truth = TRUTH["mu_t"] / TRUTH["ydot_Hth"]
    assert percent < 3.0
    assert abs(ratio - truth) < 3.0 * percent / 100.0 * truth


def test_it_states_a_lower_bound(slow_dwells: Fit) -> None:
    """The scrub velocity reached at 4 Hz is the bound in principle; the truth must lie above what is said."""
    (bound,) = _number(slow_dwells, r"ydot_Hth is at least (\S+) m/s")
    assert 0.04 < bound < TRUTH["ydot_Hth"]


def test_it_proposes_a_faster_dwell(slow_dwells: Fit) -> None:
    hertz, percent = _number(slow_dwells, r"a faster dwell, (\S+) Hz \(to (\S+) %\)")
    assert hertz > 4.2
    assert percent < 100.0 * LARGEST_SD


def test_the_others_are_identified_as_well_as_from_all_dwells(slow_dwells: Fit, nominal: Fit) -> None:
    for name in ("mu_r", "c_sd"):
        found = slow_dwells.by_name[name]
        assert found.value == pytest.approx(TRUTH[name], rel=0.01)
        assert found.stderr < 1.1 * nominal.by_name[name].stderr
    assert np.isfinite(slow_dwells.chi2)
