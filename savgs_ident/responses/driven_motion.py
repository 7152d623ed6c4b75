"""The measured motion of a servo axis, and the force that its drive needed for it.

Under closed loop the position hides what a model lacks: the controller makes the carriage follow whatever the
friction. The force shows it. So the measured motion is taken as it is, and the force that a model says it takes is
compared with the force that it did take.

The position is filtered without phase and differentiated centrally. A friction is sharper than the rows are dense,
so that a model is evaluated at every sample, and its force goes through the same low-pass and thinning as the
measured one: both sides of M a + ... = F see the same filter, and it moves no parameter.

The noise of the force comes from the cycles of the reference, which goes through the same one several times. What is
left of the force once inertia and a viscous friction have explained their part holds whatever such a model lacks;
between one cycle and the next that is the same, and the difference is noise, that of the differentiated position
included. Its median size is taken, so that a few instants (reversals, a pulse in one cycle) do not count as noise.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.axis_recording import AxisRecording, read_axis

CUTOFF_HZ = 100.0
"""The position passes up to here [Hz]."""

ROWS_HZ = 100.0
"""Rows per second [Hz]."""

BLOCK_S = 1.0
"""Rows of so much time [s] are left out together, as one test."""

PASSED = 0.8
"""The rows' low-pass, as a share of half their rate."""

CUT_S = 0.2
"""What is cut off at both ends, where the filters have no neighbours [s]."""

SAME = 1e-6
"""Mean square difference between two cycles of the reference, in its variance, up to which they are the same."""

_ORDER = 4
_FEWEST = 100
_NORMAL = 1.4826


@dataclass(frozen=True)
class DrivenMotion:
    """A measured motion of n even samples, and the force of the drive.

    Attributes:
        source: file it came from.
        step: time between samples [s].
        position: filtered, [m], (n,).
        velocity: [m/s], (n,).
        acceleration: [m/s^2], (n,).
        drive: force of the drive [N], (n,).
        period: time in which the reference repeats [s].
        noise: standard deviation of the noise of a row of force [N].
    """

    source: str
    step: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    drive: NDArray[np.float64]
    period: float
    noise: float

    @property
    def every(self) -> int:
        """Samples to a row."""
        return _samples_to_a_row(self.step)

    def rows(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals (..., n) of any unit as rows, (..., m)."""
        return _thinned(signals, self.step)

    @property
    def row_times(self) -> NDArray[np.float64]:
        """Time of each row since the first sample [s], (m,)."""
        edge = round(CUT_S / self.step)
        samples = np.arange(self.position.size, dtype=np.float64)
        return self.step * samples[edge : self.position.size - edge : self.every]

    @property
    def blocks(self) -> NDArray[np.intp]:
        """The block of time that each row belongs to, (m,)."""
        return (np.arange(self.row_times.size) / (BLOCK_S * ROWS_HZ)).astype(np.intp)


def load_motion(path: Path | str) -> DrivenMotion:
    """The motion of a servo axis and the force of its drive, from a MATLAB file (version 5 to 7).

    The file has the column vectors ``t`` [s], ``qm`` (position [m]), ``qg`` (its reference [m]) and ``vir``
    (controller output [V]), and the scalar ``gtau`` (force of the drive per volt [N/V]).

    Raises :class:`InputError` for a file that cannot be read or that lacks one of them, for a recording that is
    sampled too slowly or is too short, and where the reference does not repeat.
    """
    return driven_motion(read_axis(Path(path)))


def driven_motion(recording: AxisRecording) -> DrivenMotion:
    """The motion in a recording.

    Raises :class:`InputError` for one that is sampled too slowly or is too short, and where the reference does not
    repeat.
    """
    step = recording.step
    if step * CUTOFF_HZ > 0.4:
        raise InputError(
            f"is sampled at {1.0 / step:.4g} Hz",
            source=recording.source,
            remedy=f"record at {2.5 * CUTOFF_HZ:.4g} Hz or more",
        )
    if recording.time.size * step < 2.0 * CUT_S + _FEWEST / ROWS_HZ:
        raise InputError("is too short", source=recording.source, remedy="record some seconds at least")
    low_pass = butter(_ORDER, 2.0 * CUTOFF_HZ * step, output="sos")
    position = np.asarray(sosfiltfilt(low_pass, recording.position))
    velocity = np.gradient(position, step)
    acceleration = np.gradient(velocity, step)
    period = period_of(recording)
    noise = _repeatability(recording.force, np.stack([acceleration, velocity], axis=1), period, step)
    return DrivenMotion(
        recording.source, step, position, velocity, acceleration, recording.force, period * step, noise
    )


def period_of(recording: AxisRecording) -> int:
    """Samples in a cycle of the reference.

    Raises :class:`InputError` if it does not repeat.
    """
    x = recording.reference - recording.reference.mean()
    count, variance = x.size, float(np.mean(x**2))
    lags = np.arange(1, count // 2)
    spectrum = np.fft.rfft(x, 2 * count)
    products = np.fft.irfft(np.abs(spectrum) ** 2)[lags]
    squares = np.concatenate([[0.0], np.cumsum(x**2)])
    apart = (squares[count - lags] + squares[count] - squares[lags] - 2.0 * products) / (count - lags)
    left = np.flatnonzero(apart > variance)
    again = np.flatnonzero(apart[left[0] :] < SAME * variance) if left.size else left
    if again.size == 0:
        raise InputError(
            "the reference does not repeat, so that the noise is not known",
            source=recording.source,
            remedy="record two cycles or more",
        )
    near = left[0] + again[0] + np.arange(recording.time.size // 1000 + 2)
    near = near[near < lags.size]
    return int(lags[near[np.argmin(apart[near])]])


def _repeatability(
    force: NDArray[np.float64], inertial: NDArray[np.float64], period: int, step: float
) -> float:
    """Standard deviation of a row's noise [N], from what does not repeat after ``period`` samples."""
    explained, *_ = np.linalg.lstsq(inertial, force, rcond=None)
    left: NDArray[np.float64] = force - inertial @ explained
    apart = _thinned(left[period:] - left[:-period], step)
    return float(_NORMAL * np.median(np.abs(apart)) / np.sqrt(2.0))


def _samples_to_a_row(step: float) -> int:
    return max(round(1.0 / (ROWS_HZ * step)), 1)


def _thinned(signals: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    every = _samples_to_a_row(step)
    if every > 1:
        signals = np.asarray(sosfiltfilt(_low_pass(PASSED / every), signals, axis=-1))
    edge = round(CUT_S / step)
    return signals[..., edge : signals.shape[-1] - edge : every]


@cache
def _low_pass(cutoff: float) -> NDArray[np.float64]:
    """Second-order sections of a low-pass; ``cutoff`` is a share of half the sampling rate."""
    return np.asarray(butter(_ORDER, cutoff, output="sos"))
