"""The design as a whole, on the shipped rig: to be trusted, and only if all of its evidence holds."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.control.design import FACTORS, REGULARISATION, Design
from savgs_ident.control.digital import RATE
from savgs_ident.control.quarter_car_space import TwoMasses
from savgs_ident.control.robustness import Robustness
from savgs_ident.control.synthesis import PRECISION, Synthesis

from .conftest import FEW_RIGS


def test_the_shipped_design_is_to_be_trusted(design: Design, masses: TwoMasses) -> None:
    assert design.trusted
    assert design.synthesis.holds
    assert design.margins.stable
    assert design.digital_margins.stable
    assert design.masses[1:] == masses[1:]
    assert design.digital.rate == pytest.approx(RATE)


def test_it_is_stable_on_every_rig_that_the_tolerances_allow(design: Design) -> None:
    assert len(design.robustness.margins) == len(design.rigs.values) == FEW_RIGS
    assert design.robustness.stable
    assert np.isfinite(design.robustness.peaks).all()
    # No rig but the nominal one was designed for: some does worse.
    assert max(design.robustness.peaks) > design.synthesis.peak


def test_no_evidence_may_be_missing(design: Design) -> None:
    unstable = replace(design.margins, stable=False)
    passed = replace(design.synthesis, peak=1.01 * design.synthesis.gamma)
    shaken = Robustness((*design.robustness.margins[1:], unstable), design.robustness.peaks)
    assert not replace(design, synthesis=passed).trusted
    assert not replace(design, margins=unstable).trusted
    assert not replace(design, digital_margins=unstable).trusted
    assert not replace(design, robustness=shaken).trusted


def test_every_regularising_weight_was_tried_at_every_factor(design: Design, synthesis: Synthesis) -> None:
    tried = [(each.weight, each.factor) for each in design.regularisation]
    assert tried == [(weight, factor) for weight in REGULARISATION for factor in FACTORS]
    unchanged = [each for each in design.regularisation if each.factor == 1.0]
    assert [each.gamma_least for each in unchanged] == [synthesis.gamma_least] * len(REGULARISATION)
    assert [each.phase_deg for each in unchanged] == [design.margins.phase_deg] * len(REGULARISATION)


def test_more_noise_never_lowers_the_least_gamma(design: Design) -> None:
    for weight in REGULARISATION:
        least = np.array([each.gamma_least for each in design.regularisation if each.weight == weight])
        assert np.all(np.diff(least) >= -PRECISION * least[:-1])
