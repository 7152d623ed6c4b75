"""README and pages: short where it should be, links that lead somewhere, commands, calls and keys that exist."""

import re
from pathlib import Path

import pytest

import savgs_ident as si
from benchmarks.figures import FIGURES
from savgs_ident.cli.app import app
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.channels import read_channel_map

from ..in_one_test import over

REPOSITORY = Path(__file__).resolve().parents[2]
README = (REPOSITORY / "README.md").read_text()
PAGES = [
    *(REPOSITORY / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((REPOSITORY / "docs").glob("*.md")),
    *sorted(REPOSITORY.glob("*/README.md")),
]
COMMANDS = {each.name or each.callback.__name__.replace("_", "-") for each in app.registered_commands}  # type: ignore[union-attr]


def _anchor(heading: str) -> str:
    """The anchor that GitHub and MyST give a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def _links(page: Path) -> list[str]:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    return [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not link.startswith("http")]


def test_the_readme_is_short_and_shows_one_picture() -> None:
    assert len(README.splitlines()) <= 130
    assert re.findall(r"!\[.*?\]\((.*?)\)", README) == ["docs/pictures/diagnosis.png"]


@over("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in _links(page):
        path, _, heading = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), link
        if heading:
            assert heading in {
                _anchor(each) for each in re.findall(r"^#+ (.*)$", target.read_text(), re.M)
            }, link


@over("page", PAGES, ids=lambda page: str(page.relative_to(REPOSITORY)))
def test_commands_and_calls_exist(page: Path) -> None:
    text = page.read_text()
    assert {name for name in re.findall(r"savgs-ident ([a-z][a-z-]*)", text) if name != "savgs"} <= COMMANDS
    assert set(re.findall(r"\bsi\.([a-z_]+)\(", text)) <= set(si.__all__)


def test_the_table_of_the_readme_has_every_command() -> None:
    rows = re.findall(r"^\| [^|]+ \| `([a-z-]+)", README, re.M)
    assert COMMANDS - set(rows) == {"demo"}
    assert "make demo" in README


def test_every_figure_of_the_benchmarks_is_explained() -> None:
    text = (REPOSITORY / "benchmarks" / "README.md").read_text()
    assert set(FIGURES) <= set(re.findall(r"^\| `(\w+)` \|", text, re.M))


@pytest.mark.parametrize("page", ["guide", "formats"])
def test_the_channel_map_of_a_page_is_one(page: str, tmp_path: Path) -> None:
    text = (REPOSITORY / "docs" / f"{page}.md").read_text()
    (block,) = (each for each in re.findall(r"```toml\n(.*?)```", text, re.S) if "[channels." in each)
    path = tmp_path / "channels.toml"
    path.write_text(block)
    assert read_channel_map(path, RIG_LAYOUT).rules[0].unit == "g"
