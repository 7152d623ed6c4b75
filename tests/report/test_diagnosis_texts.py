"""Terminal and page of a diagnosis say its numbers, the verdict first, and hostile names as text."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.core.files import to_json
from savgs_ident.core.presentation import Origin, no_progress
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Diagnosis, Estimate, NotJudgeable
from savgs_ident.report.diagnosis.page import diagnosis_html, parameter_table
from savgs_ident.report.diagnosis.text import (
    closed_words,
    estimate_words,
    gain_words,
    gap_percentage,
    probability_words,
    shown_candidates,
    smallest_words,
)
from savgs_ident.report.present_campaign import DIAGNOSIS
from savgs_ident.report.text import DASH

from .diagnosis_reading import ORIGIN, SHOWN, record_of, rendered
from .diagnosis_synthetic import (
    KINDS,
    NO_REGIMES,
    NO_SHRINK,
    SENTENCES,
    hostile,
    unconverged,
)
from .page_reader import HOSTILE, Reader

pytestmark = pytest.mark.usefixtures("undrawn")

SECTIONS = ["where", "response", "loops", "which", "shrink", "map", "next", "limits", "origin"]


@pytest.fixture(scope="module")
def source(diagnosis: Diagnosis) -> str:
    return diagnosis_html(diagnosis, ORIGIN)


@pytest.fixture(scope="module")
def page(source: str) -> Reader:
    return Reader(source)


def test_the_terminal_says_the_verdict_first_in_80_columns(by_kind: dict[str, Diagnosis]) -> None:
    for kind in KINDS:
        text = rendered(by_kind[kind], width=80)
        joined = " ".join(text.split())
        assert joined.startswith(SENTENCES[kind])
        assert "nan" not in joined
        assert "\\u" not in joined
        assert (
            text.index("Gap by model")
            < text.index("Hypotheses")
            < text.index("Next tests")
            < text.index("Effects that this campaign cannot detect")
        )


def test_the_terminal_says_the_numbers(diagnosis: Diagnosis) -> None:
    text = rendered(diagnosis)
    # 1 - (8.71^2 - 0.21^2) / (17.32^2 - 0.21^2) and 1 - (0.47^2 - 0.21^2) / (8.71^2 - 0.21^2).
    assert re.search(r"together +17\.3 % +8\.71 % +0\.47 % +0\.21 % +74\.7 % +99\.8 %", text)
    assert re.search(rf"sweep, first harmonic +18\.8 % +9\.42 % +1\.32 % +0\.21 % +{DASH} +{DASH}", text)
    # The share that counts both together is in the record alone.
    assert "95 %)" not in text
    assert re.search(r"rail_stribeck +98\.2 % +61\.2 +\+3\.41 +99\.9 %", text)
    assert "- stribeck_velocity: 0.1012 (0.0957 to 0.1066) m/s" in text
    assert "This campaign cannot distinguish it from: rail_preload." in text
    assert "rail 94 %, wishbone joints 41 %, strut 30 %" in " ".join(text.split())
    assert (
        "concentrated: low speed or large stroke (9.2 % of the response, p = 0.012); drift over time (1.3 % of the"
        " response, p = 0.041)." in " ".join(text.split())
    )
    assert "slow tests" not in text
    assert "concentrated" not in rendered(replace(diagnosis, regimes=NO_REGIMES))
    assert "unless its bump_stop_stiffness is at least 32 000 N/m" in text
    assert f"Hypotheses (5 of {len(diagnosis.candidates)})" in text


def test_none_and_unknown_are_reported_however_unlikely_and_so_is_all_that_has_a_chance(
    diagnosis: Diagnosis,
) -> None:
    ordered = sorted(diagnosis.candidates, key=lambda each: bool(each.effects))
    last = replace(ordered[-1], probability=0.002)
    shuffled = (*(each for each in ordered if each.effects), ordered[0], ordered[1], last)
    shown, rest = shown_candidates(replace(diagnosis, candidates=shuffled))
    assert {NONE, UNKNOWN, last.hypothesis} <= {each.hypothesis for each in shown}
    assert len(shown) + len(rest) == len(shuffled)
    assert all(each.probability < 0.001 for each in rest)


def test_the_page_has_its_sections_in_order_and_the_verdict_on_top(
    page: Reader, diagnosis: Diagnosis
) -> None:
    assert [attributes["id"] for tag, attributes in page.tags if tag == "section"] == SECTIONS
    assert not any(tag in ("script", "iframe", "object") for tag, _ in page.tags)
    assert diagnosis.verdict.sentence in page.texts[:4]
    for _, attributes in page.tags:
        for name in ("src", "href", "action", "data"):
            assert (attributes.get(name) or "#").startswith(("data:", "#")), "the page fetches something"


def test_the_page_says_numbers_and_origin(page: Reader) -> None:
    text = " ".join(page.texts)
    for part in (
        "98.2 %",
        "17.3 %",
        "74.7 % 99.8 %",
        "0.1012 (0.0957 to 0.1066) m/s",
        "Friction is highest where the body turns round: slow tests stick more than fast ones.",
        "Armstrong-Helouvry",
        "dwell at 0.35 Hz, plate at half its stroke",
        "rail_stribeck from rail_preload",
        "bump_stop_stiffness",
        "The dwell at 6 Hz was left out: the wheel lifts off.",
        "71 %",
        "Speed, stroke and direction are those of the rail",
        "runs/a<b>.csv",
        "ab" * 32,
        "m & m.toml",
        "savgs-ident diagnose a & b.csv",
        "[odd]",
    ):
        assert part in text
    assert "Not converged" not in text
    assert "nan" not in re.sub(r"[a-z]*nan[a-z]+|[a-z]+nan", "", text)


def test_the_page_says_what_there_is_and_what_there_is_not(by_kind: dict[str, Diagnosis]) -> None:
    for kind in ("none", "several"):
        page = Reader(diagnosis_html(by_kind[kind], ORIGIN))
        text = " ".join(page.texts)
        assert SENTENCES[kind] in text
        assert len(page.pictures) == (7 if kind == "none" else 11)
        assert ("No signal was inferred: nothing is missing." in text) is (kind == "none")
        assert ("Sources of the named laws" in text) is (kind == "several")
        assert ("Dashed: the named law in the model" in text) is (kind == "several")


def test_the_formula_that_comes_nearest_to_a_learned_law_is_explained_where_it_is_drawn(
    diagnosis: Diagnosis, page: Reader
) -> None:
    loops = tuple(
        replace(each, law_sd=0.1 * np.abs(each.law), nearest=0.5 * each.law) for each in diagnosis.loops
    )
    learned = Reader(diagnosis_html(replace(diagnosis, loops=loops), ORIGIN))
    for shown, drawn in ((page, False), (learned, True)):
        text = " ".join(shown.texts)
        assert ("Dotted: the formula of the catalogue that comes nearest" in text) is drawn


def test_a_diagnosis_that_did_not_converge_says_so_first_and_hostile_names_stay_text(
    diagnosis: Diagnosis,
) -> None:
    attacked = unconverged(hostile(diagnosis, HOSTILE))
    origin = Origin(("savgs-ident", HOSTILE), HOSTILE, HOSTILE, HOSTILE, {HOSTILE: HOSTILE})
    source = diagnosis_html(attacked, origin)
    page = Reader(source)
    warning = "Not converged: this verdict must not be used."
    assert page.texts[0] == warning
    assert "<title>Not converged: " in source
    assert record_of(attacked)["converged"] is False
    assert not any(tag == "script" for tag, _ in page.tags)
    # Data, sentence, baseline, warning, port, candidate, parameter, cycle, channel, next test, pair, limit, origin.
    assert sum(SHOWN in text for text in page.texts) >= 20
    assert any(SHOWN in (attributes["alt"] or "") for attributes in page.pictures)
    reported = rendered(attacked, width=300)
    assert reported.splitlines()[0] == warning
    assert "[bold red]\\x1b[2J" in reported
    assert "\x1b" not in reported


def test_a_diagnosis_with_nothing_beside_its_verdict_has_a_page(diagnosis: Diagnosis) -> None:
    bare = replace(
        diagnosis, ports=(), map=(), cycle=(), loops=(), by_channel={}, further=None, next_tests=(),
        not_judgeable=(), confusable=(), warnings=(), candidates=diagnosis.candidates[:1], regimes=(),
        parameters=diagnosis.given.table.as_dict(), identified=diagnosis.given.table.as_dict(),
    )  # fmt: skip
    page = Reader(diagnosis_html(bare, replace(ORIGIN, warnings=())))
    text = " ".join(page.texts)
    for part in (
        "No port was examined.",
        "No harmonic was compared.",
        "Every effect of the catalogue would have been",
    ):
        assert part in text
    assert "Parameters that changed" not in text
    assert len(page.pictures) == 4
    assert rendered(bare).startswith(SENTENCES["effect"])
    assert record_of(bare)["where"]["map"] == []


def test_parameters_that_moved_are_reported_in_tolerances(diagnosis: Diagnosis) -> None:
    rows = {row.name: row for row in parameter_table(diagnosis)}
    assert set(rows) == {"c_sd", "k_t", "mu_r", "stribeck_rise", "stribeck_velocity"}
    # (264100 - 275000) / 13750 = -0.79.
    assert rows["k_t"].moved == "\u22120.8"
    assert rows["mu_r"].recalibrated == "0.03620"
    assert rows["mu_r"].identified == "0.03000"
    assert rows["stribeck_velocity"].given == "\u2013"
    assert rows["stribeck_velocity"].unit == "m/s"


def test_numbers_are_reported_to_the_digits_that_they_justify() -> None:
    assert probability_words(1e-9) == "< 0.1 %"
    assert probability_words(0.0) == "0.0 %"
    assert probability_words(1.0) == "100.0 %"
    assert probability_words(0.99999) == "> 99.9 %"
    assert gap_percentage(0.0021) == "0.21 %"
    assert gap_percentage(0.1732) == "17.3 %"
    assert gain_words(3.413) == "+3.41"
    assert gain_words(41.3) == "+41.3"
    assert gain_words(float("nan")) == "\u2013"
    # Calibration closed 1 - (2.2^2 - 2.1^2) / (3.5^2 - 2.1^2), and nothing was added.
    assert closed_words(NO_SHRINK) == ("94.5 %", "0.0 %")
    assert closed_words(replace(NO_SHRINK, before=0.002, recalibrated=0.002)) == (DASH, DASH)
    assert estimate_words(Estimate("tau", 0.01503, 0.0147, 0.0153, "s")) == "0.01503 (0.01470 to 0.01530) s"
    assert smallest_words(NotJudgeable("a", "b", 0.25, "1")) == "0.250"
    assert smallest_words(NotJudgeable("a", "b", float("inf"), "m")) == "whatever its size"


def test_both_files_are_written_and_the_same_diagnosis_gives_the_same_page(
    diagnosis: Diagnosis, tmp_path: Path
) -> None:
    shown = replace(diagnosis, origin=ORIGIN)
    files = tuple(DIAGNOSIS.write(shown, tmp_path, no_progress))
    assert [file.name for file in files] == ["diagnosis.json", "diagnosis.html"]
    assert files[0].read_text() == to_json(DIAGNOSIS.record(shown))
    assert files[1].read_text(encoding="utf-8") == DIAGNOSIS.page(shown)


def test_the_text_shows_the_warnings_about_the_data(diagnosis: Diagnosis) -> None:
    assert "Warnings about the data" not in rendered(replace(diagnosis, origin=Origin()))
    text = rendered(replace(diagnosis, origin=ORIGIN))
    assert text.index("Warnings about the data") < text.index("[odd] test 'dwell_2': something")
