"""The model of a rig file, a posterior and a diagnosis: what is added, what is refused, what is reported."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.export.exported_model import ExportedModel, resting_state
from savgs_ident.export.gather import gather, read_diagnosis, with_diagnosis
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from .diagnoses import COEFFICIENTS, IDENTIFIED, LEARNED, MOUNT, NOTHING, SPANS, UNKNOWN, diagnosis

SIMTR = MODELS["simtr"]


@pytest.fixture
def posterior(tmp_path: Path, identified: Rig) -> Path:
    """Draws about the identified rig, of a model with friction."""
    random = np.random.default_rng(1)
    path = tmp_path / "posterior.nc"
    with h5py.File(path, "w") as file:
        for name in ("mu_r", "k_t"):
            value = identified.parameters[name].value
            file[f"posterior/{name}"] = value * (1.0 + 0.01 * random.standard_normal((4, 50)))
        file["posterior/noise_scale"] = np.ones((4, 50))
    return path


def test_a_model_with_its_own_posterior_is_not_doubted(identified: Rig, posterior: Path) -> None:
    found = gather(RigModel(identified, SIMTR), posterior=posterior, count=20)
    assert (found.said, found.doubts) == ((), ())
    assert found.model.model.rig == identified
    assert {name: values.shape for name, values in found.model.samples.items()} == {
        "mu_r": (20,),
        "k_t": (20,),
    }


def test_a_posterior_without_the_diagnosed_effect_is_reported(identified: Rig, posterior: Path) -> None:
    found = gather(RigModel(identified, SIMTR), MOUNT, posterior)
    doubt = found.doubts[0]
    assert "of a model without mount_compliance" in doubt
    assert "no draws of mount_compliance, mount_damping" in doubt
    assert found.model.model.rig.provenance["notes"] == [*found.said, *found.doubts]


@pytest.mark.parametrize("count", [None, 1, 2])
def test_a_posterior_that_lies_elsewhere_is_reported(
    identified: Rig, posterior: Path, count: int | None
) -> None:
    """However few of its draws travel along."""
    moved = replace(identified, parameters=identified.parameters.with_values({"k_t": 2.0e5}))
    found = gather(RigModel(moved, SIMTR), posterior=posterior, count=count)
    assert found.model.samples["k_t"].size == (count or 200)
    (doubt,) = found.doubts
    assert "lies elsewhere than the model: k_t is more than 6 standard deviations off" in doubt


def test_a_fit_that_was_not_trusted_is_reported_and_travels_along(identified: Rig) -> None:
    bad = replace(
        identified, provenance={**identified.provenance, "trusted": False, "status": "max_iterations"}
    )
    found = gather(RigModel(bad, SIMTR))
    assert found.doubts == ("The rig file's own fit is not to be trusted (max_iterations).",)
    assert found.model.model.rig.provenance["notes"] == list(found.doubts)


def _doubted(identified: Rig, diagnosis: dict[str, Any], *without: str) -> tuple[str, ...]:
    """Doubts of a model whose fit was not trusted, with a diagnosis; ``without`` some entries of its provenance."""
    provenance = {**identified.provenance, "trusted": False, "status": "max_iterations"}
    reported = {name: value for name, value in provenance.items() if name not in without}
    return gather(RigModel(replace(identified, provenance=reported), SIMTR), diagnosis).doubts


def test_a_fit_that_was_not_trusted_is_no_matter_once_all_its_numbers_are_replaced(identified: Rig) -> None:
    anew = MOUNT | {"identified": MOUNT["identified"] | {"c_sd": 5800.0}}
    assert _doubted(identified, anew) == ()
    # Of what the file said to be free, c_sd is not in the diagnosis.
    (doubt,) = _doubted(identified, MOUNT)
    assert "not to be trusted (max_iterations), and some of its numbers (c_sd) are in the model" in doubt
    # A tolerance that was estimated along is a number of that fit, too.
    tolerated = replace(identified, provenance=identified.provenance | {"before": {"mu_t": 0.25}})
    assert "(mu_t)" in _doubted(tolerated, anew)[0]


def test_a_fit_that_was_not_trusted_and_does_not_say_what_it_moved_is_doubted(identified: Rig) -> None:
    (doubt,) = _doubted(identified, MOUNT, "free", "before")
    assert "some of its numbers are in the model still" in doubt


@pytest.mark.parametrize("document", [NOTHING, UNKNOWN])
def test_a_diagnosis_that_adds_nothing_replaces_nothing(identified: Rig, document: dict[str, Any]) -> None:
    assert _doubted(identified, document) == (
        "The rig file's own fit is not to be trusted (max_iterations).",
    )


def test_a_model_other_than_the_one_that_was_identified_is_reported(rig: Rig, identified: Rig) -> None:
    found = gather(RigModel(identified, ()))
    (sentence,) = found.said
    assert sentence.startswith(
        "The rig file was identified with rail_coulomb and tyre_friction and is taken with no friction"
    )
    assert found.doubts == ()
    assert found.model.model.rig.provenance["notes"] == [sentence]
    assert gather(RigModel(identified, SIMTR[::-1])).said == gather(RigModel(rig, ())).said == ()


def test_a_diagnosis_that_did_not_converge_is_reported(identified: Rig) -> None:
    found = gather(RigModel(identified, SIMTR), MOUNT | {"converged": False})
    assert found.doubts == ("The diagnosis did not converge.",)


def test_what_a_sensor_does_is_reported_to_be_left_out(rig: Rig) -> None:
    (sentence,) = gather(RigModel(rig, (*SIMTR, "accel_lag"))).said
    assert sentence.startswith("accel_lag is an error of a sensor")


def test_the_named_effect_joins_with_all_numbers_of_its_fit(identified: Rig) -> None:
    found = with_diagnosis(RigModel(identified, SIMTR), MOUNT)
    assert found.added == ("mount_compliance",)
    assert found.model.effects == (*SIMTR, "mount_compliance")
    for name, value in IDENTIFIED.items():
        assert found.model.rig.parameters[name].value == value
    # The recalibrated baseline makes up for the missing mount by a soft tyre: its numbers are not taken.
    assert found.model.rig.parameters["k_t"].value != MOUNT["baseline"]["parameters"]["k_t"]
    # What was not fitted stays.
    assert found.model.rig.parameters["mu_t"] == identified.parameters["mu_t"]
    states = ExportedModel(found.model).equations.states
    assert states[-1].name == "state_1_mount_deflection"


def test_it_is_said_which_numbers_were_taken(identified: Rig) -> None:
    effect, others, covariance = with_diagnosis(RigModel(identified, SIMTR), MOUNT).said
    assert "mount_compliance = 1.65e-06 m/N, mount_damping = 357 N s/m" in effect
    assert others.startswith("2 more numbers (mu_r, k_t")
    assert "covariance" in covariance


def test_the_covariance_of_the_fit_without_it_is_left_behind(identified: Rig) -> None:
    found = with_diagnosis(RigModel(identified, SIMTR), MOUNT).model.rig
    assert ExportedModel(RigModel(found, SIMTR)).covariance[0] == ()
    assert found.provenance["effects"] == [*SIMTR, "mount_compliance"]
    assert found.provenance["data_sha256"] == "ab12"
    before: Any = found.provenance["fit_before"]
    assert before["data"] == identified.provenance["data"]
    assert "covariance" not in before


def test_a_diagnosis_of_the_contract_alone_gives_the_effect_its_numbers(identified: Rig) -> None:
    short = {
        name: value for name, value in MOUNT.items() if name not in ("identified", "provenance", "converged")
    }
    found = with_diagnosis(RigModel(identified, SIMTR), short)
    assert found.model.rig.parameters["mount_damping"].value == 357.0
    assert found.model.rig.parameters["k_t"] == identified.parameters["k_t"]
    assert "all other numbers are those of the rig file" in " ".join(found.said)


@pytest.mark.parametrize(
    ("document", "said"),
    [(NOTHING, "nothing missing"), (UNKNOWN, "at frame) and that no force there explains")],
)
def test_without_a_named_effect_the_model_stays_as_it_is(
    identified: Rig, document: dict[str, Any], said: str
) -> None:
    found = with_diagnosis(RigModel(identified, SIMTR), document)
    assert (found.model.rig, found.model.effects, found.added) == (identified, SIMTR, ())
    (sentence,) = found.said
    assert said in sentence


@pytest.mark.slow
def test_what_was_learned_for_something_unknown_joins_the_model(identified: Rig) -> None:
    found = with_diagnosis(RigModel(identified, SIMTR), LEARNED)
    assert found.added == ("learned_strut",)
    assert found.model.effects == (*SIMTR, "learned_strut")
    for name, value in (SPANS | COEFFICIENTS | {"mu_r": 0.0301}).items():
        assert found.model.rig.parameters[name].value == value
    assert "edge of the motion" in found.said[-1]
    whole, bare = (
        ExportedModel(RigModel(found.model.rig, effects)) for effects in (found.model.effects, SIMTR)
    )
    assert len(whole.equations.parameters) == len(bare.equations.parameters)
    p = np.array(found.model.rig.parameters.values_of(whole.equations.parameters))
    out_of_balance = []
    for model in (bare, whole):
        x = np.array(resting_state(model))
        rate, u = np.zeros(len(x) - 2), np.array([0.0, 0.0, 1.57, 0.0])
        out_of_balance.append(np.asarray(model.equations.residual(x, rate, u, p))[:2])
    assert float(np.abs(out_of_balance[1] - out_of_balance[0]).max()) > 1.0
    again = with_diagnosis(RigModel(found.model.rig, found.model.effects), LEARNED)
    assert (again.model.rig, again.model.effects) == (found.model.rig, found.model.effects)


def test_an_effect_that_is_in_the_model_is_not_added_again(identified: Rig) -> None:
    whole = (*SIMTR, "mount_compliance")
    found = with_diagnosis(RigModel(identified, whole), MOUNT)
    assert (found.model.rig, found.model.effects, found.added) == (identified, whole, ())


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
    found = with_diagnosis(RigModel(rig, ()), document)
    assert found.model.effects == SIMTR
    assert found.model.rig.parameters["mu_r"].value == 0.031
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


@over("fault", FAULTS)
def test_a_diagnosis_of_another_model_is_refused(identified: Rig, fault: str) -> None:
    document, said = FAULTS[fault]
    with pytest.raises(InputError, match=said):
        with_diagnosis(RigModel(identified, SIMTR), document)


def _written(folder: Path, document: object) -> Path:
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


@pytest.mark.parametrize("document", [MOUNT, NOTHING, UNKNOWN], ids=["effect", "none", "unknown"])
def test_a_diagnosis_is_read_whole(rig: Rig, tmp_path: Path, document: dict[str, Any]) -> None:
    assert read_diagnosis(_written(tmp_path, document), RigModel(rig)) == document


DOCUMENT_FAULTS: dict[str, tuple[object, str]] = {
    "a list": ([], "the document is [], not a table"),
    "another schema": (MOUNT | {"schema": 3}, "schema is 3"),
    "a model.json": ({"schema": 1, "kind": "savgs_ident model"}, "baseline is missing"),
    "no verdict": ({k: v for k, v in MOUNT.items() if k != "verdict"}, "verdict is missing"),
    "no kind": (MOUNT | {"verdict": {"effects": []}}, "verdict.kind is missing"),
    "named nothing": (MOUNT | {"verdict": MOUNT["verdict"] | {"effects": []}}, "of the kind 'effect'"),
    "nothing named": (MOUNT | {"verdict": MOUNT["verdict"] | {"kind": "none"}}, "of the kind 'none'"),
    "an effect that is none": (
        MOUNT | {"verdict": MOUNT["verdict"] | {"effects": ["magic"]}},
        "effects[0] is 'magic'",
    ),
    "a law that is a text": (
        MOUNT | {"verdict": MOUNT["verdict"] | {"another_law": "yes"}},
        "another_law is 'yes'",
    ),
    "values as texts": (MOUNT | {"identified": {"k_t": "soft"}}, "identified.k_t is 'soft'"),
    "a value that is null": (
        MOUNT | {"which": [{"effect": "x", "parameters": {"a": {"value": None, "unit": "m"}}}]},
        "which[0].parameters.a.value is None",
    ),
    "a text for a truth": (MOUNT | {"converged": "yes"}, "converged is 'yes'"),
}  # fmt: skip


@over("fault", DOCUMENT_FAULTS)
def test_what_is_no_diagnosis_is_refused(rig: Rig, tmp_path: Path, fault: str) -> None:
    document, said = DOCUMENT_FAULTS[fault]
    path = _written(tmp_path, document)
    with pytest.raises(InputError) as caught:
        read_diagnosis(path, RigModel(rig))
    assert said in caught.value.what
    assert caught.value.source == str(path)
    assert "savgs-ident diagnose" in caught.value.remedy
