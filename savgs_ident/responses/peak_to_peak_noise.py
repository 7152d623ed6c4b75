"""What noise does to a measured peak-to-peak: its bias and its standard deviation.

Noise in the harmonics moves the extremes of the waveform, and the largest value of a noisy curve is on
average too large. Both are found by adding the estimated noise to a waveform near the truth, in antithetic
pairs (so that what is linear in the noise cancels in the mean exactly), with fixed draws. The waveform near
the truth has each harmonic shrunk by its share of noise, 1 - E|dX|^2 / |X|^2 or zero: orders that hold
nothing but noise would otherwise hide part of the bias.
"""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.peak_to_peak import peak_to_peak

_PAIRS = 64
_SEED = 20170709


def unbiased_peak_to_peak(
    harmonics: NDArray[np.complex128], covariance: NDArray[np.float64], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Peak-to-peak with the noise bias taken off, and its standard deviation, both (C,).

    ``harmonics`` and ``valid`` (C, n + 1), ``covariance`` (C, n + 1, 2, 2). Where the waveform itself drowns
    in noise only part of the bias can be taken off; the result is never negative.
    """
    seen = peak_to_peak(harmonics, valid)
    draws = np.random.default_rng(_SEED).standard_normal((_PAIRS, harmonics.shape[1], 2))
    draws = np.concatenate([draws, -draws])
    noise, power = np.trace(covariance, axis1=-2, axis2=-1), np.abs(harmonics) ** 2
    likely = harmonics * np.maximum(1.0 - noise / np.where(power > 0.0, power, 1.0), 0.0)
    size, direction = np.linalg.eigh(covariance)
    root = direction * np.sqrt(np.maximum(size, 0.0))[..., None, :]
    shift = np.einsum("ckij,bkj->cbki", root, draws)
    noisy = likely[:, None] + shift[..., 0] + 1j * shift[..., 1]
    again = peak_to_peak(noisy, valid[:, None])
    bias = np.mean(again, axis=1) - peak_to_peak(likely, valid)
    return np.maximum(seen - bias, 0.0), np.std(again, axis=1)
