"""The posterior report in a real browser: on a phone, on a desk, on paper, and under attack."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from .conftest import SHOWN, Browser

pytestmark = pytest.mark.slow

PICTURES = 13
SMALLEST_TEXT = 14.0
SMALLEST_PICTURE_TEXT = 8.0
"""Of the numbers in pictures, drawn with 8 points [CSS pixel]."""

OVERFLOWING = """
const wide = [];
for (const each of document.querySelectorAll('body *')) {
  if (each.closest('.box, svg, head') && !each.matches('.box')) continue;
  const box = each.getBoundingClientRect();
  if (box.width > 0 && box.right > innerWidth + 0.5) wide.push(each.outerHTML.slice(0, 80));
}
return wide;
"""

SIZES = """
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
const small = [];
while (walker.nextNode()) {
  const holder = walker.currentNode.parentElement;
  if (walker.currentNode.data.trim() && holder.checkVisibility()) {
    small.push([parseFloat(getComputedStyle(holder).fontSize), walker.currentNode.data.trim().slice(0, 40)]);
  }
}
return small;
"""

OPEN_ALL = "document.querySelectorAll('details').forEach(each => { each.open = true; });"


@pytest.mark.parametrize("name", ["page", "hostile_page"])
def test_a_page_requests_nothing_and_logs_no_error(
    browser: Browser, name: str, request: pytest.FixtureRequest
) -> None:
    path: Path = request.getfixturevalue(name)
    browser.open(path)
    console, asked = browser.heard()
    assert console == []
    assert asked == [path.as_uri()]


def test_requests_and_logged_errors_of_a_page_are_noticed(browser: Browser, tmp_path: Path) -> None:
    bad = tmp_path / "bad.html"
    bad.write_text("<img src='http://nowhere.invalid/x.png'><script>console.error('oh')</script>")
    browser.open(bad)
    console, asked = browser.heard()
    assert any("oh" in message for message in console)
    assert "http://nowhere.invalid/x.png" in asked


def test_every_picture_is_there_and_described(browser: Browser, page: Path) -> None:
    browser.open(page)
    pictures = browser.ask("return [...document.images].map(i => [i.complete, i.naturalWidth, i.alt.length])")
    assert len(pictures) == PICTURES
    for complete, width, described in pictures:
        assert complete
        assert width > 300
        assert described > 30
    unnamed = "return [...document.querySelectorAll('svg')].filter(s => !s.getAttribute('aria-label')).length"
    assert browser.ask(unnamed) == 0


def test_hostile_text_is_text(browser: Browser, hostile_page: Path) -> None:
    browser.open(hostile_page)
    browser.ask(OPEN_ALL)
    foreign = (
        "return document.querySelectorAll('script, b, iframe, object, embed, link:not([rel=icon])').length"
    )
    assert browser.ask(foreign) == 0
    armed = "return [...document.querySelectorAll('*')].filter(e => [...e.attributes].some(a => /^on/i.test(a.name)))"
    assert browser.ask(armed) == []
    assert (
        browser.ask("return [...document.images].filter(i => !i.src.startsWith('data:image/svg+xml')).length")
        == 0
    )
    text = browser.ask("return document.body.innerText")
    # Reason, title, data (twice), effect, sentence, name, what it is, unit, hash, model, command, version.
    assert text.count(SHOWN) >= 13
    assert SHOWN in browser.ask("return document.title")
    assert SHOWN in browser.ask("return [...document.images].map(i => i.alt).join()")


def test_the_first_thing_to_read_is_that_it_did_not_converge(browser: Browser, hostile_page: Path) -> None:
    browser.open(hostile_page, 400)
    lines = browser.ask("return document.body.innerText").splitlines()
    assert lines[0].startswith("Not converged")
    assert browser.ask("return document.querySelector('.alarm').getBoundingClientRect().top") < 100.0


@pytest.mark.parametrize("width", [320, 400, 768, 1400])
@pytest.mark.parametrize("name", ["page", "hostile_page"])
def test_nothing_is_wider_than_the_window(
    browser: Browser, name: str, width: int, request: pytest.FixtureRequest
) -> None:
    browser.open(request.getfixturevalue(name), width)
    browser.ask(OPEN_ALL)
    assert browser.ask("return innerWidth") == width
    page = "document.documentElement"
    assert browser.ask(f"return {page}.scrollWidth - {page}.clientWidth") == 0
    assert browser.ask(OVERFLOWING) == []


@pytest.mark.parametrize("width", [400, 1400])
def test_all_text_is_large_enough_to_read(browser: Browser, page: Path, width: int) -> None:
    browser.open(page, width)
    browser.ask(OPEN_ALL)
    sizes = browser.ask(SIZES)
    assert len(sizes) > 300
    assert [entry for entry in sizes if entry[0] < SMALLEST_TEXT] == []
    scales = browser.ask(
        "return [...document.images].map(i => i.getBoundingClientRect().width / i.naturalWidth)"
    )
    eight_points = 8.0 * 96.0 / 72.0
    assert min(scales) * eight_points >= SMALLEST_PICTURE_TEXT


def test_rows_become_blocks_on_a_phone_and_every_value_keeps_its_heading(
    browser: Browser, page: Path
) -> None:
    heading = (
        "return [...document.querySelectorAll('#parameters td.number')].map("
        "cell => getComputedStyle(cell, '::before').content)"
    )
    browser.open(page, 400)
    headings = browser.ask(heading)
    assert '"Median"' in headings
    assert "none" not in headings
    browser.resize(1400)
    assert set(browser.ask(heading)) == {"none"}


def test_the_page_has_a_language_a_title_and_headings_in_order(browser: Browser, page: Path) -> None:
    browser.open(page)
    assert browser.ask("return document.documentElement.lang") == "en"
    assert browser.ask("return document.title").startswith("Posterior of ")
    levels = browser.ask("return [...document.querySelectorAll('h1, h2, h3, h4')].map(h => +h.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    targets = (
        "return [...document.querySelectorAll('nav a')].map(a => document.querySelector(a.hash) !== null)"
    )
    assert set(browser.ask(targets)) == {True}


def test_it_prints_on_several_pages_with_the_folded_tables_open(browser: Browser, page: Path) -> None:
    browser.open(page)
    shown = "return [...document.querySelectorAll('details table')].map(t => t.checkVisibility())"
    assert browser.ask(shown) == [False, False]
    browser.media("print")
    try:
        assert browser.ask(shown) == [True, True]
        pdf = browser.printed()
    finally:
        browser.media("screen")
    assert pdf.startswith(b"%PDF-")
    pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
    assert 7 <= pages <= 13
