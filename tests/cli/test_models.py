"""What a rig file says of itself, and what is reported of it; what a diagnosis starts from."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result

import savgs_ident as si
from savgs_ident.cli.options import ModelName, effects_of
from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.public import baseline_of
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig, default_rig_path, read_rig, rig_text

IDENTIFIED = {"effects": ["rail_coulomb"], "status": "stalled", "trusted": False}
DRAWING = read_rig(default_rig_path())
Invoke = Callable[..., Result]


@pytest.mark.parametrize("trusted", [True, False])
def test_a_rig_whose_fit_is_doubtful_says_so(rig: Rig, tmp_path: Path, trusted: bool) -> None:
    path = _file(replace(rig, provenance=IDENTIFIED | {"trusted": trusted}), tmp_path)
    doubts = () if trusted else (f"{path}: its own fit is not to be trusted (stalled).",)
    model = si.load_model(path)
    assert (model.effects, model.doubts) == (("rail_coulomb",), doubts)
    assert si.load_model(path, effects_of(ModelName.simqc)).effects == ()
    with pytest.raises(InputError, match=r"there is no model 'simxx'\. Remedy: choose among: simqc, simtr"):
        si.load_model(path, "simxx")


@pytest.mark.slow
def test_what_follows_from_it_is_not_to_be_trusted_either(invoke: Invoke, rig: Rig, tmp_path: Path) -> None:
    path = _file(replace(rig, provenance=IDENTIFIED), tmp_path)
    done = invoke("simulate", path, "--frequency", "1", "--quiet", "--out", "o")
    assert done.exit_code == 1
    assert "its own fit is not to be trusted (stalled)." in done.stderr


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
    given, settings, values = baseline_of(si.load_baseline(None, effects_of(asked)))
    assert isinstance(given, RigModel)
    assert given.rig == DRAWING
    assert (settings.model, settings.baseline, values) == (name, MODELS[name], {})
    assert settings.free == (("mu_r", "mu_t", "ydot_Hth", "c_sd") if name == "simtr" else ("c_sd",))


@pytest.mark.parametrize("asked", [None, ModelName.simqc])
def test_an_identified_rig_brings_its_own_model(asked: ModelName | None, tmp_path: Path) -> None:
    given, settings, values = baseline_of(si.load_baseline(_identified([], tmp_path), effects_of(asked)))
    assert (settings.model, settings.baseline, settings.free) == ("mine", (), ("c_sd",))
    assert given.table["k_sd"].value == 157614.0
    assert values == {"c_sd": 5000.0, "k_sd": 1.5e5}


def test_another_model_than_the_rig_was_identified_with_is_refused(tmp_path: Path) -> None:
    path = _identified(["rail_coulomb", "tyre_friction"], tmp_path)
    with pytest.raises(
        InputError, match=r"was identified with rail_coulomb, tyre_friction, which is not simqc"
    ):
        si.load_baseline(path, "simqc")
