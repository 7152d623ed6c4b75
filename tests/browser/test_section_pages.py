"""The reports made of sections in a real browser: on a phone, on a desk, and under attack."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from savgs_ident.campaigns.study import CampaignRow, CampaignStudy, Identified, RowStatus, study_campaigns
from savgs_ident.control.closed_loop.programme import DEFAULT_SPEED, LoopKind, bump_test
from savgs_ident.control.closed_loop.study import LoopStudy, study_loop
from savgs_ident.control.design import Design, controller_for, design_controller, rigs_from_covariance
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS
from savgs_ident.control.linear_study import LinearStudy, study_linear
from savgs_ident.core.presentation import NO_ORIGIN, Origin, no_progress
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.report.campaigns.page import campaigns_html
from savgs_ident.report.control.design_page import design_html
from savgs_ident.report.control.linear_page import linear_html
from savgs_ident.report.control.loop_page import loop_html

from ..relaxed import with_kept_programs
from .conftest import HOSTILE, SHOWN, Browser
from .test_posterior_page import OPEN_ALL, OVERFLOWING, SIZES, SMALLEST_PICTURE_TEXT, SMALLEST_TEXT

pytestmark = pytest.mark.slow

PICTURES = {"linear": 3, "design": 5, "loop": 4, "campaigns": 1, "attacked": 5, "attacked campaigns": 1}
EFFECTS = MODELS["simtr"]
Pages = Callable[[str], Path]
LINEAR, LOOP = (pytest.param(name, marks=pytest.mark.slow) for name in ("linear", "loop"))
"""Half a minute of studies each, for pages of the same sections as the others."""

NAMES = (LINEAR, LOOP, *(name for name in PICTURES if name not in ("linear", "loop")))
START = 1_772_438_400.0
SETTINGS = {"model": "simtr", "free": ["mu_r", "c_sd"], "max_frequency_hz": None}


def _linear(rig: Rig) -> LinearStudy:
    """The linear models of the shipped rig."""
    return study_linear(RigModel(rig, EFFECTS), NO_ORIGIN, no_progress)


def _design(rig: Rig) -> Design:
    """A controller for it."""
    model = RigModel(rig, EFFECTS)
    rigs = rigs_from_covariance(model.table, rig.provenance, 5)
    return design_controller(model, rigs, DEFAULT_WEIGHTS, NO_ORIGIN, no_progress)


def _loop(rig: Rig) -> tuple[LoopStudy, Values]:
    """A controller over a bump, on the shipped rig and on two others, with causes."""
    model = RigModel(rig, EFFECTS)
    p = as_values(model.table.as_dict())
    controller = controller_for(model.build(), p, DEFAULT_WEIGHTS)
    rigs = rigs_from_covariance(model.table, rig.provenance, 2)
    test = bump_test(DEFAULT_SPEED[LoopKind.bump])
    study = study_loop(model, controller, "as given", test, NO_ORIGIN, no_progress, rigs, causes=True)
    return study, p


def _campaigns(name: str) -> CampaignStudy:
    """Fourteen days, friction rising; a campaign that failed and one that is not to be trusted."""
    rows = [
        CampaignRow(
            f"{name}{day}", f"recordings/{name}{day}.csv.gz", RowStatus.ok, "", START + 86400.0 * day, 1.02,
            {
                "mu_r": Identified(0.03 + 2e-4 * day, 3e-4, 2e-4, "1"),
                "c_sd": Identified(5400.0 + 10.0 * (-1.0) ** day, 25.0, 20.0, "N s/m"),
            },
        )
        for day in range(14)
    ]  # fmt: skip
    doubtful = replace(
        rows[3], status=RowStatus.not_trusted, reason=f"{name}: not converged", data_sha256=name
    )
    failed = CampaignRow(
        f"{name}x", f"{name}.csv", RowStatus.failed, f"{name}: no column is known", None, None, {}
    )
    return study_campaigns([*rows[:3], doubtful, *rows[4:], failed], str, SETTINGS, NO_ORIGIN)


@pytest.fixture(scope="module")
def pages(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pages]:
    """The four reports, and two with an attack in every name, one of a failed controller; made when asked for."""
    origin = Origin(
        ("savgs-ident", "design", "gt_rear.toml"), model="gt_rear.toml", rig="gt_rear", effects=EFFECTS
    )
    bad = Origin(
        ("savgs-ident", HOSTILE),
        model=HOSTILE,
        versions={HOSTILE: HOSTILE},
        rig=HOSTILE,
        effects=(HOSTILE,),
    )
    design = cache(lambda: _design(rig))

    def attacked() -> str:
        unstable = replace(design().digital_margins, stable=False)
        rigs = replace(design().rigs, source=HOSTILE)
        return design_html(replace(design(), digital_margins=unstable, rigs=rigs), bad)

    texts: dict[str, Callable[[], str]] = {
        "linear": lambda: linear_html(_linear(rig), origin),
        "design": lambda: design_html(design(), origin),
        "loop": lambda: loop_html(*_loop(rig), origin, "designed here"),
        "campaigns": lambda: campaigns_html(
            _campaigns("run"), SETTINGS, ("savgs-ident", "campaign", "recordings")
        ),
        "attacked": attacked,
        "attacked campaigns": lambda: campaigns_html(_campaigns(HOSTILE), {"free": [HOSTILE]}, (HOSTILE,)),
    }
    folder = tmp_path_factory.mktemp("sections")

    @cache
    def page(name: str) -> Path:
        path: Path = folder / f"{name}.html"
        path.write_text(texts[name](), encoding="utf-8")
        return path

    with with_kept_programs():
        yield page


@pytest.mark.parametrize("name", NAMES)
def test_a_page_requests_nothing_and_logs_no_error(browser: Browser, pages: Pages, name: str) -> None:
    browser.open(pages(name))
    console, asked = browser.heard()
    assert console == []
    assert asked == [pages(name).as_uri()]


@pytest.mark.parametrize("name", NAMES)
def test_every_picture_is_there_and_described(browser: Browser, pages: Pages, name: str) -> None:
    browser.open(pages(name))
    pictures = browser.ask("return [...document.images].map(i => [i.complete, i.naturalWidth, i.alt.length])")
    assert len(pictures) == PICTURES[name]
    for complete, width, described in pictures:
        assert complete
        assert width > 300
        assert described > 30


@pytest.mark.parametrize("width", [390, 768, 1280])
@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_wider_than_the_window(browser: Browser, pages: Pages, name: str, width: int) -> None:
    browser.open(pages(name), width)
    assert browser.ask("return innerWidth") == width
    page = "document.documentElement"
    assert browser.ask(f"return {page}.scrollWidth - {page}.clientWidth") == 0
    assert browser.ask(OVERFLOWING) == []


@pytest.mark.parametrize("width", [390, 1280])
@pytest.mark.parametrize("name", [LINEAR, LOOP, "design", "campaigns"])
def test_all_text_is_large_enough_to_read(browser: Browser, pages: Pages, name: str, width: int) -> None:
    browser.open(pages(name), width)
    sizes = browser.ask(SIZES)
    assert len(sizes) > 100
    assert [entry for entry in sizes if entry[0] < SMALLEST_TEXT] == []
    scales = browser.ask(
        "return [...document.images].map(i => i.getBoundingClientRect().width / i.naturalWidth)"
    )
    # The smallest words in these pictures have 8.5 points.
    assert min(scales) * 8.5 * 96.0 / 72.0 >= SMALLEST_PICTURE_TEXT
    assert max(scales) < 1.25


@pytest.mark.parametrize("name", [LINEAR, "design"])
def test_tables_fit_beside_their_headings_on_a_desk(browser: Browser, pages: Pages, name: str) -> None:
    browser.open(pages(name), 1280)
    scrolling = (
        "return [...document.querySelectorAll('.box')].filter(b => b.scrollWidth > b.clientWidth).length"
    )
    assert browser.ask(scrolling) == 0


@pytest.mark.parametrize(("name", "times"), [("attacked", 8), ("attacked campaigns", 40)])
def test_hostile_text_is_text(browser: Browser, pages: Pages, name: str, times: int) -> None:
    browser.open(pages(name))
    browser.ask(OPEN_ALL)
    foreign = (
        "return document.querySelectorAll('script, b, iframe, object, embed, link:not([rel=icon])').length"
    )
    assert browser.ask(foreign) == 0
    armed = "return [...document.querySelectorAll('*')].filter(e => [...e.attributes].some(a => /^on/i.test(a.name)))"
    assert browser.ask(armed) == []
    # Kind, note on the rigs, rig file, effects, rigs it was tried on, command, a package and its version; of every
    # campaign its name and where it is, of some what is wrong, the settings and the command.
    assert browser.ask("return document.body.innerText").count(SHOWN) >= times


def test_a_hostile_title_is_text(browser: Browser, pages: Pages) -> None:
    browser.open(pages("attacked"))
    assert SHOWN in browser.ask("return document.title")


def test_the_first_thing_to_read_is_that_it_is_not_to_be_trusted(browser: Browser, pages: Pages) -> None:
    browser.open(pages("attacked"), 390)
    assert browser.ask("return document.body.innerText").startswith("Not to be trusted")
    assert browser.ask("return document.querySelector('.alarm').getBoundingClientRect().top") < 100.0


@pytest.mark.parametrize("name", [LINEAR, "design", "campaigns"])
def test_the_page_has_a_language_headings_in_order_and_links_that_lead_somewhere(
    browser: Browser, pages: Pages, name: str
) -> None:
    browser.open(pages(name))
    assert browser.ask("return document.documentElement.lang") == "en"
    levels = browser.ask("return [...document.querySelectorAll('h1, h2, h3, h4')].map(h => +h.tagName[1])")
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    targets = (
        "return [...document.querySelectorAll('nav a')].map(a => document.querySelector(a.hash) !== null)"
    )
    assert set(browser.ask(targets)) == {True}
