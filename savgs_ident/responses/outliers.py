"""Spikes and dropouts: samples of a record that lie far off the waveform that all others follow.

The record may be periodic (a dwell), nearly so over a few periods (a sweep), or at rest (a standstill). A fit
spreads the error of one sample over the record, so that a few wrong samples hide each other and look like noise. The
samples farthest off the fit are therefore left out first, the fit is repeated without them, and so on until no sample
is left that is an outlier (:func:`find_outliers`). A sample is one where the residual r of the fit

- exceeds 8 robust standard deviations, s = 1.4826 median |r - median r|, or 6 once the channel has an outlier; s is
  taken no smaller than the sensor's quantisation and 1e-4 of the waveform's standard deviation,
- stands alone: |r| exceeds a fifth of its peak, and half of the distance above, in a run of at most five samples, or
  of samples with one and the same value (a sensor that sticks or drops to zero),
- does not recur: at the same phase of most other periods, in a sweep of those nearby, |r| is a third or less; nor is
  it more there in a few periods than chance allows, unless r is a tenth of the waveform. A flank that is shorter than
  the time from one sample to the next is met in some periods only.

Gaussian noise exceeds 8 s once in 1e15 samples. What a mechanism does, such as a step of the friction that comes
a little early or late or has orders beyond those fitted, recurs at its phase; a transient or a rattle lasts.

In a dwell (:func:`fit_robust_dwell`) the outliers of every channel are found in the residual of the plain fit and
left out of another fit, until the same samples stand out of two fits in turn: outliers of the driven channel move
the fundamental, which moves the residuals of all channels. A dwell in which no sample stands out keeps the plain
fit, number for number. In a standstill (:func:`estimate_standstill_noise`) the fit is a straight line. The fits of a
sweep are in :mod:`sweeps`.

Reference: P. J. Huber, E. M. Ronchetti, Robust Statistics (2009), sections 5.1 and 7.9.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtrc

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.dwell_fit import DwellFit, fit_dwell, smallest_density
from savgs_ident.responses.fundamental import ClockGroup
from savgs_ident.responses.periodic_fit import fit_resolved, plan_basis, signals

FARTHEST = 8.0
"""Distance from the fit [robust standard deviations] beyond which a sample may be an outlier."""

FARTHEST_AGAIN = 6.0
"""The same in a channel in which outliers were found."""

MOST_LEFT_OUT = 0.2
"""Share of the samples up to which outliers are left out; with more, which samples are wrong is not known."""

_MANY = 0.05
"""Share of outlying samples above which a sensor is not to be trusted."""
_NORMAL = 1.4826
"""Standard deviation of a normal variable over its median absolute deviation."""
_LEAST_SHARE = 1e-4
"""Least standard deviation of a sample, as a share of the waveform's: deviations below matter to no estimate."""
_LONGEST_RUN, _BRIDGED = 5, 2
"""Samples of an isolated run, and those of a gap that belongs to it."""
_EDGE = 0.5
"""Share of the distance from which on neighbours of an outlier are left out with it."""
_PHASE_SAMPLES, _RECURRING, _ABOVE_RECURRING, _ECHO = 2.5, 0.6, 3.0, 0.6
"""Reach [samples] of a phase; quantile of the other periods; how far an outlier exceeds it, less in few periods."""
_BY_CHANCE, _SMALL = 1e-3, 0.1
"""Probability of finding as much at one phase; largest residual of a flank, as a share of the waveform's range."""
_PEAK_ABOVE, _LEVEL_RATIO = 5.0, 0.6
"""Peak of a run over the level that bounds it, and the ratio of one level to the next."""
_MOST_ROUNDS = 40


@dataclass(frozen=True)
class WaveformSamples:
    """One channel that follows a waveform.

    Attributes:
        time: [s], (N,).
        values: [unit], (N,).
        phase: of the fundamental [periods], (N,); None for a record at rest, in which nothing recurs.
        floor: least standard deviation of a sample [unit].
        alike: how many periods to either side have nearly the same waveform.
        drift: how far [periods] its features move within these.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    phase: NDArray[np.float64] | None
    floor: float
    alike: float = inf
    drift: float = 0.0


Refit = Callable[[NDArray[np.bool_]], NDArray[np.float64]]
"""From the samples to leave out, (N,), to the residual of all samples [unit], (N,)."""


def find_outliers(
    samples: WaveformSamples, residual: NDArray[np.float64], out: NDArray[np.bool_], refit: Refit
) -> NDArray[np.bool_]:
    """Which samples are outliers, (N,); ``residual`` [unit], (N,), is that of a fit without those in ``out`` (N,).

    Raises :class:`numpy.linalg.LinAlgError` when the samples left do not determine the fit.
    """
    out = out.copy()
    for _ in range(_MOST_ROUNDS):
        found = largest_outliers(samples, residual, out)
        if not np.any(found):
            break
        out |= found
        if np.mean(out) > MOST_LEFT_OUT:
            return out
        residual = refit(out)
    return out & (np.abs(residual) > _EDGE * FARTHEST_AGAIN * _scale(samples, residual[~out]))


def largest_outliers(
    samples: WaveformSamples, residual: NDArray[np.float64], out: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The outliers of about the largest size among those not yet ``out``, (N,).

    A run is what exceeds a fifth of its peak, because the fit leaves a share of a large outlier beside it, and half
    of the distance from which on a sample counts.
    """
    size = np.where(out, 0.0, np.abs(residual))
    smallest = (FARTHEST_AGAIN if np.any(out) else FARTHEST) * _scale(samples, residual[~out])
    lowest = _EDGE * smallest
    found = np.zeros_like(out)
    for level in _levels(float(np.max(size)), smallest, lowest):
        clean = level / _PEAK_ABOVE if level > lowest else 0.0
        for run in _runs(size, level, clean):
            peak = float(np.max(size[run]))
            counts = peak > smallest and peak / _PEAK_ABOVE <= level
            if counts and _is_outlier(samples, size, out, run):
                found[run] = size[run] > level
        if np.any(found):
            break
    return found


def _levels(largest: float, smallest: float, lowest: float) -> list[float]:
    """Levels [unit] from a fifth of the ``largest`` residual to the ``lowest``; none if it is below ``smallest``."""
    if largest <= smallest:
        return []
    levels = [largest / _PEAK_ABOVE]
    while levels[-1] > lowest:
        levels.append(levels[-1] * _LEVEL_RATIO)
    return [*levels[:-1], lowest]


def _is_outlier(
    samples: WaveformSamples, size: NDArray[np.float64], out: NDArray[np.bool_], run: slice
) -> bool:
    """Whether a run is short or constant, and does not recur."""
    left_out_nearby = np.count_nonzero(out[max(run.start - _LONGEST_RUN, 0) : run.stop + _LONGEST_RUN])
    length = run.stop - run.start
    short = length <= _LONGEST_RUN and length + left_out_nearby <= 2 * _LONGEST_RUN
    constant = bool(np.all(samples.values[run] == samples.values[run.start]))
    return (short or constant) and not _recurs(samples, size, run)


def _scale(samples: WaveformSamples, residual: NDArray[np.float64]) -> float:
    """Robust standard deviation [unit] of a sample."""
    spread = _NORMAL * float(np.median(np.abs(residual - np.median(residual))))
    middle = np.median(samples.values)
    waveform = _NORMAL * float(np.median(np.abs(samples.values - middle)))
    return max(spread, samples.floor, _LEAST_SHARE * waveform)


def _runs(size: NDArray[np.float64], level: float, clean: float) -> list[slice]:
    """Runs of samples whose ``size`` exceeds ``level``; gaps of two are bridged unless all in them is ``clean``."""
    places = np.flatnonzero(size > level)
    if places.size == 0:
        return []
    breaks = [
        i + 1
        for i, (a, b) in enumerate(pairwise(places))
        if b - a > _BRIDGED + 1 or (b - a > 1 and np.all(size[a + 1 : b] < clean))
    ]
    edges = [0, *breaks, places.size]
    return [slice(int(places[a]), int(places[b - 1]) + 1) for a, b in pairwise(edges)]


def _recurs(samples: WaveformSamples, size: NDArray[np.float64], run: slice) -> bool:
    """Whether residuals like that of the run are found at its phase in other periods.

    The residual that an outlier leaves in the n other periods of a fit is 1 / n of its own at most: where n is small,
    the factor is.
    """
    if samples.phase is None:
        return False
    time, phase = samples.time, samples.phase
    peak = run.start + int(np.argmax(size[run]))
    before = int(min(phase[peak] - phase[0], samples.alike))
    after = int(min(phase[-1] - phase[peak], samples.alike))
    shifts = np.concatenate([np.arange(-before, 0), np.arange(1, after + 1)])
    if shifts.size == 0:
        return True
    there = phase[peak] + shifts[:, None] + samples.drift * np.array([-1.0, 1.0])
    reach = _PHASE_SAMPLES * float(np.median(np.diff(time))) * np.array([-1.0, 1.0])
    windows = [slice(a, b) for a, b in np.searchsorted(time, np.interp(there, phase, time) + reach) if b > a]
    if not windows:
        return True
    factor = min(_ABOVE_RECURRING, _ECHO * shifts.size)
    largest = [float(np.max(size[window])) for window in windows]
    if size[peak] < factor * float(np.quantile(largest, _RECURRING, method="lower")):
        return True
    small = bool(size[peak] < _SMALL * np.ptp(samples.values))
    return small and _more_than_chance(size >= size[peak] / factor, windows, run)


def _more_than_chance(alike: NDArray[np.bool_], windows: list[slice], run: slice) -> bool:
    """Whether more of the ``windows`` hold a sample ``alike``, (N,), than by how many there are elsewhere."""
    elsewhere = np.ones_like(alike)
    for each in (*windows, run):
        elsewhere[each] = False
    share = (np.count_nonzero(alike & elsewhere) + 1) / (np.count_nonzero(elsewhere) + 1)
    samples = max(each.stop - each.start for each in windows)
    hits = sum(bool(np.any(alike[window])) for window in windows)
    return float(bdtrc(hits - 1, len(windows), 1.0 - (1.0 - share) ** samples)) < _BY_CHANCE


Outliers = Mapping[str, NDArray[np.bool_]]
"""Which of the finite samples of a channel are outliers, by name; channels without any are not in it."""


def can_leave_out(out: NDArray[np.bool_]) -> bool:
    """Whether so few of the samples, (N,), are ``out`` that the others can be trusted."""
    return bool(np.mean(out) <= MOST_LEFT_OUT)


def check_outliers(source: str, recording: Recording, outliers: Outliers) -> tuple[DataWarning, ...]:
    """A warning for every channel of a test with outlying samples."""
    return tuple(
        _warning(source, recording.name, recording.channels[name], out) for name, out in outliers.items()
    )


def _warning(source: str, test: str, channel: RecordedChannel, out: NDArray[np.bool_]) -> DataWarning:
    count, share = int(np.count_nonzero(out)), float(np.mean(out))
    what = (
        f"{count} of {out.size} samples ({100 * share:.2g} %) are spikes or dropouts, alone and far off the waveform"
        " of the others;"
    )
    if not can_leave_out(out):
        what += " too many to leave out: the sensor cannot be trusted in this test"
    elif share > _MANY:
        what += " left out, but so many that the sensor cannot be trusted in this test"
    else:
        what += " left out: harmonics and noise are those of the other samples"
    code, remedy = "outlying_samples", "check the sensor's cable and the logger"
    if share > _MANY:
        code, remedy = "unreliable_sensor", f"{remedy}, or leave this test out"
    first = channel.time[np.isfinite(channel.values) & np.isfinite(channel.time)][np.argmax(out)]
    return DataWarning(code, what, source, test, channel.name, float(first), remedy)


_MOST_REFITS = 4


@dataclass(frozen=True)
class RobustDwell:
    """A dwell fitted without its outliers.

    Attributes:
        fit: of the samples that are not outliers.
        groups: all samples, the outliers replaced by the fitted waveform.
        outliers: by channel.
    """

    fit: DwellFit
    groups: tuple[ClockGroup, ...]
    outliers: Outliers


def fit_robust_dwell(groups: tuple[ClockGroup, ...], driven: str, start: float, orders: int) -> RobustDwell:
    """Fit all channels of a dwell near ``start`` [Hz] up to ``orders``, outliers left out.

    Raises :class:`numpy.linalg.LinAlgError` when the stamps do not determine the harmonics.
    """
    fit = fit_dwell(groups, driven, start, orders)
    outliers = _first_outliers(groups, fit)
    for _ in range(_MOST_REFITS):
        if not outliers:
            break
        fit = fit_dwell(_without(groups, outliers), driven, start, orders)
        before, outliers = outliers, _further_outliers(groups, fit, outliers)
        if _same(before, outliers):
            break
    return RobustDwell(fit, _mended(groups, fit, outliers) if outliers else groups, outliers)


def _first_outliers(groups: tuple[ClockGroup, ...], fit: DwellFit) -> Outliers:
    found = {}
    for group in groups:
        for name in (name for name in group.names if name in fit.channels):
            none = np.zeros(group.time.size, dtype=np.bool_)
            found[name] = _outliers(group, name, fit, fit.channels[name].residual, none)
    return {name: mask for name, mask in found.items() if np.any(mask)}


def _further_outliers(groups: tuple[ClockGroup, ...], fit: DwellFit, outliers: Outliers) -> Outliers:
    """The outliers at the fundamental of ``fit``, found from ``outliers`` on."""
    found = {}
    for group in groups:
        for name in (name for name in group.names if name in fit.channels):
            out = outliers.get(name, np.zeros(group.time.size, dtype=np.bool_))
            if can_leave_out(out):
                out = _outliers(group, name, fit, residual_without(group, name, fit, out), out)
            found[name] = out
    return {name: mask for name, mask in found.items() if np.any(mask)}


def _outliers(
    group: ClockGroup, name: str, fit: DwellFit, residual: NDArray[np.float64], out: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """As :func:`find_outliers`; none where the samples left would not determine the harmonics."""
    i = group.names.index(name)
    floor = float(np.sqrt(smallest_density(group.values[i : i + 1])[0]))
    samples = WaveformSamples(group.time, group.values[i], fit.frequency * group.time, floor)
    try:
        return find_outliers(samples, residual, out, lambda mask: residual_without(group, name, fit, mask))
    except np.linalg.LinAlgError:
        return np.zeros_like(out)


def residual_without(
    group: ClockGroup, name: str, fit: DwellFit, out: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Residual of all samples of a channel, (N,) [unit], from a fit to those that are not ``out`` (N,).

    The fundamental and the orders are those of ``fit``. Raises :class:`numpy.linalg.LinAlgError` when the samples
    left do not determine the harmonics.
    """
    highest, values = fit.channels[name].highest, group.values[group.names.index(name)]
    _, some, highest = fit_resolved(group.time[~out], fit.frequency, values[None, ~out], highest, 1)
    everywhere = plan_basis(group.time, fit.frequency, highest)
    fitted = signals(everywhere.plan, some.amplitude)[0] + some.slope[0] * group.time
    residual: NDArray[np.float64] = values - fitted
    return residual


def _same(one: Outliers, other: Outliers) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


def _without(groups: tuple[ClockGroup, ...], outliers: Outliers) -> tuple[ClockGroup, ...]:
    """The groups without ``outliers``, each channel with outliers by itself.

    A channel with too many of them keeps all its samples.
    """
    parts: list[ClockGroup] = []
    for group in groups:
        cleaned = [name for name in group.names if name in outliers and can_leave_out(outliers[name])]
        whole = [i for i, name in enumerate(group.names) if name not in cleaned]
        if whole:
            names = tuple(group.names[i] for i in whole)
            parts.append(ClockGroup(names, group.time, group.values[whole]))
        for name in cleaned:
            used = ~outliers[name]
            values = group.values[group.names.index(name)][None, used]
            left_out = int(np.count_nonzero(outliers[name]))
            parts.append(ClockGroup((name,), group.time[used], values, left_out))
    return tuple(parts)


def _mended(groups: tuple[ClockGroup, ...], fit: DwellFit, outliers: Outliers) -> tuple[ClockGroup, ...]:
    """The groups with outliers that were left out replaced by the fitted waveform."""
    mended = []
    for group in groups:
        values = group.values.copy()
        for i, name in enumerate(group.names):
            if name in outliers and name in fit.channels and can_leave_out(outliers[name]):
                out = outliers[name]
                values[i, out] -= residual_without(group, name, fit, out)[out]
        mended.append(replace(group, values=values))
    return tuple(mended)


_FEWEST_SAMPLES = 16


def estimate_standstill_noise(campaign: Campaign) -> tuple[dict[str, float], tuple[DataWarning, ...]]:
    """Standard deviation of each channel about its trend, the largest over the standstill records [its unit].

    With a warning for every channel of a record in which samples are left out.
    """
    noise: dict[str, float] = {}
    warnings: tuple[DataWarning, ...] = ()
    for recording in campaign.of_kind("standstill"):
        outliers = {}
        for name, channel in recording.channels.items():
            usable = np.isfinite(channel.values)
            if np.count_nonzero(usable) < _FEWEST_SAMPLES:
                continue
            spread, out = _spread(channel.time[usable], channel.values[usable])
            noise[name] = max(spread, noise.get(name, 0.0))
            if np.any(out):
                outliers[name] = out
        warnings += check_outliers(campaign.source, recording, outliers)
    return noise, warnings


def _spread(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, NDArray[np.bool_]]:
    """Standard deviation [unit] of ``values`` about their trend over ``time`` [s], and the outliers, both (N,)."""

    def residual(out: NDArray[np.bool_]) -> NDArray[np.float64]:
        trend = np.polynomial.Polynomial.fit(time[~out], values[~out], 1)
        left: NDArray[np.float64] = values - trend(time)
        return left

    none = np.zeros(time.size, dtype=np.bool_)
    floor = float(np.sqrt(smallest_density(values[None])[0]))
    out = find_outliers(WaveformSamples(time, values, None, floor), residual(none), none, residual)
    left_out = out if can_leave_out(out) else none
    return float(np.std(residual(left_out)[~left_out])), out
