"""Measured periodic responses as complex harmonics with their covariance.

Convention: a channel x(t) of a dwell with fundamental f is

    x(t) = X_0 + Re sum_{k=1..n} X_k exp(2 pi i k f t),

with the time origin of every dwell moved so that the fundamental of the road height is real and positive.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning


@dataclass(frozen=True)
class HarmonicResponse:
    """Harmonics of D dwells, C channels, orders 0..n.

    Attributes:
        tests: names of the dwells, length D, sorted by frequency.
        channels: names of the channels, length C.
        frequency: measured fundamental [Hz], (D,).
        frequency_sd: its standard deviation [Hz], (D,).
        harmonics: complex amplitudes [unit of the channel], (D, C, n + 1); order 0 is the (real) mean.
        covariance: covariance of (Re, Im) [unit^2], (D, C, n + 1, 2, 2).
        valid: which entries the sampling of the channel supports, (D, C, n + 1); the others are 0.
        peak_to_peak: of the harmonic reconstruction with valid orders, noise bias removed [unit], (D, C).
        peak_to_peak_sd: its standard deviation [unit], (D, C).
        noise_sd: standard deviation of one sample of what does not repeat [unit], (D, C).
        periods: whole periods in the record, (D,).
        warnings: what a careful reader would want to know.
        covariance_dof: degrees of freedom of the noise level behind ``covariance``, (D, C, n + 1): its
            relative variance is 2 / dof. None where the covariance is known rather than estimated. A
            quadratic form weighted with the inverse of an estimated covariance is too large by
            dof / (dof - 2) on average.
    """

    tests: tuple[str, ...]
    channels: tuple[str, ...]
    frequency: NDArray[np.float64]
    frequency_sd: NDArray[np.float64]
    harmonics: NDArray[np.complex128]
    covariance: NDArray[np.float64]
    valid: NDArray[np.bool_]
    peak_to_peak: NDArray[np.float64]
    peak_to_peak_sd: NDArray[np.float64]
    noise_sd: NDArray[np.float64]
    periods: NDArray[np.int64]
    warnings: tuple[DataWarning, ...] = ()
    covariance_dof: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def orders(self) -> int:
        """The highest order held, n."""
        return int(self.harmonics.shape[2]) - 1

    def channel(self, name: str) -> int:
        """The index of a channel on the second axis; raises ``ValueError`` if it is absent."""
        return self.channels.index(name)
