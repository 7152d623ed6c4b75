"""The response along a frequency sweep: first harmonic of each channel per metre of road."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning


@dataclass(frozen=True)
class SweepResponse:
    """Local first harmonics at W instants of a sweep, for C channels.

    Attributes:
        test: name of the test.
        channels: names of the channels, length C, without the road itself.
        time: middle of each window on the recording's own clock [s], (W,).
        frequency: instantaneous frequency of the road there [Hz], (W,).
        frequency_sd: its standard deviation [Hz], (W,).
        sweep_rate: its rate of change [Hz/s], (W,).
        window_s: duration of each window [s], (W,).
        road_amplitude: of the road's first harmonic [m], (W,).
        response: complex first harmonic of the channel over that of the road [unit/m], (W, C).
        response_sd: standard deviation of its real part, equal to that of its imaginary part, (W, C).
        valid: which entries the sampling of the channel supports, (W, C); the others are 0.
        warnings: what a careful reader would want to know.
    """

    test: str
    channels: tuple[str, ...]
    time: NDArray[np.float64]
    frequency: NDArray[np.float64]
    frequency_sd: NDArray[np.float64]
    sweep_rate: NDArray[np.float64]
    window_s: NDArray[np.float64]
    road_amplitude: NDArray[np.float64]
    response: NDArray[np.complex128]
    response_sd: NDArray[np.float64]
    valid: NDArray[np.bool_]
    warnings: tuple[DataWarning, ...] = ()

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def channel(self, name: str) -> int:
        """The index of a channel on the second axis; raises ``ValueError`` if it is absent."""
        return self.channels.index(name)
