"""Rig file, posterior and diagnosis of different runs: what does not belong together is told."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import MODELS
from savgs_ident.export.gather import gather

from .diagnoses import MOUNT, NOTHING, UNKNOWN

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
    found = gather(identified, SIMTR, posterior=posterior, count=20)
    assert (found.said, found.doubts) == ((), ())
    assert found.model.rig == identified
    assert {name: values.shape for name, values in found.model.samples.items()} == {
        "mu_r": (20,),
        "k_t": (20,),
    }


def test_a_posterior_without_the_diagnosed_effect_is_told(identified: Rig, posterior: Path) -> None:
    found = gather(identified, SIMTR, MOUNT, posterior)
    doubt = found.doubts[0]
    assert "of a model without mount_compliance" in doubt
    assert "no draws of mount_compliance, mount_damping" in doubt
    assert found.model.rig.provenance["notes"] == [*found.said, *found.doubts]


@pytest.mark.parametrize("count", [None, 1, 2])
def test_a_posterior_that_lies_elsewhere_is_told(identified: Rig, posterior: Path, count: int | None) -> None:
    """However few of its draws travel along."""
    moved = replace(identified, parameters=identified.parameters.with_values({"k_t": 2.0e5}))
    found = gather(moved, SIMTR, posterior=posterior, count=count)
    assert found.model.samples["k_t"].size == (count or 200)
    (doubt,) = found.doubts
    assert "lies elsewhere than the model: k_t is more than 6 standard deviations off" in doubt


def test_a_fit_that_was_not_trusted_is_told_and_travels_along(identified: Rig) -> None:
    bad = replace(
        identified, provenance={**identified.provenance, "trusted": False, "status": "max_iterations"}
    )
    found = gather(bad, SIMTR)
    assert found.doubts == ("The rig file's own fit is not to be trusted (max_iterations).",)
    assert found.model.rig.provenance["notes"] == list(found.doubts)


def _doubted(identified: Rig, diagnosis: dict[str, Any], *without: str) -> tuple[str, ...]:
    """Doubts of a model whose fit was not trusted, with a diagnosis; ``without`` some entries of its provenance."""
    provenance = {**identified.provenance, "trusted": False, "status": "max_iterations"}
    told = {name: value for name, value in provenance.items() if name not in without}
    return gather(replace(identified, provenance=told), SIMTR, diagnosis).doubts


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


def test_a_model_other_than_the_one_that_was_identified_is_told(rig: Rig, identified: Rig) -> None:
    found = gather(identified, ())
    (sentence,) = found.said
    assert sentence.startswith(
        "The rig file was identified with rail_coulomb and tyre_friction and is taken with no friction"
    )
    assert found.doubts == ()
    assert found.model.rig.provenance["notes"] == [sentence]
    assert gather(identified, SIMTR[::-1]).said == gather(rig, ()).said == ()


def test_a_diagnosis_that_did_not_converge_is_told(identified: Rig) -> None:
    found = gather(identified, SIMTR, MOUNT | {"converged": False})
    assert found.doubts == ("The diagnosis did not converge.",)


def test_what_a_sensor_does_is_told_to_be_left_out(rig: Rig) -> None:
    (sentence,) = gather(rig, (*SIMTR, "accel_lag")).said
    assert sentence.startswith("accel_lag is an error of a sensor")
