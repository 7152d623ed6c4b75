"""The damper of the examples: known truth in the stand-in, and the literature on a real one where it is present."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

import savgs_ident as si
from savgs_ident.fit.along_motion import MotionFit

from .relaxed import with_kept_programs

REPOSITORY = Path(__file__).resolve().parents[1]
EXAMPLE = REPOSITORY / "examples/damper"
REAL = REPOSITORY.parent / "shared/data/real/mr_damper"
CHANNELS = """
[channels.stroke]
column = "dist"
unit = "mm"
[channels.force]
column = "forc"
unit = "N"
[time]
column = "Tout"
unit = "s"
"""


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with with_kept_programs():
        yield


def _damper(*effects: str) -> si.PlantModel:
    model = si.load_plant(str(EXAMPLE / "damper.py"))
    for name in effects:
        model = model + name
    return model


def _fitted(effects: Sequence[str], one: Path, other: Path, channels: Path | None = None) -> MotionFit:
    model = _damper(*effects)
    first, second = (si.load_campaign(path, channels, layout=model.layout) for path in (one, other))
    found = si.fit(model, first, held_out=second)
    assert isinstance(found, MotionFit)
    return found


def test_a_formula_that_is_not_quite_that_of_the_friction_is_not_trusted_and_its_errors_contain_the_truth() -> (
    None
):
    files = EXAMPLE / "stroke.csv.gz", EXAMPLE / "stroke_again.csv.gz"
    fit = _fitted(("cell_offset", "seals_preload"), *files)
    assert not fit.trusted
    assert "diagnose" in fit.doubts[0]
    truth = {"c": 600.0, "cell_offset_force": -130.0, "seals_preload_force": 50.0}
    for name, value in truth.items():
        assert abs(fit[name].value - value) < 2.0 * fit[name].stderr
    bare = _fitted(("cell_offset",), *files)
    assert fit.held_out is not None
    assert bare.held_out is not None
    assert fit.gap[1] < 0.2 * bare.gap[1]
    assert fit.held_out.identified < 0.2 * bare.held_out.identified
    assert json.loads(fit.to_json())["gap"]["force"]["after"] == pytest.approx(fit.gap[1])


@pytest.mark.slow
def test_its_friction_is_found() -> None:
    model = _damper("cell_offset")
    found = si.diagnose(model, si.load_campaign(EXAMPLE / "stroke.csv.gz", layout=model.layout))
    assert found.verdict.ports == ("damper",)
    assert [str(each) for each in found.verdict.families] == ["damper/friction"]
    assert not found.verdict.law_known
    assert found.shrink.closed_by_effect > 0.9


@pytest.mark.skipif(not REAL.exists(), reason="published recordings are not here")
def test_a_real_damper_has_the_friction_of_the_literature(tmp_path: Path) -> None:
    channels = tmp_path / "channels.toml"
    channels.write_text(CHANNELS)
    files = REAL / "ensaio1.mat", REAL / "ensaio7.mat"
    viscous = _fitted(("cell_offset",), *files, channels)
    dry = _fitted(("cell_offset", "seals_preload"), *files, channels)
    assert dry["cell_offset_force"].value == pytest.approx(-135.0, abs=10.0)
    # Of the alternating force; the gap is of all of it.
    force = viscous.measured
    alternating = float((force**2).mean() ** 0.5 / force.std())
    assert 0.28 < viscous.gap[1] * alternating < 0.40
    assert 0.08 < dry.gap[1] * alternating < 0.22


@pytest.mark.slow
@pytest.mark.skipif(not REAL.exists(), reason="published recordings are not here")
def test_what_a_real_damper_lacks_is_friction(tmp_path: Path) -> None:
    channels = tmp_path / "channels.toml"
    channels.write_text(CHANNELS)
    model = _damper("cell_offset")
    found = si.diagnose(model, si.load_campaign(REAL / "ensaio1.mat", channels, layout=model.layout))
    assert [str(each) for each in found.verdict.families] == ["damper/friction"]
    assert found.shrink.closed_by_effect > 0.9
