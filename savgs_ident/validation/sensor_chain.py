"""From the truth to what a logger writes: noise, filters, converters, and instants that jitter.

Without colour, corner and bits, the noise is white and nothing else happens to the truth.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

RANGES = (0.05, 50.0, 0.1)
"""Largest road [m], acceleration [m/s^2] and deflection [m] that the logger's converters read."""


@dataclass(frozen=True)
class Sensors:
    """What the sensors add to the truth, as the rig's sheet says.

    Attributes:
        rate: sampling rate [Hz].
        jitter: rms error of the sampling instants [s]; the stamps give the true ones.
        accel: rms noise of the acceleration [m/s^2].
        deflection: of the deflection [m].
        road: of the road's height [m].
        hunting: rms by which a drive that holds the link moves it to and fro [rad].
        counts: of the link's encoder per turn of the link [1].
        colour: correlation of the noise from one sample to the next [1]; 0 for white noise.
        phase: angle by which the road's signal leads the road [rad].
        corner: of the logger's anti-aliasing filters, Butterworth of second order [Hz]; 0 for none.
        bits: of the logger's converters, over the ranges of :data:`RANGES`; 0 for none.
    """

    rate: float = 500.0
    jitter: float = 4e-5
    accel: float = 0.05
    deflection: float = 1e-4
    road: float = 1e-5
    hunting: float = 2.5e-6
    counts: float = 65536.0 * 40.0
    colour: float = 0.0
    phase: float = 0.0
    corner: float = 0.0
    bits: int = 0

    def filtered(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """What the anti-aliasing filters make of frequencies [Hz]."""
        ratio = 1j * frequency / self.corner if self.corner > 0.0 else np.zeros_like(frequency)
        return np.asarray(1.0 / (1.0 + np.sqrt(2.0) * ratio + ratio**2), dtype=np.complex128)

    def noise(self, shape: tuple[int, int], random: np.random.Generator) -> NDArray[np.float64]:
        """Noise of unit variance: a row a channel, each of the first order of autoregression with ``colour``."""
        white = random.standard_normal(shape)
        if self.colour == 0.0:
            return white
        drive = np.sqrt(1.0 - self.colour**2)
        coloured: NDArray[np.float64] = lfilter([drive], [1.0, -self.colour], white, axis=-1)
        return coloured

    def converted(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Road, acceleration and deflection, (3, n), as the converters read them."""
        if self.bits == 0:
            return values
        ranges = np.array(RANGES)[:, None]
        count = ranges / 2.0 ** (self.bits - 1)
        return np.clip(count * np.round(values / count), -ranges, ranges - count)
