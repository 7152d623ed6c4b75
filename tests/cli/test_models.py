"""What a rig file says of itself, and what is reported of it; what a diagnosis starts from."""

from dataclasses import replace
from pathlib import Path

import pytest

from savgs_ident.cli.options import ModelName, read_baseline, read_model
from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.public import baseline_of
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig, rig_text

IDENTIFIED = {"effects": ["rail_coulomb"], "status": "stalled", "trusted": False}
DRAWING = read_rig(default_rig_path())


@pytest.mark.parametrize(("trusted", "reported"), [(True, False), (False, True)])
def test_a_rig_whose_fit_is_doubtful_is_reported_of(
    rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str], trusted: bool, reported: bool
) -> None:
    path = _file(replace(rig, provenance=IDENTIFIED | {"trusted": trusted}), tmp_path)
    assert read_model(path, None).effects == ("rail_coulomb",)
    said = capsys.readouterr().err
    assert ("its own fit is not to be trusted (stalled)" in said) is reported
    assert read_model(path, ModelName.simqc).effects == ()


def _file(rig: Rig, folder: Path) -> Path:
    path = folder / "model.toml"
    path.write_text(rig_text(rig), encoding="utf-8")
    return path


def _identified(effects: list[str], folder: Path) -> Path:
    """A rig identified with ``effects``, whose spring moved from 157614 to 150000 N/m."""
    moved = DRAWING.parameters.with_values({"k_sd": 1.5e5, "c_sd": 5000.0})
    remembered = {"free": ["c_sd"], "effects": effects, "before": {"k_sd": 157614.0}}
    return _file(replace(DRAWING, name="mine", parameters=moved, provenance=remembered), folder)


@pytest.mark.parametrize(
    ("asked", "name"), [(None, "simtr"), (ModelName.simtr, "simtr"), (ModelName.simqc, "simqc")]
)
def test_a_drawing_takes_the_model_asked_for(asked: ModelName | None, name: str) -> None:
    rig, settings, values = baseline_of(read_baseline(None, asked))
    assert rig == DRAWING
    assert (settings.model, settings.baseline, values) == (name, MODELS[name], {})
    assert settings.free == (("mu_r", "mu_t", "ydot_Hth", "c_sd") if name == "simtr" else ("c_sd",))


@pytest.mark.parametrize("asked", [None, ModelName.simqc])
def test_an_identified_rig_brings_its_own_model(asked: ModelName | None, tmp_path: Path) -> None:
    rig, settings, values = baseline_of(read_baseline(_identified([], tmp_path), asked))
    assert (settings.model, settings.baseline, settings.free) == ("mine", (), ("c_sd",))
    assert rig.parameters["k_sd"].value == 157614.0
    assert values == {"c_sd": 5000.0, "k_sd": 1.5e5}


def test_another_model_than_the_rig_was_identified_with_is_refused(tmp_path: Path) -> None:
    path = _identified(["rail_coulomb", "tyre_friction"], tmp_path)
    with pytest.raises(
        InputError, match=r"was identified with rail_coulomb, tyre_friction, which is not simqc"
    ):
        read_baseline(path, ModelName.simqc)
