"""What a diagnosis starts from: a drawing with the model asked for, or an identified rig with its own."""

from dataclasses import replace
from pathlib import Path

import pytest

from savgs_ident.cli.diagnosing import Job, baseline_of
from savgs_ident.cli.models import ModelName
from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig, default_rig_path, read_rig
from savgs_ident.effects.registry import MODELS

DRAWING = read_rig(default_rig_path())


def job(model: ModelName | None) -> Job:
    """A job that asks for a model."""
    return Job(Path("campaign.csv"), None, None, model, ("tyre_stiffness",), None, 9, ("savgs-ident",))


def identified(effects: list[str]) -> Rig:
    """A rig identified with ``effects``, whose spring moved from 157614 to 150000 N/m."""
    moved = DRAWING.parameters.with_values({"k_sd": 1.5e5, "c_sd": 5000.0})
    remembered = {"free": ["c_sd"], "effects": effects, "before": {"k_sd": 157614.0}}
    return replace(DRAWING, name="mine", parameters=moved, provenance=remembered)


@pytest.mark.parametrize(
    ("asked", "name"), [(None, "simtr"), (ModelName.simtr, "simtr"), (ModelName.simqc, "simqc")]
)
def test_a_drawing_takes_the_model_asked_for(asked: ModelName | None, name: str) -> None:
    rig, settings, values = baseline_of(DRAWING, job(asked), "x")
    assert rig == DRAWING
    assert (settings.model, settings.baseline, values) == (name, MODELS[name], {})
    assert settings.free == (("mu_r", "mu_t", "ydot_Hth", "c_sd") if name == "simtr" else ("c_sd",))


@pytest.mark.parametrize("asked", [None, ModelName.simqc])
def test_an_identified_rig_brings_its_own_model(asked: ModelName | None) -> None:
    rig, settings, values = baseline_of(identified([]), job(asked), "x")
    assert (settings.model, settings.baseline, settings.free) == ("mine", (), ("c_sd",))
    assert rig.parameters["k_sd"].value == 157614.0
    assert values == {"c_sd": 5000.0, "k_sd": 1.5e5}


def test_another_model_than_the_rig_was_identified_with_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"was identified with rail_coulomb, tyre_friction, which is not simqc"
    ):
        baseline_of(identified(["rail_coulomb", "tyre_friction"]), job(ModelName.simqc), "x")
