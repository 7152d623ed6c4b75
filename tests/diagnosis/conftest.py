"""The problem of the rig on a few dwells."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.diagnosis.public import SIMTR
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.observations import Data
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.model import FREE
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.compared_tests import recorded_names
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution

from ..fit.bench import only
from ..relaxed import with_kept_programs

DWELLS = (0.8, 1.85, 2.35, 2.85, 4.0, 5.5)
"""Dwells that are enough for a whole diagnosis [Hz]: all of a campaign take five times as long."""

COARSE = replace(SIMTR, periodic=PeriodicSettings(nodes=128, adaptations=1))
"""Settings that are enough for these dwells: tests that share them share compiled programs, too."""

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
        return estimate_response(load_campaign(file).only(recorded_names(QuarterCar)), 9)

    return measured


@pytest.fixture(scope="session")
def measure_few(measure: Measure) -> Measure:
    """Their responses in few dwells."""

    def measured(name: str) -> HarmonicResponse:
        return _few(measure(name))

    return measured


def _few(response: HarmonicResponse) -> HarmonicResponse:
    return only(response, np.isin(np.round(response.frequency, 2), DWELLS))


def rig_problem(
    measured: HarmonicResponse,
    rig: Rig,
    catalogue: Mapping[str, Effect],
    settings: PeriodicSettings | None = None,
) -> tuple[DwellProblem, Data]:
    """The problem of SimTR and a response of the rig."""
    return dwell_problem(
        measured,
        QuarterCar(damper_curve(rig)),
        rig.parameters,
        catalogue,
        MODELS["simtr"],
        FREE,
        settings=settings,
        models=MODELS.values(),
    )


@pytest.fixture(scope="package")
def plant_and_data(rig: Rig, measure: Measure) -> tuple[DwellProblem, Data]:
    """SimTR on six dwells of the nominal campaign, coarsely solved."""
    return rig_problem(_few(measure("nominal")), rig, CATALOGUE, COARSE.periodic)


@pytest.fixture(scope="package")
def start(plant_and_data: tuple[DwellProblem, Data]) -> PeriodicSolution:
    """The baseline's motions at the sheet's values."""
    return plant_and_data[0].start({})
