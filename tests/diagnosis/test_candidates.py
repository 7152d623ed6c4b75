"""Hypotheses as a report shows them, and which formulas are tried beside a learned law."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis import laws_to_learn, model_selection
from savgs_ident.diagnosis.candidates import joint_sigma, not_judgeable_of
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.findings import Findings
from savgs_ident.diagnosis.result import Hypothesis, PortFamily
from savgs_ident.diagnosis.score_test import Score
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.base import Family, Port
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Linear
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.ports import CARCASS, PORTS, STRUT

TERM: Any = None
FOUND: Any = object()


def _score(sigma: float, *direction: float) -> Score:
    along = np.array(direction)
    return Score(TERM, sigma, 0.0, {}, 1.0, along / np.linalg.norm(along))


def test_what_two_effects_share_counts_once() -> None:
    """Against the length of the gap's projection on the plane of both."""
    gap = np.array([3.0, 4.0, 12.0])
    one, other = np.array([1.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    scores = [_score(float(gap @ each), *each) for each in (one, other)]
    assert joint_sigma(scores) == pytest.approx(5.0)


def test_effects_that_do_the_same_are_as_significant_as_one() -> None:
    assert joint_sigma([_score(7.0, 1.0, 2.0), _score(7.0, 1.0, 2.0)]) == pytest.approx(7.0)


@given(st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=6), st.floats(0.0, 30.0))
def test_opposite_effects_are_as_significant_as_one(along: list[float], sigma: float) -> None:
    assume(np.linalg.norm(along) > 1e-3)
    opposite = [_score(sigma, *along), _score(sigma, *(-each for each in along))]
    assert joint_sigma(opposite) == pytest.approx(sigma)


def test_one_alone_has_its_own_and_none_has_none() -> None:
    assert joint_sigma([_score(7.0, 1.0, 2.0)]) == pytest.approx(7.0)
    assert joint_sigma([]) == 0.0


@pytest.mark.parametrize(
    ("port", "family", "formulas"),
    [
        (CARCASS, Family.COMPLIANCE, {"tyre_lateral_compliance"}),
        (STRUT, Family.COMPLIANCE, {"mount_compliance", "damper_hysteresis"}),
        # At a port in series those of other families, too.
        (CARCASS, Family.STIFFNESS, {"tyre_lateral_compliance"}),
        (STRUT, Family.STOP, {"bump_stop"}),
    ],
)
def test_the_formulas_of_a_learned_law_are_those_of_its_family_at_its_location(
    port: Port, family: Family, formulas: set[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    absent: Any = None
    terms = [Term(name, each.port.location, ()) for name, each in CATALOGUE.items()]
    plant: Any = SimpleNamespace(catalogue=CATALOGUE, candidates=terms)
    problem = DiagnosisProblem(plant, absent, absent, absent, absent)
    member: Any = SimpleNamespace(
        hypothesis=Hypothesis(flexible=PortFamily(port.location, family)), law=SimpleNamespace(port=port)
    )
    wanted: set[str] = set()

    def fitted(search: Any, findings: Any, some: Sequence[Term], *rest: Any) -> Any:
        del search, rest
        wanted.update(each.name for each in some)
        return findings

    monkeypatch.setattr(model_selection, "singles_among", fitted)
    assert model_selection._with_formulas_of(problem, FOUND, [member], no_progress) is FOUND
    assert wanted == formulas
    wanted.clear()
    assert model_selection._with_formulas_of(problem, FOUND, [], no_progress) is FOUND
    assert not wanted


def _mode(evidence: float, *terms: str, left: float = 0.0) -> Any:
    return SimpleNamespace(terms=terms, evidence=evidence, left=left)


@pytest.mark.parametrize(
    ("best", "ports"),
    [
        (("gear_compliance", "link_offset"), ["link", "damper", "mount"]),
        (("gear_compliance",), None),
    ],
)
def test_laws_are_weighed_against_two_effects_wherever_one_formula_explains_all(
    best: tuple[str, ...], ports: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A strut's mount, which the catalogue may not have, does nearly what a damper's end or the gear does."""
    absent: Any = None
    plant: Any = SimpleNamespace(catalogue=CATALOGUE, plant=SimpleNamespace(ports=PORTS, scaled_ports=PORTS))
    search: Any = SimpleNamespace(given=None)
    problem = DiagnosisProblem(plant, absent, search, absent, absent)
    singles = (
        _mode(50.0, "gear_compliance"),
        _mode(45.0, "damper_hysteresis"),
        _mode(9.0, "cam_scale", left=0.5),
    )
    learned: list[list[str]] = []

    def learn(plant: Any, data: Any, base: Any, wanted: Any, *rest: Any) -> tuple[()]:
        del plant, data, base, rest
        learned.append([each.name for each in wanted])
        return ()

    monkeypatch.setattr(laws_to_learn, "learn", learn)
    monkeypatch.setattr(laws_to_learn, "left_over", lambda search, base, mode, constants: mode.left)
    findings = Findings(_mode(0.0), (), (_mode(60.0, *best), *singles))
    assert laws_to_learn.laws_instead_of_two(problem, findings, findings.modes[0], no_progress) == ()
    assert learned == ([] if ports is None else [ports])


@pytest.mark.parametrize(("smallest", "said"), [(0.4, None), (3.0, 3.0), (1e6, np.inf)])
def test_an_effect_that_no_campaign_shows_has_a_smallest_size_that_it_could_have(
    smallest: float, said: float | None
) -> None:
    """Of a typical size of 0.1, ten of which may be looked for."""
    amplitude = Linear("offset", "N m", 0.0, 0.1 * DEFAULTS.amplitude_width)
    score = replace(
        _score(1.0, 1.0, 0.0), term=Term("amplifier_offset", "drive", (amplitude,), ()), smallest=smallest
    )
    found = not_judgeable_of(SimpleNamespace(scores=(score,)))  # type: ignore[arg-type]
    assert [each.smallest for each in found] == ([] if said is None else [said])
