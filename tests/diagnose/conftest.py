"""The rig as a plant, on a few dwells."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.rig.comparison import rig_plant
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.diagnose.settings import FREE
from savgs_ident.effects.registry import CATALOGUE, MODELS
from savgs_ident.recordings.read import read_campaign
from savgs_ident.responses.estimate import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.measured import MODELLED_CHANNELS
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution

from ..fit.bench import only
from ..relaxed import with_kept_programs

DWELLS = (0.8, 1.85, 2.35, 2.85, 4.0, 5.5)

Measure = Callable[[str], HarmonicResponse]


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="session")
def measure(shared_rig: Path) -> Measure:
    """Responses of the laboratory's labelled campaigns, by name; skips where there are none."""

    def measured(name: str) -> HarmonicResponse:
        file = shared_rig / name / "campaign.csv.gz"
        if not file.exists():
            pytest.skip(f"{file} is not here")
        return estimate_response(read_campaign(file).only(MODELLED_CHANNELS), 9)

    return measured


@pytest.fixture(scope="package")
def plant_and_data(rig: Rig, measure: Measure) -> tuple[RigPlant, Data]:
    """SimTR on six dwells of the nominal campaign, coarsely solved."""
    response = measure("nominal")
    few = only(response, np.isin(np.round(response.frequency, 2), DWELLS))
    settings = PeriodicSettings(nodes=128, adaptations=1)
    return rig_plant(few, rig, CATALOGUE, MODELS["simtr"], FREE, settings=settings)


@pytest.fixture(scope="package")
def start(plant_and_data: tuple[RigPlant, Data]) -> PeriodicSolution:
    """The baseline's motions at the sheet's values."""
    return plant_and_data[0].start({})
