"""Spikes and dropouts of a periodic record: samples that lie far off the waveform that all others follow.

A harmonic fit spreads the error of one sample over the record, so that a few wrong samples hide each other and look
like noise. The samples farthest off the fit are therefore left out first, the fit is repeated without them, and so
on until no sample is left that is an outlier (:func:`find_outliers`). A sample is one where the residual r of the fit

- exceeds 8 robust standard deviations, s = 1.4826 median |r - median r|, but no less than the sensor's quantisation
  and 1e-4 of the waveform's standard deviation,
- stands alone: a run of at most five such samples, or of samples with one and the same value (a sensor that sticks
  or drops to zero), beside which |r| falls below half of its peak at once,
- does not recur: at the same phase of most other periods |r| is several times smaller.

Gaussian noise exceeds 8 s once in 1e15 samples. What a mechanism does, such as a step of the friction that comes
a little early or late or has orders beyond those fitted, recurs at its phase; a transient or a rattle lasts.

Reference: P. J. Huber, E. M. Ronchetti, Robust Statistics (2009), sections 5.1 and 7.9.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis, signals

FARTHEST = 8.0
"""Distance from the fit [robust standard deviations] beyond which a sample may be an outlier."""

MOST_LEFT_OUT = 0.2
"""Share of the samples up to which outliers are left out; with more, which samples are wrong is not known."""

_NORMAL = 1.4826
_LEAST_SHARE = 1e-4
_LONGEST_RUN = 5
_BRIDGED = 2
_BESIDE = 2
_FALL = 0.5
_PHASE_SAMPLES = 2.5
_RECURRING = 0.8
_ABOVE_RECURRING = 3.0
_GHOST = 0.6
_PEAK_ABOVE = 5.0
_LEVEL_RATIO = 0.6
_MOST_ROUNDS = 40


@dataclass(frozen=True)
class PeriodicSamples:
    """One channel: ``time`` [s] and ``values`` [unit], (N,), on a fundamental ``frequency`` [Hz].

    Orders up to ``highest`` are fitted; ``floor`` [unit] is the least standard deviation of a sample.
    """

    time: NDArray[np.float64]
    values: NDArray[np.float64]
    frequency: float
    highest: int
    floor: float


def find_outliers(
    samples: PeriodicSamples, residual: NDArray[np.float64], out: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which samples are outliers, (N,); ``residual`` [unit], (N,), is that of a fit without those in ``out`` (N,).

    Raises :class:`numpy.linalg.LinAlgError` when the samples left do not determine the harmonics.
    """
    out = out.copy()
    for _ in range(_MOST_ROUNDS):
        found = largest_outliers(samples, residual, out)
        if not np.any(found):
            break
        out |= found
        if np.mean(out) > MOST_LEFT_OUT:
            return out
        residual = residual_without(samples, out)
    return out & (np.abs(residual) > FARTHEST * _scale(samples, residual[~out]))


def residual_without(samples: PeriodicSamples, out: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Residual of all samples, (N,) [unit], from a fit to those that are not ``out`` (N,).

    Raises :class:`numpy.linalg.LinAlgError` when they do not determine the harmonics.
    """
    used, highest, frequency = ~out, samples.highest, samples.frequency
    fit = fit_periodic(
        plan_basis(samples.time[used], frequency, highest), samples.values[used][None], highest, 0
    )
    everywhere = plan_basis(samples.time, frequency, highest)
    fitted = signals(everywhere.plan, fit.amplitude)[0] + fit.slope[0] * samples.time
    residual: NDArray[np.float64] = samples.values - fitted
    return residual


def largest_outliers(
    samples: PeriodicSamples, residual: NDArray[np.float64], out: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The outliers of about the largest size among those not yet ``out``, (N,).

    A run is what exceeds a fifth of its peak, because the fit leaves a share of a large outlier beside it.
    """
    size = np.where(out, 0.0, np.abs(residual))
    lowest = FARTHEST * _scale(samples, residual[~out])
    found = np.zeros_like(out)
    for level in _levels(float(np.max(size)), lowest):
        clean = level / _PEAK_ABOVE if level > lowest else 0.0
        smallest = _PEAK_ABOVE * level * _LEVEL_RATIO if level > lowest else level
        for run in _runs(size, level, clean):
            peak = float(np.max(size[run]))
            if smallest < peak <= _PEAK_ABOVE * level and _is_outlier(samples, size, out, run, clean):
                found[run] = size[run] > level
        if np.any(found):
            break
    return found


def _levels(largest: float, lowest: float) -> list[float]:
    """Levels [unit] from a fifth of the ``largest`` residual down to the ``lowest`` that counts; none below it."""
    if largest <= lowest:
        return []
    count = max(int(np.ceil(np.log(_PEAK_ABOVE * lowest / largest) / np.log(_LEVEL_RATIO))), 0)
    levels = [largest / _PEAK_ABOVE * _LEVEL_RATIO**k for k in range(count)]
    return [*(level for level in levels if level > lowest), lowest]


def _is_outlier(
    samples: PeriodicSamples, size: NDArray[np.float64], out: NDArray[np.bool_], run: slice, clean: float
) -> bool:
    """Whether a run is short or constant, stands alone, and does not recur."""
    start, stop, peak = run.start, run.stop, float(np.max(size[run]))
    for beside in (size[max(start - _BESIDE, 0) : start][::-1], size[stop : stop + _BESIDE]):
        if np.any(beside >= _FALL * peak) and beside[0] >= clean:
            return False
    left_out_nearby = np.count_nonzero(out[max(start - _LONGEST_RUN, 0) : stop + _LONGEST_RUN])
    length = stop - start
    short = length <= _LONGEST_RUN and length + left_out_nearby <= 2 * _LONGEST_RUN
    constant = bool(np.all(samples.values[run] == samples.values[start]))
    return (short or constant) and not _recurs(samples, size, run)


def _scale(samples: PeriodicSamples, residual: NDArray[np.float64]) -> float:
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
        for i, (a, b) in enumerate(zip(places[:-1], places[1:], strict=True))
        if b - a > _BRIDGED + 1 or (b - a > 1 and np.all(size[a + 1 : b] < clean))
    ]
    edges = [0, *breaks, places.size]
    return [slice(int(places[a]), int(places[b - 1]) + 1) for a, b in zip(edges[:-1], edges[1:], strict=True)]


def _recurs(samples: PeriodicSamples, size: NDArray[np.float64], run: slice) -> bool:
    """Whether residuals like that of the run are found at its phase in other periods.

    The residual that an outlier leaves in the n other periods of a fit is 1 / n of its own at most: where n is small,
    the factor is.
    """
    time = samples.time
    peak = run.start + int(np.argmax(size[run]))
    period, reach = 1.0 / samples.frequency, _PHASE_SAMPLES * float(np.median(np.diff(time)))
    before = int((time[peak] - time[0]) / period)
    after = int((time[-1] - time[peak]) / period)
    shifts = np.concatenate([np.arange(-before, 0), np.arange(1, after + 1)])
    if shifts.size == 0:
        return True
    edges = np.searchsorted(time, time[peak] + shifts[:, None] * period + np.array([-reach, reach]))
    largest = [float(np.max(size[a:b])) for a, b in edges if b > a]
    if not largest:
        return True
    usual = float(np.quantile(largest, _RECURRING, method="lower"))
    return bool(size[peak] < min(_ABOVE_RECURRING, _GHOST * shifts.size) * usual)
