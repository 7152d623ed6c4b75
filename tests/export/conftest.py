"""A model with everything that can travel along: covariance, draws, a diagnosis, an effect beyond the rig file."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from ..relaxed import with_kept_programs
from .diagnoses import MOUNT

ESTIMATED = ("mu_r", "mu_t", "ydot_Hth", "c_sd", "k_t")
DRAWS = 7


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="package")
def identified(rig: Rig) -> Rig:
    """The shipped rig, as if it had been identified."""
    size = np.array(rig.parameters.values_of(ESTIMATED))
    random = np.random.default_rng(5)
    root = random.standard_normal((size.size, size.size)) * 0.01 * size[:, None]
    values = {name: value * 1.01 for name, value in zip(ESTIMATED, size.tolist(), strict=True)}
    provenance = {
        "effects": list(MODELS["simtr"]),
        "free": ["mu_r", "c_sd"],
        "trusted": True,
        "status": "converged",
        "data": "Prüfstand/campaign.csv.gz",
        "before": {"mu_r": 0.03},
        "covariance": {"names": list(ESTIMATED), "matrix": (root @ root.T).tolist()},
    }
    return replace(rig, parameters=rig.parameters.with_values(values), provenance=provenance)


@pytest.fixture(scope="package")
def model(identified: Rig) -> ExportedModel:
    """That rig with friction and a mount that gives way, whose parameters are not in the rig's file."""
    random = np.random.default_rng(6)
    effects = (*MODELS["simtr"], "mount_compliance")
    samples = {
        name: value * (1.0 + 0.01 * random.standard_normal(DRAWS))
        for name, value in zip(ESTIMATED, identified.parameters.values_of(ESTIMATED), strict=True)
    }
    return ExportedModel(RigModel(identified, effects), samples, MOUNT)
