"""The fundamental frequency of a dwell, by nonlinear least squares with its own harmonics.

With the harmonics X_k fitted at a trial frequency f, the residual r changes with f along

    d(t) = Re sum_k 2 pi i k t X_k exp(2 pi i k f t).

The part of d that is orthogonal to the harmonics, d', gives the Gauss-Newton step <d', r> / <d', d'> and, with the
noise density S_k near order k, its variance sum_k w_k S_k / <d', d'>, w_k the share of order k in d.

Channels are grouped by the clock that stamped them (:class:`ClockGroup`), because a rate that differs between clocks
shows in the data as a different fundamental. A constant offset between two clocks does not: it looks like a phase lag
that grows with frequency, as a sensor's delay does. Stamps are therefore taken as true up to their rate.

How many orders can be fitted depends on the sampling of a group. A signal sampled without a filter folds what lies
above the Nyquist frequency back into the band. A periodic one folds onto lines of its own unless the sampling rate
and the fundamental have a small common multiple: orders k and l share a line where (k - l) f is a multiple of the
rate, to within the resolution 1 / T. Up to that order, orders above the Nyquist frequency are fitted as well.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.periodic_fit import (
    PeriodicBasis,
    fit_periodic,
    plan_basis,
    signals,
)

_RESOLUTION = 0.7
_FARTHEST = 1000
_TRUSTED_SHARE = 0.40
_SAMPLES_PER_UNKNOWN = 3
_MOST_ORDERS = 400
_MOST_FOLDED = 150
_NYQUIST_SHARE = 0.45
_GAP = 1.5
_FEWEST_SAMPLES = 16


@dataclass(frozen=True)
class ClockGroup:
    """Channels that share their stamps: ``time`` [s], (N,), and ``values`` [unit], (C, N), all finite.

    ``left_out`` is how many samples of the record were left out as outliers.
    """

    names: tuple[str, ...]
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    left_out: int = 0

    @cached_property
    def rate_hz(self) -> float:
        """Sampling rate between gaps [Hz]."""
        intervals = np.diff(self.time)
        return float(1.0 / np.mean(intervals[intervals < _GAP * np.median(intervals)]))

    @cached_property
    def span_s(self) -> float:
        """Time covered by the samples: one sampling interval longer than from first to last [s]."""
        return float((self.time[-1] - self.time[0]) + 1.0 / self.rate_hz)


def group_by_clock(
    recording: Recording, origin: float, stretch: Mapping[str, float]
) -> tuple[ClockGroup, ...]:
    """The channels of ``recording`` by clock, times counted from ``origin`` [s].

    Samples that are not finite are left out, and so are channels with fewer than 16 others. ``stretch``
    multiplies the time of a channel whose clock runs slow; 1 where it is not named.
    """
    found: list[tuple[NDArray[np.float64], float, list[RecordedChannel]]] = []
    for channel in recording.channels.values():
        factor = stretch.get(channel.name, 1.0)
        for time, other, members in found:
            if other == factor and _same(time, channel.time):
                members.append(channel)
                break
        else:
            found.append((channel.time, factor, [channel]))
    groups = []
    for time, factor, members in found:
        groups += _split_by_gaps(factor * (time - origin), members)
    return tuple(groups)


def _same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return one is other or np.array_equal(one, other)


def _split_by_gaps(time: NDArray[np.float64], members: list[RecordedChannel]) -> list[ClockGroup]:
    """One group for each pattern of usable samples."""
    patterns: dict[bytes, tuple[NDArray[np.bool_], list[RecordedChannel]]] = {}
    for channel in members:
        usable = np.isfinite(channel.values) & np.isfinite(time)
        patterns.setdefault(usable.tobytes(), (usable, []))[1].append(channel)
    return [
        ClockGroup(
            tuple(channel.name for channel in same),
            time[usable],
            np.stack([channel.values[usable] for channel in same]),
        )
        for usable, same in patterns.values()
        if np.count_nonzero(usable) >= _FEWEST_SAMPLES
    ]


def highest_fitted_order(group: ClockGroup, frequency: float) -> int:
    """Orders of ``frequency`` [Hz] to fit: all that the stamps resolve, with samples to spare."""
    by_line = (shared_line(group, frequency) - 1) // 2
    by_count = (group.time.size // _SAMPLES_PER_UNKNOWN - 2) // 2
    by_use = max(int(_NYQUIST_SHARE * group.rate_hz / frequency), _MOST_FOLDED)
    return max(min(by_line, by_count, by_use, _MOST_ORDERS), 0)


def shared_line(group: ClockGroup, frequency: float) -> int:
    """The smallest difference of two orders that fall on one line of the record, given the sampling.

    ``frequency`` [Hz] is their fundamental.
    """
    difference = np.arange(1, max(_FARTHEST, int(2.0 * group.rate_hz / frequency)))
    folds = difference * frequency / group.rate_hz
    apart = np.abs(folds - np.round(folds)) * group.rate_hz * group.span_s
    shared = np.flatnonzero(apart < _RESOLUTION)
    return int(difference[shared[0]]) if shared.size else int(difference[-1])


def highest_valid_order(group: ClockGroup, frequency: float, orders: int) -> int:
    """The highest order of ``frequency`` [Hz] up to ``orders`` well below the Nyquist frequency.

    -1 if not even 1 is.
    """
    resolved = min(int(_TRUSTED_SHARE * group.rate_hz / frequency), highest_fitted_order(group, frequency))
    return min(resolved, orders) if resolved >= 1 else -1


_INPUT_ORDERS = 5
_MOST_STEPS = 12
_PADDING = 8
_CONVERGED = 1e-8


def strongest_line(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, float]:
    """Frequency [Hz] of the strongest line of one signal (N,), to about a tenth of 1 / duration, and its share.

    The share [1] is that of the signal's mean square about its mean.
    """
    even = np.linspace(time[0], time[-1], time.size)
    signal = np.interp(even, time, values)
    signal -= np.mean(signal)
    length = _PADDING * signal.size
    strength = np.abs(np.fft.rfft(signal * np.hanning(signal.size), length))
    frequency = float((np.argmax(strength[1:]) + 1) / (length * (even[1] - even[0])))
    line = np.exp(2j * np.pi * frequency * even)
    return frequency, float(2.0 * abs(np.mean(line * signal)) ** 2 / np.mean(signal**2))


def refine_frequency(group: ClockGroup, channel: int, start: float) -> float:
    """Least-squares fundamental [Hz] of one channel of ``group``, from ``start``.

    Stays at the last trial when the steps lead away from ``start`` by more than a cycle over the record.
    """
    frequency = start
    values = group.values[channel : channel + 1]
    for _ in range(_MOST_STEPS):
        highest = min(_INPUT_ORDERS, highest_fitted_order(group, frequency))
        if highest < 1:
            return frequency
        basis = plan_basis(group.time, frequency, highest)
        fit = fit_periodic(basis, values, highest, 0)
        step, _weight = frequency_step(basis, fit.amplitude, fit.residual)
        if abs(frequency + float(step[0]) - start) * group.span_s > 1.0:
            return frequency
        frequency += float(step[0])
        if abs(float(step[0])) < _CONVERGED * frequency:
            break
    return frequency


def frequency_step(
    basis: PeriodicBasis, amplitude: NDArray[np.complex128], residual: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Newton step [Hz] of each channel and <d', d'> [unit^2/Hz^2], both (C,).

    ``amplitude`` (C, m + 1) are the harmonics, ``residual`` (C, N) that of a fit with these or more.
    """
    order = np.arange(amplitude.shape[1])
    along = basis.time * signals(basis.plan, 2j * np.pi * order * amplitude)
    own = fit_periodic(basis, along, amplitude.shape[1] - 1, 0).residual
    weight = np.sum(own**2, axis=1)
    safe = np.where(weight > 0.0, weight, 1.0)
    return np.where(weight > 0.0, np.sum(own * residual, axis=1) / safe, 0.0), weight


def step_variance(
    amplitude: NDArray[np.complex128], density: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Variance [Hz^2] of each channel's step, (C,), infinite for a channel without information.

    ``amplitude`` and the noise ``density`` [unit^2] have shape (C, m + 1), ``weight`` is <d', d'>.
    """
    share = (np.arange(amplitude.shape[1]) * np.abs(amplitude)) ** 2
    total = np.sum(share, axis=1)
    informative = (total > 0.0) & (weight > 0.0)
    mean_density = np.sum(share * density, axis=1) / np.where(informative, total, 1.0)
    return np.where(informative, mean_density / np.where(informative, weight, 1.0), np.inf)
