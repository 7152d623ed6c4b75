"""Models by name."""

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.rig import Rig


def test_simtr_is_simqc_and_the_frictions_of_rail_and_tyre(rig: Rig) -> None:
    assert build_model(rig, MODELS["simqc"]).effects == ()
    simtr = build_model(rig, MODELS["simtr"])
    assert [effect.name for effect in simtr.effects] == ["rail_coulomb", "tyre_friction"]
    assert [state.name for state in simtr.states] == ["anchor"]
    assert {name for model in MODELS.values() for name in model} <= set(CATALOGUE)


def test_the_rig_file_has_the_last_word_on_the_parameters_of_effects(rig: Rig) -> None:
    table = model_parameters(rig, MODELS["simtr"])
    assert table["k_pre"] == rig.parameters["k_pre"]
    assert set(table) == set(rig.parameters)


def test_an_unknown_effect_is_refused_with_the_choice(rig: Rig) -> None:
    with pytest.raises(InputError, match=r"no effect 'rail_colomb'.*rail_coulomb,.* tyre_friction"):
        build_model(rig, ["rail_colomb"])
