"""A parameter that changes while a campaign goes on is reported, and nothing else is missing."""

import re

import pytest

from savgs_ident.diagnosis.diagnose import baseline_problem, diagnose_dwells
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.effect import generic_effects
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate.periodic import PeriodicSettings

from ..relaxed import as_users_have_it
from .fading_damper import ORDER, fading_campaign

OFFERED = ("guide_viscous", "tyre_stiffness")
NODES = PeriodicSettings(nodes=64, adaptations=0)


def _diagnosed(fading: float) -> Diagnosis:
    """The damper loses twice the share ``fading`` of its damping from the first test to the last."""
    response = fading_campaign(PARAMETERS["c"].value * (1.0 + fading * (1.0 - 2.0 * ORDER / 7.0)), ORDER)
    settings = DiagnosisSettings("two_mass", free=("k", "c"), orders=3, periodic=NODES)
    every = generic_effects(TwoMass.ports)
    with as_users_have_it():
        problem, data = baseline_problem(
            response, TwoMass(), PARAMETERS, {name: every[name] for name in OFFERED}, settings
        )
        return diagnose_dwells(problem, data, response, PlantModel(TwoMass(), PARAMETERS), settings, {})


@pytest.mark.slow
@pytest.mark.parametrize(("fading", "word"), [(0.25, "fell"), (-0.25, "rose")])
def test_a_damper_that_fades_by_more_than_is_tolerated(fading: float, word: str) -> None:
    found = _diagnosed(fading)
    assert found.verdict.kind == "none"
    assert set(found.drifts) == {"c"}
    assert found.drifts["c"] == pytest.approx(-2.0 * fading, rel=0.04)
    ((said, percent),) = re.findall(r"`c` (fell|rose) by ([0-9.]+) %", found.verdict.sentence)
    assert said == word
    assert float(percent) == pytest.approx(100.0 * abs(found.drifts["c"]), rel=0.02)
    by_chance = DEFAULTS.sure_of_gap * found.shrink.scatter
    assert found.shrink.recalibrated**2 - found.shrink.floor**2 < DEFAULTS.material_share**2 + by_chance


@pytest.mark.slow
def test_a_damper_that_stays_is_not_said_to_fade() -> None:
    found = _diagnosed(0.0)
    assert found.verdict.kind == "none"
    assert not found.drifts
    assert "While the campaign went on" not in found.verdict.sentence
