"""The tree of hypotheses adds up: laws to families, families to ports, ports to what acts there."""

from dataclasses import replace
from math import fsum

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.diagnosis.result import (
    NONE,
    UNKNOWN,
    Candidate,
    Diagnosis,
    Hypothesis,
    PortFamily,
    Verdict,
)
from savgs_ident.effects.base import Family
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.report.diagnosis.hypotheses import (
    Branch,
    NestedBar,
    actions_of,
    candidate_row,
    hypothesis_tree,
    named_hypotheses,
    nested_bars,
)
from savgs_ident.report.diagnosis.page import diagnosis_html

from .diagnosis_reading import ORIGIN, SHOWN
from .diagnosis_synthetic import candidate_of
from .page_reader import HOSTILE, Reader

LEARNED = tuple(
    Hypothesis(flexible=PortFamily(*kind))
    for kind in (
        ("rail", Family.FRICTION),
        ("rail", Family.DAMPING),
        ("strut", Family.FRICTION),
        ("sensor.sprung_accel", Family.DYNAMICS),
    )
)
RAIL_FRICTION = PortFamily("rail", Family.FRICTION)
SINGLES = tuple(Hypothesis((name,)) for name in CATALOGUE)
PAIRS = st.lists(st.sampled_from(sorted(CATALOGUE)), min_size=2, max_size=2, unique=True).map(
    lambda names: Hypothesis(tuple(names))
)


@st.composite
def candidates(draw: st.DrawFn) -> tuple[Candidate, ...]:
    """Hypotheses of all kinds, whose probabilities add up to 1."""
    several = st.lists(PAIRS, max_size=8, unique=True)
    some = st.lists(st.sampled_from((*SINGLES, *LEARNED)), max_size=12, unique=True)
    hypotheses = [NONE, UNKNOWN, *draw(some), *draw(several)]
    size = len(hypotheses)
    logs = draw(st.lists(st.floats(-15.0, 0.0), min_size=size, max_size=size))
    weights = [10.0**each for each in logs]
    whole = fsum(weights)
    return tuple(candidate_of(each, weight / whole) for each, weight in zip(hypotheses, weights, strict=True))


def with_candidates(diagnosis: Diagnosis, shares: dict[Hypothesis, float]) -> Diagnosis:
    return replace(diagnosis, candidates=tuple(candidate_of(each, share) for each, share in shares.items()))


def below(branches: tuple[Branch, ...], *names: str) -> Branch:
    """The branch that is reached by these names."""
    first, *others = names
    branch = next(each for each in branches if each.name == first)
    return below(branch.branches, *others) if others else branch


def every(bars: tuple[NestedBar, ...]) -> list[NestedBar]:
    return [each for bar in bars for each in (bar, *every(bar.parts))]


@given(found=candidates())
def test_branches_add_up_and_a_port_has_what_acts_there(
    diagnosis: Diagnosis, found: tuple[Candidate, ...]
) -> None:
    tree = hypothesis_tree(replace(diagnosis, candidates=found))
    for port in tree:
        there = fsum(each.probability for each in found if port.name in each.ports)
        assert port.probability == pytest.approx(there, rel=1e-12, abs=0.0)
        for branch in (port, *port.branches):
            if branch.branches:
                parts = fsum(each.probability for each in branch.branches)
                assert parts == pytest.approx(branch.probability, rel=1e-12)
            probabilities = [each.probability for each in branch.branches]
            assert probabilities == sorted(probabilities, reverse=True)
    assert {each.name for each in tree} == {"rail"} | {port for each in found for port in each.ports}


@given(found=candidates())
def test_bars_of_what_a_branch_consists_of_lie_within_its_bar_side_by_side(
    diagnosis: Diagnosis, found: tuple[Candidate, ...]
) -> None:
    bars = nested_bars(replace(diagnosis, candidates=found))
    for bar in every(bars):
        end = bar.start
        for part in bar.parts:
            assert part.start == pytest.approx(end, abs=0.01)
            end = part.start + part.length
        assert end <= bar.start + bar.length + 0.01
        # What has no bar is less than one per cent of the whole at each level.
        assert not bar.parts or end > bar.start + bar.length - 1.01
    assert [each.length for each in bars if each.code in ("none", "unknown")] == sorted(
        (round(100.0 * each.probability, 3) for each in found[:2]), reverse=True
    )


def test_a_pair_counts_at_both_ports_and_once_at_a_port_of_both(diagnosis: Diagnosis) -> None:
    shares = {
        Hypothesis(("rail_stribeck", "accel_lag")): 0.5,
        Hypothesis(("rail_stribeck", "rail_viscous")): 0.2,
        Hypothesis(("rail_stribeck",)): 0.1,
        Hypothesis(flexible=RAIL_FRICTION): 0.15,
        NONE: 0.04,
        UNKNOWN: 0.01,
    }
    found = with_candidates(diagnosis, shares)
    tree = hypothesis_tree(found)
    assert [each.name for each in tree] == ["rail", "sensor.sprung_accel"]
    assert below(tree, "rail").probability == pytest.approx(0.95)
    assert below(tree, "sensor.sprung_accel", "dynamics", "accel_lag").probability == 0.5
    assert below(tree, "rail", "friction", "rail_stribeck").probability == pytest.approx(0.6)
    assert below(tree, "rail", "friction", "").probability == 0.15
    both = below(tree, "rail", "damping + friction", "rail_stribeck + rail_viscous")
    assert both.probability == 0.2
    assert sum(each.length for each in nested_bars(found)) == pytest.approx(150.0)


def test_ports_without_a_chance_are_one_bar_but_not_one_that_is_named(diagnosis: Diagnosis) -> None:
    shares = {
        NONE: 0.9968,
        Hypothesis(("accel_lag",)): 0.0014,
        Hypothesis(("tyre_friction", "frame_mode")): 0.0008,
        Hypothesis(("frame_mode",)): 0.0001,
        Hypothesis(("deflection_gain",)): 0.0009,
        UNKNOWN: 0.0,
    }
    bars = nested_bars(with_candidates(diagnosis, shares))
    # The verdict names the rail, at which no hypothesis acts. The pair at two small ports counts once.
    assert [(each.words, each.probability) for each in bars] == [
        ("nothing missing", "99.7 %"),
        ("accelerometer", "0.1 %"),
        ("rail", "0.0 %"),
        ("what no family explains", "0.0 %"),
        ("3 other ports together", "0.2 %"),
    ]
    assert [each.named for each in bars] == [False, False, True, False, False]
    assert not any(each.parts for each in bars)


def test_small_laws_are_one_bar_where_they_matter_together(diagnosis: Diagnosis) -> None:
    small = {Hypothesis((name,)): 0.007 for name in ("rail_preload", "rail_asymmetry")}
    named = {Hypothesis(("rail_stribeck",)): 0.006}
    rail, *_ = nested_bars(with_candidates(diagnosis, {**small, **named}))
    (friction,) = rail.parts
    assert [(each.code or each.words, each.probability) for each in friction.parts] == [
        ("rail_stribeck", "0.6 %"),
        ("2 other laws together", "1.4 %"),
    ]
    assert [each.start for each in friction.parts] == [0.0, 0.6]
    (friction,) = nested_bars(with_candidates(diagnosis, named | dict(list(small.items())[:1])))[0].parts
    assert [each.code for each in friction.parts] == ["rail_stribeck"]


@pytest.mark.parametrize(
    ("verdict", "marked"),
    [
        (Verdict("none", (), (), (), ""), ["none"]),
        (Verdict("unknown", (), ("strut",), (), "", law_known=False), ["unknown", "strut"]),
        (Verdict("effect", ("rail_stribeck",), ("rail",), (), ""), ["rail", "friction", "rail_stribeck"]),
        (
            # The effect is the nearest one.
            Verdict(
                "effect", ("rail_stribeck",), ("rail",), (), "", families=(RAIL_FRICTION,), law_known=False
            ),
            ["rail", "friction", "learned law"],
        ),
    ],
    ids=["none", "unknown", "law", "learned"],
)
def test_what_the_verdict_names_is_marked_and_nothing_else(
    diagnosis: Diagnosis, verdict: Verdict, marked: list[str]
) -> None:
    shares = {
        Hypothesis(("rail_stribeck",)): 0.3,
        Hypothesis(flexible=RAIL_FRICTION): 0.2,
        NONE: 0.2,
        UNKNOWN: 0.2,
        Hypothesis(("mount_compliance",)): 0.1,
    }
    found = replace(with_candidates(diagnosis, shares), verdict=verdict)
    assert [each.code or each.words for each in every(nested_bars(found)) if each.named] == marked
    rows = [each.hypothesis for each in found.candidates if candidate_row(each, found).named]
    assert rows == [
        each for each in shares if each in named_hypotheses(verdict) and each not in (NONE, UNKNOWN)
    ]


def test_an_effect_that_the_catalogue_lacks_acts_where_its_hypothesis_does() -> None:
    own = Candidate(Hypothesis(("mine",)), 0.5, 0.0, 0.0, 0.0, (), True, ("rail", "link"), ("play",))
    assert [tuple(each) for each in actions_of(own, CATALOGUE)] == [
        ("rail", "play", "mine"), ("link", "play", "mine")
    ]  # fmt: skip
    assert actions_of(candidate_of(NONE, 1.0), CATALOGUE) == ()
    assert actions_of(candidate_of(UNKNOWN, 1.0), CATALOGUE) == ()


def test_the_page_says_every_bar_in_words_and_hostile_names_as_text(diagnosis: Diagnosis) -> None:
    own = Candidate(Hypothesis((HOSTILE,)), 0.25, 0.0, 0.0, 0.0, (), True, (HOSTILE,), (HOSTILE,))
    shares = {Hypothesis(("rail_stribeck",)): 0.5, Hypothesis(("damper_scale",)): 0.25}
    found = with_candidates(diagnosis, shares)
    found = replace(found, candidates=(*found.candidates, own))
    source = diagnosis_html(found, ORIGIN)
    tree = source[source.index('<ul role="list" class="tree"') : source.index("<h3>Each hypothesis")]
    page = Reader(tree)
    assert page.texts[: page.texts.index("what no family explains")] == [
        "rail", "50.0 %", "friction", "50.0 %", "rail_stribeck", "50.0 %",
        "strut", "25.0 %", "number of the sheet", "25.0 %", "damper_scale", "25.0 %",
        SHOWN, "25.0 %", SHOWN, "25.0 %", SHOWN, "25.0 %",
        "nothing missing", "none", "0.0 %",
    ]  # fmt: skip
    assert {tag for tag, _ in page.tags} == {"ul", "li", "div", "span", "code", "p"}
    lengths = [attributes["style"] for tag, attributes in page.tags if "style" in attributes]
    assert lengths == ["left: 0.0%; width: 50.0%"] * 3 + ["left: 0.0%; width: 25.0%"] * 6
    tracks = [attributes for _, attributes in page.tags if attributes.get("class") == "track"]
    assert len(tracks) == len(every(nested_bars(found)))
    assert {attributes["aria-hidden"] for attributes in tracks} == {"true"}
