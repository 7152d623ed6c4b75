"""From a recording to motion and force on rows.

The position is filtered without phase and differentiated centrally. A law of friction is sharper than the rows are
dense, so that it is evaluated at every sample and goes through the same low-pass and thinning as the measured
force: both sides of M a + ... = F see the same filter, and it moves no parameter.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.positioner.recording import PositionerRecording

CUTOFF_HZ = 100.0
"""The position passes up to here [Hz]."""

ROWS_HZ = 100.0
"""Rows per second [Hz]."""

PASSED = 0.8
"""The rows' low-pass, as a share of half their rate."""

CUT_S = 0.2
"""What is cut off at both ends, where the filters have no neighbours [s]."""

_ORDER = 4
_FEWEST = 100


@dataclass(frozen=True)
class Motion:
    """Filtered motion at the n samples of a recording.

    Attributes:
        step: time between samples [s].
        position: [m], (n,).
        velocity: [m/s], (n,).
        acceleration: [m/s^2], (n,).
    """

    step: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]

    @property
    def every(self) -> int:
        """Samples to a row."""
        return max(round(1.0 / (ROWS_HZ * self.step)), 1)

    def thinned(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals (..., n) of any unit on the rows, (..., m)."""
        if self.every > 1:
            signals = np.asarray(sosfiltfilt(_low_pass(PASSED / self.every), signals, axis=-1))
        edge = round(CUT_S / self.step)
        return signals[..., edge : signals.shape[-1] - edge : self.every]


def motion_of(recording: PositionerRecording) -> Motion:
    """The motion in a recording.

    Raises :class:`InputError` for one that is too slow or too short, or where nothing moves.
    """
    step = recording.step
    if step * CUTOFF_HZ > 0.4:
        raise InputError(
            f"sampled at {1.0 / step:.4g} Hz", source=recording.source,
            remedy=f"record at {2.5 * CUTOFF_HZ:.4g} Hz or more",
        )  # fmt: skip
    if recording.time.size * step < 2.0 * CUT_S + _FEWEST / ROWS_HZ:
        raise InputError("too short", source=recording.source, remedy="record some seconds at least")
    position = np.asarray(
        sosfiltfilt(butter(_ORDER, 2.0 * CUTOFF_HZ * step, output="sos"), recording.position)
    )
    velocity = np.gradient(position, step)
    return Motion(step, position, velocity, np.gradient(velocity, step))


@cache
def _low_pass(cutoff: float) -> NDArray[np.float64]:
    """Second-order sections of a low-pass; ``cutoff`` is a share of half the sampling rate."""
    return np.asarray(butter(_ORDER, cutoff, output="sos"))
