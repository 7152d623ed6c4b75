"""A diagnosed effect joins the model with the numbers of its fit, something unknown as the force learned for it."""

from typing import Any

import jax
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import MODELS
from savgs_ident.export.diagnosed import with_diagnosis
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.signals import resting_state

from .diagnoses import COEFFICIENTS, IDENTIFIED, LEARNED, MOUNT, NOTHING, SPANS, UNKNOWN, diagnosis

SIMTR = MODELS["simtr"]


def test_the_named_effect_joins_with_all_numbers_of_its_fit(identified: Rig) -> None:
    found = with_diagnosis(identified, SIMTR, MOUNT)
    assert found.added == ("mount_compliance",)
    assert found.effects == (*SIMTR, "mount_compliance")
    for name, value in IDENTIFIED.items():
        assert found.rig.parameters[name].value == value
    # The recalibrated baseline makes up for the missing mount by a soft tyre: its numbers are not taken.
    assert found.rig.parameters["k_t"].value != MOUNT["baseline"]["parameters"]["k_t"]
    # What was not fitted stays.
    assert found.rig.parameters["mu_t"] == identified.parameters["mu_t"]
    states = ExportedModel(found.rig, found.effects).equations.states
    assert states[-1].name == "state_1_mount_deflection"


def test_it_is_said_which_numbers_were_taken(identified: Rig) -> None:
    effect, others, covariance = with_diagnosis(identified, SIMTR, MOUNT).said
    assert "mount_compliance = 1.65e-06 m/N, mount_damping = 357 N s/m" in effect
    assert others.startswith("2 more numbers (mu_r, k_t")
    assert "covariance" in covariance


def test_the_covariance_of_the_fit_without_it_is_left_behind(identified: Rig) -> None:
    found = with_diagnosis(identified, SIMTR, MOUNT).rig
    assert ExportedModel(found, SIMTR).covariance[0] == ()
    assert found.provenance["effects"] == [*SIMTR, "mount_compliance"]
    assert found.provenance["data_sha256"] == "ab12"
    before: Any = found.provenance["fit_before"]
    assert before["data"] == identified.provenance["data"]
    assert "covariance" not in before


def test_a_diagnosis_of_the_contract_alone_gives_the_effect_its_numbers(identified: Rig) -> None:
    short = {
        name: value for name, value in MOUNT.items() if name not in ("identified", "provenance", "converged")
    }
    found = with_diagnosis(identified, SIMTR, short)
    assert found.rig.parameters["mount_damping"].value == 357.0
    assert found.rig.parameters["k_t"] == identified.parameters["k_t"]
    assert "all other numbers are those of the rig file" in " ".join(found.said)


@pytest.mark.parametrize(
    ("document", "said"),
    [(NOTHING, "nothing missing"), (UNKNOWN, "at frame) and that no force there explains")],
)
def test_without_a_named_effect_the_model_stays_as_it_is(
    identified: Rig, document: dict[str, Any], said: str
) -> None:
    found = with_diagnosis(identified, SIMTR, document)
    assert (found.rig, found.effects, found.added) == (identified, SIMTR, ())
    (sentence,) = found.said
    assert said in sentence


def test_what_was_learned_for_something_unknown_joins_the_model(identified: Rig) -> None:
    found = with_diagnosis(identified, SIMTR, LEARNED)
    assert found.added == ("learned_strut",)
    assert found.effects == (*SIMTR, "learned_strut")
    for name, value in (SPANS | COEFFICIENTS | {"mu_r": 0.0301}).items():
        assert found.rig.parameters[name].value == value
    assert "edge of the motion" in found.said[-1]
    model, without = (ExportedModel(found.rig, effects).equations for effects in (found.effects, SIMTR))
    assert len(model.parameters) == len(without.parameters)
    x, u = np.array(resting_state(ExportedModel(identified, SIMTR))), np.array([0.0, 0.0, 1.57, 0.0])
    p = np.array(found.rig.parameters.values_of(model.parameters))
    y = np.zeros(len(x) - 2)
    missing = jax.jit(lambda: model.residual(x, y, u, p) - without.residual(x, y, u, p))()
    assert float(np.abs(missing).max()) > 1.0
    again = with_diagnosis(found.rig, found.effects, LEARNED)
    assert (again.rig, again.effects) == (found.rig, found.effects)


def test_an_effect_that_is_in_the_model_is_not_added_again(identified: Rig) -> None:
    whole = (*SIMTR, "mount_compliance")
    found = with_diagnosis(identified, whole, MOUNT)
    assert (found.rig, found.effects, found.added) == (identified, whole, ())


def test_several_effects_join_together(rig: Rig) -> None:
    pair = {
        "effect": "rail_coulomb + tyre_friction",
        "parameters": {
            "mu_r": {"value": 0.031, "unit": "1"},
            "mu_t": {"value": 0.24, "unit": "1"},
            "ydot_Hth": {"value": 0.052, "unit": "m/s"},
        },
    }
    document = diagnosis(
        "several", ["rail_coulomb", "tyre_friction"], ["rail", "tyre_lateral"], which=[pair],
        baseline={"model": "simqc", "parameters": {}, "effects": []},
    )  # fmt: skip
    found = with_diagnosis(rig, (), document)
    assert found.effects == SIMTR
    assert found.rig.parameters["mu_r"].value == 0.031
    assert "rail_coulomb and tyre_friction" in found.said[0]


FAULTS = {
    "another baseline": (
        MOUNT | {"baseline": {"model": "simqc", "parameters": {}, "effects": []}},
        "no friction",
    ),
    "no such hypothesis": (MOUNT | {"which": []}, "no fitted parameters of mount_compliance"),
    "a value too few": (
        MOUNT
        | {
            "identified": {},
            "which": [
                {
                    "effect": "mount_compliance",
                    "parameters": {"mount_damping": {"value": 1.0, "unit": "N s/m"}},
                }
            ],
        },
        "no value for 'mount_compliance'",
    ),
    "a stranger": (MOUNT | {"identified": IDENTIFIED | {"nobody": 1.0}}, "no parameter 'nobody'"),
    "beyond its bounds": (MOUNT | {"identified": IDENTIFIED | {"mu_r": -1.0}}, "outside its bounds"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_diagnosis_of_another_model_is_refused(identified: Rig, fault: str) -> None:
    document, said = FAULTS[fault]
    with pytest.raises(InputError, match=said):
        with_diagnosis(identified, SIMTR, document)
