"""How well the force repeats: noise, told from what a model misses.

The reference goes through the same cycle several times. What is left of the force once the baseline has explained
its part holds whatever the baseline lacks, friction above all; between one cycle and the next that is the same, and
the difference is noise, that of the differentiated position included. Its median size is taken, so that a few
instants (reversals, a pulse in one cycle) do not count as noise.
"""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.positioner.preparation import Motion
from savgs_ident.diagnosis.positioner.recording import PositionerRecording

SAME = 1e-6
"""Mean square difference between two cycles of the reference, in its variance, up to which they are the same."""

_NORMAL = 1.4826


def period_of(recording: PositionerRecording) -> int:
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


def repeatability_of(recording: PositionerRecording, motion: Motion) -> float:
    """Standard deviation of a row's noise [N].

    Raises :class:`InputError` if the reference does not repeat.
    """
    period = period_of(recording)
    inertial = np.stack([motion.acceleration, motion.velocity], axis=1)
    explained, *_ = np.linalg.lstsq(inertial, recording.force, rcond=None)
    left: NDArray[np.float64] = recording.force - inertial @ explained
    apart = motion.thinned(left[period:] - left[:-period])
    return float(_NORMAL * np.median(np.abs(apart)) / np.sqrt(2.0))
