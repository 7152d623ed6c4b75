"""A fit whose truth is known: measurements that scatter about a prediction as their covariance says."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.fit.estimate import Estimate
from savgs_ident.fit.identified import Verdict
from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak

from .diagnosis_synthetic import KINDS, synthetic_diagnosis
from .posterior_synthetic import nominal_response

ORDERS = 5
FREQUENCY = np.array([0.5, 1.0, 1.5, 2.0, 2.35, 3.0, 4.5, 6.0])
CHANNELS = ("road_height", "sprung_accel", "susp_deflection")
NOISE = (1e-7, 4e-3, 1e-5)


def resonance(frequency: NDArray[np.float64], damping: float) -> NDArray[np.complex128]:
    """Acceleration [m/s^2] and deflection [m] of a mass on a spring, (D, 2, ORDERS + 1), orders falling."""
    omega, natural, height = 2.0 * np.pi * frequency, 2.0 * np.pi * 2.2, 0.01375
    mass = (natural**2 + 2j * damping * natural * omega) / (
        natural**2 - omega**2 + 2j * damping * natural * omega
    )
    first = np.stack([-(omega**2) * mass, 1.0 - mass], axis=1) * height
    fall = np.array([0.0, *(0.3 ** np.arange(ORDERS))])
    return np.asarray(first[:, :, None] * fall)


@pytest.fixture(scope="session")
def measured() -> HarmonicResponse:
    """Eight dwells of a resonance with correlated noise of the real and imaginary parts."""
    rng = np.random.default_rng(20170912)
    d = FREQUENCY.size
    clean = np.zeros((d, 3, ORDERS + 1), dtype=np.complex128)
    clean[:, 0, 1] = 0.01375
    clean[:, 1:] = resonance(FREQUENCY, 0.3)
    covariance = np.zeros((d, 3, ORDERS + 1, 2, 2))
    covariance[:, :, 1:] = np.array([[1.0, 0.5], [0.5, 2.0]])
    covariance *= (np.array(NOISE) ** 2)[None, :, None, None, None]
    shocks = rng.standard_normal((d, 3, ORDERS, 2))
    factor = np.linalg.cholesky(covariance[:, :, 1:])
    moved = np.einsum("dckij,dckj->dcki", factor, shocks)
    clean[:, :, 1:] += moved[..., 0] + 1j * moved[..., 1]
    clean[:, 0, 1] = np.abs(clean[:, 0, 1])
    valid = np.ones(clean.shape, dtype=np.bool_)
    return HarmonicResponse(
        tests=tuple(f"dwell_{f:.2f}Hz" for f in FREQUENCY),
        channels=CHANNELS,
        frequency=FREQUENCY.copy(),
        frequency_sd=np.full(d, 1e-6),
        harmonics=clean,
        covariance=covariance,
        valid=valid,
        peak_to_peak=peak_to_peak(clean, valid),
        peak_to_peak_sd=np.tile(3.0 * np.array(NOISE), (d, 1)),
        noise_sd=np.tile(np.array(NOISE), (d, 1)),
        periods=np.full(d, 10),
    )


@pytest.fixture(scope="session")
def fit(measured: HarmonicResponse, rig: Rig) -> Fit:
    """A converged fit that predicts the truth behind ``measured``."""
    estimates = (
        Estimate("mu_r", 0.03002, 0.00012, 0.00008, "1", True, 0.03, 0.0),
        Estimate("c_sd", 5386.0, 9.7, 6.1, "N s/m", True, 5792.0, 463.36),
        Estimate("k_t", 264100.0, 1300.0, 900.0, "N/m", False, 275000.0, 13750.0),
    )
    covariance = np.diag([each.stderr**2 for each in estimates])
    covariance[0, 1] = covariance[1, 0] = -0.5 * 0.00012 * 9.7
    used = np.ones((FREQUENCY.size, 2, ORDERS + 1), dtype=np.bool_)
    used[:, :, 0] = False
    return Fit(
        estimated=RigModel(rig, ("rail_coulomb", "tyre_friction")).with_values(
            {e.name: e.value for e in estimates}
        ),
        estimates=estimates,
        covariance=covariance,
        chi2=163.0,
        dof=158,
        prior_chi2=0.6,
        status=Status.CONVERGED,
        dwell_status=(Status.CONVERGED,) * FREQUENCY.size,
        verdict=Verdict(True, ("The data identify all free parameters.",)),
        measured=measured,
        orders=ORDERS,
        used=used,
        predicted=resonance(FREQUENCY, 0.3),
        frictionless=resonance(FREQUENCY, 0.1),
        frictionless_status=(Status.CONVERGED,) * FREQUENCY.size,
        as_given=resonance(FREQUENCY, 0.33),
        starts=((163.0, Status.CONVERGED), (163.1, Status.CONVERGED)),
        quantity="harmonics",
        wall_s=4.2,
    )


@pytest.fixture(scope="session")
def mass_on_spring() -> Callable[[NDArray[np.float64], float], NDArray[np.complex128]]:
    """The responses behind ``measured``, at any frequency [Hz] and damping ratio."""
    return resonance


@pytest.fixture(scope="package")
def by_kind(nominal_campaign: Path) -> dict[str, Diagnosis]:
    """A synthetic diagnosis of each kind."""
    measured = nominal_response(nominal_campaign)
    return {kind: synthetic_diagnosis(measured, kind) for kind in KINDS}


@pytest.fixture(scope="package")
def diagnosis(by_kind: dict[str, Diagnosis]) -> Diagnosis:
    """The one that names an effect."""
    return by_kind["effect"]
