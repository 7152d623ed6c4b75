"""Rig file, posterior and diagnosis of different runs: what does not belong together is told."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import MODELS
from savgs_ident.export.gather import gather

from .diagnoses import MOUNT

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
    # With a diagnosis the numbers are of another fit.
    assert gather(bad, SIMTR, MOUNT).doubts == ()


def test_a_diagnosis_that_did_not_converge_is_told(identified: Rig) -> None:
    found = gather(identified, SIMTR, MOUNT | {"converged": False})
    assert found.doubts == ("The diagnosis did not converge.",)


def test_what_a_sensor_does_is_told_to_be_left_out(rig: Rig) -> None:
    (sentence,) = gather(rig, (*SIMTR, "accel_lag")).said
    assert sentence.startswith("accel_lag is an error of a sensor")
