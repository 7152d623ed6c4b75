"""Dwells of the two masses while their damper fades."""

import numpy as np

from savgs_ident.plants.two_mass import PARAMETERS, closed_form
from savgs_ident.responses.harmonic_response import HarmonicResponse

FREQUENCY = np.array([0.8, 1.2, 1.6, 2.2, 3.0, 4.0, 6.0, 9.0])
ORDER = np.array([4.0, 1.0, 6.0, 0.0, 7.0, 3.0, 5.0, 2.0])
ROAD, NOISY = 0.01, 2e-3


def fading_campaign(damping: np.ndarray, recorded: np.ndarray) -> HarmonicResponse:
    """Dwells of the two masses, each with its own damping [N s/m]."""
    sheet = PARAMETERS.as_dict()
    seen = np.zeros((FREQUENCY.size, 3, 4), complex)
    seen[:, 0, 1] = ROAD
    for d, c in enumerate(damping):
        seen[d, 1:, 1] = ROAD * closed_form(sheet | {"c": c}, FREQUENCY[d : d + 1])[0]
    random, sd = np.random.default_rng(8), NOISY * np.abs(seen[:, :, 1])
    noise = random.standard_normal(seen.shape) + 1j * random.standard_normal(seen.shape)
    seen[:, 1:] += (sd[:, :, None] * noise)[:, 1:]
    return HarmonicResponse(
        tests=tuple(f"dwell_{f}Hz" for f in FREQUENCY),
        channels=("road_height", "body_accel", "susp_deflection"),
        frequency=FREQUENCY,
        frequency_sd=np.zeros(FREQUENCY.size),
        harmonics=seen,
        covariance=sd[:, :, None, None, None] ** 2 * np.ones(4)[:, None, None] * np.eye(2),
        valid=np.ones(seen.shape, bool),
        peak_to_peak=np.zeros(sd.shape),
        peak_to_peak_sd=np.zeros(sd.shape),
        noise_sd=sd,
        periods=np.full(FREQUENCY.size, 20),
        recorded=recorded,
    )
