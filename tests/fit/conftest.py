"""The shipped campaign, its fit, and a small problem on a few dwells that many tests share.

Compiling takes most of the time here, so programs are kept from one run of the tests to the next, and what
can share a program does.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse

from ..relaxed import with_kept_programs
from .bench import FEW, Bench, only, true_rig


@pytest.fixture(scope="package", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="package")
def measured(nominal_campaign: Path) -> HarmonicResponse:
    """The response of the shipped campaign, orders 0..9."""
    return estimate_response(load_campaign(nominal_campaign), 9)


@pytest.fixture(scope="package")
def nominal(measured: HarmonicResponse, rig: Rig) -> Fit:
    """The paper's fit of the shipped campaign."""
    return fit_least_squares(measured, RigModel(rig, MODELS["simtr"]), free=FREE)


@pytest.fixture(scope="package")
def few(measured: HarmonicResponse) -> HarmonicResponse:
    """A few dwells of the shipped campaign."""
    return only(measured, np.isin(np.round(measured.frequency, 2), FEW))


@pytest.fixture(scope="package")
def bench(few: HarmonicResponse, rig: Rig) -> Bench:
    """The paper's parameters on few dwells of a rig whose others are known to be as they truly are."""
    return Bench(few, true_rig(rig))
