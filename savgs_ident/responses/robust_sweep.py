"""A sweep without its spikes and dropouts.

The outliers of a channel (:mod:`outliers`) are found in the residual of its local fits and left out of others. The
steps of a friction, which have more orders than the fits, are found again at the same phase of the periods nearby.

Outliers of the driven channel come first, because they move the phase that all fits follow. Median filters make first
guesses of the phase, the one that fits the filtered road best is taken, then outliers and phase are found in turn
until the same samples stand out. The phase that is used is that of the recorded samples without the outliers; a sweep
in which no sample stands out keeps its plain response, number for number.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.recording import RecordedChannel
from savgs_ident.responses.dwell_fit import smallest_density
from savgs_ident.responses.outliers import WaveformSamples, can_leave_out, find_outliers
from savgs_ident.responses.sweep_fit import WindowBasis, local_residual, window_bases
from savgs_ident.responses.sweep_phase import RoadPhase, follow_road

_FILTERS = (11, 5, 1)
"""Samples of the median filters: dropouts of five and of two samples do not pass, and everything does."""
_MOST_REFITS = 4
_ALIKE, _DRIFT = 3.0, 0.01
"""Periods to either side that have nearly the same waveform, and how far [periods] its features move meanwhile."""
_OFF_FILTERED = 0.1
"""How far a sample before or after the windows may be off the filtered road, in peak-to-peak values."""


def follow_road_robustly(
    test: str, road: RecordedChannel, cycles: float, overlap: float, source: str
) -> tuple[RoadPhase, NDArray[np.bool_]]:
    """Phase of the road as :func:`follow_road` has it, and which of its samples are outliers, (N,).

    Raises :class:`InputError` as :func:`follow_road` does.
    """
    smooth, phase = _first_phase(test, road, cycles, overlap, source)
    out = np.zeros(road.values.size, dtype=np.bool_)
    for _ in range(_MOST_REFITS):
        before, out = out, _outliers_of_road(road, smooth, phase)
        phase = follow_road(test, without(road, out), cycles, overlap, source)
        if np.array_equal(before, out):
            break
    return phase, out


def _first_phase(
    test: str, road: RecordedChannel, cycles: float, overlap: float, source: str
) -> tuple[RecordedChannel, RoadPhase]:
    """The median-filtered road that a phase follows best, and this phase."""
    guesses = []
    for width in _FILTERS:
        smooth = replace(road, values=median_filter(road.values, width))
        try:
            guesses.append((smooth, follow_road(test, smooth, cycles, overlap, source)))
        except InputError as error:
            refusal = error
    if not guesses:
        raise refusal
    return min(guesses, key=lambda guess: float(np.mean(relative_miss(guess[1]))))


def relative_miss(phase: RoadPhase) -> NDArray[np.float64]:
    """What the fit leaves of the road in each window, rms over amplitude [1], (W,)."""
    miss = np.array([local.miss for local in phase.local])
    size = np.array([abs(local.amplitude) for local in phase.local])
    relative: NDArray[np.float64] = np.divide(miss, size, out=np.full_like(miss, np.inf), where=size > 0.0)
    return relative


def _outliers_of_road(road: RecordedChannel, smooth: RecordedChannel, phase: RoadPhase) -> NDArray[np.bool_]:
    """The outliers within the windows, and before and after them what is far off the ``smooth`` road, (N,)."""
    outside = (road.time < phase.windows[0, 0]) | (road.time > phase.windows[-1, 1])
    far = np.abs(road.values - smooth.values) > _OFF_FILTERED * np.ptp(smooth.values)
    out: NDArray[np.bool_] = find_channel_outliers(road, phase) | (outside & far)
    return out


def find_channel_outliers(channel: RecordedChannel, road: RoadPhase) -> NDArray[np.bool_]:
    """Which samples of a channel within the windows are outliers, (N,).

    There are none where the samples left would not determine the fits.
    """
    out = np.zeros(channel.values.size, dtype=np.bool_)
    bases = window_bases(channel.time, road)
    fitted = _fitted(out.size, bases)
    if not np.any(fitted):
        return out
    time, values = channel.time[fitted], channel.values[fitted]

    def refit(some: NDArray[np.bool_]) -> NDArray[np.float64]:
        everywhere = np.zeros_like(out)
        everywhere[fitted] = some
        return local_residual(channel.values, bases, everywhere)[fitted]

    floor = float(np.sqrt(smallest_density(values[None])[0]))
    samples = WaveformSamples(time, values, road.periods_at(time), floor, _ALIKE, _DRIFT)
    none = np.zeros(time.size, dtype=np.bool_)
    try:
        out[fitted] = find_outliers(samples, refit(none), none, refit)
    except np.linalg.LinAlgError:
        return out
    return out


def _fitted(count: int, bases: tuple[WindowBasis, ...]) -> NDArray[np.bool_]:
    """Which of ``count`` samples are in a window."""
    fitted = np.zeros(count, dtype=np.bool_)
    for basis in bases:
        fitted[basis.nearest] = True
    return fitted


def without(channel: RecordedChannel, out: NDArray[np.bool_]) -> RecordedChannel:
    """The channel without the samples that are ``out``, (N,); the whole of it where they are too many."""
    if not can_leave_out(out):
        return channel
    return replace(channel, time=channel.time[~out], values=channel.values[~out])
