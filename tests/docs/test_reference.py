"""The documentation builds without a warning, and the reference has a page for every public module."""

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "savgs_ident"
MODULES = [
    ".".join(path.relative_to(REPOSITORY).with_suffix("").parts).removesuffix(".__init__")
    for path in sorted(PACKAGE.rglob("*.py"))
    if (not path.stem.startswith("_") or path.stem == "__init__") and path.parent != PACKAGE
]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built pages; the generated sources are kept out of the repository."""
    folder = tmp_path_factory.mktemp("documentation")
    source = shutil.copytree(REPOSITORY / "docs", folder / "docs", ignore=shutil.ignore_patterns("reference"))
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", source, folder / "out"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    assert done.returncode == 0, done.stderr[-4000:]
    return folder / "out"


def _text_of(built: Path, module: str) -> str:
    page = (built / "reference" / f"{module}.html").read_text(encoding="utf-8")
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", page)).split())


@pytest.mark.slow
def test_every_public_module_has_its_page_and_no_other_has(built: Path) -> None:
    pages = {page.stem for page in (built / "reference").glob("*.html")}
    assert pages == set(MODULES)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", ["index", "guide", "plants", "how-it-works", "validation", "performance", "formats", "reference"]
)
def test_the_pages_by_hand_are_there(built: Path, page: str) -> None:
    assert (built / f"{page}.html").is_file()


@pytest.mark.slow
def test_signatures_and_fields_are_shown_as_written(built: Path) -> None:
    base = _text_of(built, "savgs_ident.plants.base")
    assert "transfers( p: Values, frequency: Float[Array, '*f'], ) → Complex[Array, 'C *f']" in base
    fit = _text_of(built, "savgs_ident.fit.identified")
    assert "covariance: NDArray[float64]" in fit
    assert "of the estimates in their order [products of their units], (n, n)." in fit
    assert "Annotated" not in _text_of(built, "savgs_ident.cli.simulate")


@pytest.mark.slow
def test_private_names_and_those_of_others_are_left_out(built: Path) -> None:
    periodic = _text_of(built, "savgs_ident.simulate.periodic")
    assert "nodes: int = 256" in periodic
    assert "_riding_the_road" not in periodic
    assert "partial" not in _text_of(built, "savgs_ident.control.linearisation")


@pytest.mark.slow
def test_names_lead_to_where_they_are_reported(built: Path) -> None:
    """One of an annotation, and one of a text."""
    assert _link("plants.model", "Model") in _page(built, "fit.identified")
    assert _link("plants.quarter_car.rig_recordings", "load_campaign") in _page(built, "campaigns.run")


def _page(built: Path, module: str) -> str:
    return (built / "reference" / f"savgs_ident.{module}.html").read_text(encoding="utf-8")


def _link(module: str, name: str) -> str:
    return f'href="savgs_ident.{module}.html#savgs_ident.{module}.{name}"'
