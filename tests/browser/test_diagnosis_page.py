"""The diagnosis report in a real browser: on a phone, on a desk, on paper, and under attack."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from savgs_ident.core.presentation import Origin
from savgs_ident.report.diagnosis.page import diagnosis_html

from ..report.diagnosis_synthetic import hostile, synthetic_diagnosis, unconverged
from ..report.posterior_synthetic import nominal_response
from .conftest import HOSTILE, SHOWN, Browser
from .test_posterior_page import OPEN_ALL, OVERFLOWING, SIZES, SMALLEST_PICTURE_TEXT, SMALLEST_TEXT

pytestmark = pytest.mark.slow

PICTURES = 11
PAGES = ["found", "nothing", "attacked"]


def _written(folder: Path, name: str, html: str) -> Path:
    path = folder / f"{name}.html"
    path.write_text(html, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def pages(nominal_campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Reports: an effect was found; nothing is missing; not converged, with an attack in every name."""
    measured = nominal_response(nominal_campaign)
    command = ("savgs-ident", "diagnose", "campaign.csv.gz")
    origin = Origin(command, "campaign.csv.gz", "ab" * 32, "gt_rear.toml", {"savgs-ident": "0.1.0"})
    bad = Origin(("savgs-ident", HOSTILE), HOSTILE, HOSTILE, HOSTILE, {HOSTILE: HOSTILE})
    found = synthetic_diagnosis(measured)
    folder = tmp_path_factory.mktemp("diagnoses")
    return {
        "found": _written(folder, "found", diagnosis_html(found, origin)),
        "nothing": _written(folder, "nothing", diagnosis_html(synthetic_diagnosis(measured, "none"), origin)),
        "attacked": _written(folder, "attacked", diagnosis_html(unconverged(hostile(found, HOSTILE)), bad)),
    }


@pytest.mark.parametrize("name", PAGES)
def test_a_page_requests_nothing_and_logs_no_error(
    browser: Browser, pages: dict[str, Path], name: str
) -> None:
    browser.open(pages[name])
    console, asked = browser.heard()
    assert console == []
    assert asked == [pages[name].as_uri()]


def test_every_picture_is_there_and_described(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["found"])
    pictures = browser.ask("return [...document.images].map(i => [i.complete, i.naturalWidth, i.alt.length])")
    assert len(pictures) == PICTURES
    for complete, width, described in pictures:
        assert complete
        assert width > 300
        assert described > 30
    unnamed = "return [...document.querySelectorAll('svg')].filter(s => !s.getAttribute('aria-label')).length"
    assert browser.ask(unnamed) == 0


def test_hostile_text_is_text(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["attacked"])
    browser.ask(OPEN_ALL)
    foreign = (
        "return document.querySelectorAll('script, b, iframe, object, embed, link:not([rel=icon])').length"
    )
    assert browser.ask(foreign) == 0
    armed = "return [...document.querySelectorAll('*')].filter(e => [...e.attributes].some(a => /^on/i.test(a.name)))"
    assert browser.ask(armed) == []
    outside = "return [...document.images].filter(i => !i.src.startsWith('data:image/svg+xml')).length"
    assert browser.ask(outside) == 0
    text = browser.ask("return document.body.innerText")
    assert text.count(SHOWN) >= 20
    assert SHOWN in browser.ask("return document.title")
    assert SHOWN in browser.ask("return [...document.images].map(i => i.alt).join()")


def test_the_first_thing_to_read_is_that_it_did_not_converge(
    browser: Browser, pages: dict[str, Path]
) -> None:
    browser.open(pages["attacked"], 400)
    lines = browser.ask("return document.body.innerText").splitlines()
    assert lines[0].startswith("Not converged")
    assert browser.ask("return document.querySelector('.alarm').getBoundingClientRect().top") < 100.0


@pytest.mark.parametrize("width", [320, 400, 768, 1100, 1400])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_wider_than_the_window(
    browser: Browser, pages: dict[str, Path], name: str, width: int
) -> None:
    browser.open(pages[name], width)
    browser.ask(OPEN_ALL)
    assert browser.ask("return innerWidth") == width
    page = "document.documentElement"
    assert browser.ask(f"return {page}.scrollWidth - {page}.clientWidth") == 0
    assert browser.ask(OVERFLOWING) == []


@pytest.mark.parametrize("width", [400, 1100])
def test_all_text_is_large_enough_to_read(browser: Browser, pages: dict[str, Path], width: int) -> None:
    browser.open(pages["found"], width)
    browser.ask(OPEN_ALL)
    sizes = browser.ask(SIZES)
    assert len(sizes) > 200
    assert [entry for entry in sizes if entry[0] < SMALLEST_TEXT] == []
    scales = browser.ask(
        "return [...document.images].map(i => i.getBoundingClientRect().width / i.naturalWidth)"
    )
    # The smallest numbers in these pictures have 8.5 points.
    assert min(scales) * 8.5 * 96.0 / 72.0 >= SMALLEST_PICTURE_TEXT
    assert max(scales) < 1.25


def test_tables_fit_beside_their_headings_on_a_desk(browser: Browser, pages: dict[str, Path]) -> None:
    browser.open(pages["found"], 1100)
    browser.ask(OPEN_ALL)
    scrolling = (
        "return [...document.querySelectorAll('.box')].filter(b => b.scrollWidth > b.clientWidth).length"
    )
    assert browser.ask(scrolling) == 0


def test_the_named_port_and_effect_are_marked_by_colour_and_picture(
    browser: Browser, pages: dict[str, Path]
) -> None:
    browser.open(pages["found"])
    named = "return [...document.querySelectorAll('tr.named th')].map(t => t.innerText.split(/\\s/)[0])"
    assert browser.ask(named) == ["rail", "rail_stribeck"]
    assert browser.ask("return document.images[0].alt").startswith(
        "The plant with its ports. Named port: rail."
    )
    browser.open(pages["nothing"])
    assert browser.ask(named) == []


def test_the_page_has_a_language_a_title_and_headings_in_order(
    browser: Browser, pages: dict[str, Path]
) -> None:
    browser.open(pages["found"])
    assert browser.ask("return document.documentElement.lang") == "en"
    assert browser.ask("return document.title") == "Diagnosis of gt_rear"
    levels = browser.ask("return [...document.querySelectorAll('h1, h2, h3, h4')].map(h => +h.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    targets = (
        "return [...document.querySelectorAll('nav a')].map(a => document.querySelector(a.hash) !== null)"
    )
    assert set(browser.ask(targets)) == {True}


def test_it_prints_on_several_pages_with_the_folded_tables_open(
    browser: Browser, pages: dict[str, Path]
) -> None:
    browser.open(pages["found"])
    shown = "return [...document.querySelectorAll('details table')].map(t => t.checkVisibility())"
    assert browser.ask(shown) == [False, False]
    browser.media("print")
    try:
        assert browser.ask(shown) == [True, True]
        pdf = browser.printed()
    finally:
        browser.media("screen")
    assert pdf.startswith(b"%PDF-")
    assert 5 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 11
