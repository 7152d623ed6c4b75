"""Checks of dwells and of their fits: is the motion steady, do clocks agree, is it louder than at rest, does it fold.

Each gives warnings that the response takes along.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.dwell_fit import ChannelFit, DwellFit
from savgs_ident.responses.fundamental import ClockGroup
from savgs_ident.responses.outliers import estimate_standstill_noise

_FREQUENCY_MISS = 0.02
_STEADY_SHARE = 0.01
_STEADY_SIGMAS = 5.0
_STEADY_ORDERS = 3
_DIED_AWAY = 2.0
"""How many times as much does not repeat at the beginning of a dwell as at its end where a transient dies away.

Origin: by choice; of a drive that began at rest it was 20 times and more, and no shipped recording has so much."""
_FEWEST_LEFT = 60
"""Fewest samples of an end beyond its harmonics: of fewer, what is left differs by a half by chance alone."""
_NOISE_FACTOR = 1.5
_CLOCK_SIGMAS = 5.0


def check_frequency(
    source: str, recording: Recording, measured: float, driven: str
) -> tuple[DataWarning, ...]:
    """A warning where the driven input moves at another frequency [Hz] than the test's name or label gives."""
    nominal = recording.frequency_hz
    if nominal is None or abs(measured - nominal) <= _FREQUENCY_MISS * nominal:
        return ()
    what = f"{driven} moves at {measured:.4g} Hz, {nominal:.4g} Hz was asked for; the measured one is used"
    remedy = f"check the test's label and what drives {driven}"
    return (DataWarning("frequency_differs", what, source, recording.name, driven, None, remedy),)


def check_steady(
    source: str, test: str, groups: tuple[ClockGroup, ...], fit: DwellFit
) -> tuple[DataWarning, ...]:
    """Warnings for channels that are another in the first third of the dwell than in the last.

    A change of the fundamental counts when it exceeds both 1 % of it and five of its standard deviations; what does
    not repeat, when it falls to a half, from 1 % of the fundamental or more: a transient that rings or drifts.
    """
    found = []
    for group in groups:
        names = [name for name in group.names if name in fit.channels]
        if not names:
            continue
        orders = fit.channels[names[0]].amplitude.size - 1
        periods = max(fit.periods // 3, 1)
        begun, ended = _ends(group, fit.frequency, periods, min(_STEADY_ORDERS, orders))
        left = [each.left for each in _ends(group, fit.frequency, periods, orders)]
        for i, name in enumerate(group.names):
            channel = fit.channels[name]
            size = abs(channel.amplitude[1])
            change = abs(ended.fundamental[i] - begun.fundamental[i])
            deviation = np.sqrt(8.0 * channel.density[1] / min(begun.samples, ended.samples))
            before, after = (float(each[i]) for each in left)
            known = min(begun.samples, ended.samples) - 2 * orders > _FEWEST_LEFT
            what = ""
            if change > max(_STEADY_SHARE * size, _STEADY_SIGMAS * deviation):
                what = f"the fundamental changes by {100 * change / size:.2g} % within the dwell"
            elif known and before > max(_STEADY_SHARE * size, _DIED_AWAY * after):
                what = (
                    f"what does not repeat is {100 * before / size:.2g} % of the fundamental in the first third of"
                    f" the dwell and {100 * after / size:.2g} % in the last"
                )
            if what:
                remedy = "begin to record later, when the transient has died away, or leave this dwell out"
                found.append(
                    DataWarning("not_steady", f"not steady: {what}", source, test, name, None, remedy)
                )
    return tuple(found)


def check_noise(campaign: Campaign, fits: Mapping[str, DwellFit]) -> tuple[DataWarning, ...]:
    """One warning for each channel that is much noisier in the dwells than at standstill, and those of the latter.

    More noise in motion than at rest is motion that does not repeat from period to period: rattle, a transient
    not yet over, a supply that hums with the load, or orders above the sampling.
    """
    noise, warnings = estimate_standstill_noise(campaign)
    found = list(warnings)
    for name, at_rest in noise.items():
        if at_rest == 0.0:
            continue
        ratio = {
            test: fit.channels[name].noise_sd / at_rest for test, fit in fits.items() if name in fit.channels
        }
        loud = {test: value for test, value in ratio.items() if value > _NOISE_FACTOR}
        if loud:
            worst = max(loud, key=lambda test: loud[test])
            what = (
                f"what does not repeat is {loud[worst]:.1f} times the noise at standstill"
                f" ({len(loud)} of {len(ratio)} dwells above {_NOISE_FACTOR:g} times)"
            )
            remedy = "look for rattle, unfinished transients or content above the sampling rate"
            found.append(
                DataWarning("noise_above_standstill", what, campaign.source, worst, name, None, remedy)
            )
    return tuple(found)


def check_folding(source: str, fits: Mapping[str, DwellFit]) -> tuple[DataWarning, ...]:
    """One warning for each channel with dwells in which orders above the sampling fold onto those kept."""
    found = []
    for name in dict.fromkeys(name for fit in fits.values() for name in fit.channels):
        hit = [
            test for test, fit in fits.items() if name in fit.channels and np.any(_folds(fit.channels[name]))
        ]
        if hit:
            what = (
                "content above the Nyquist frequency may fold onto the orders kept where the frequency"
                f" divides the sampling rate ({len(hit)} of {len(fits)} dwells); the covariance allows for it"
            )
            remedy = (
                "sample faster, filter before sampling, or choose frequencies that do not divide the rate"
            )
            found.append(DataWarning("folded_orders", what, source, hit[0], name, None, remedy))
    return tuple(found)


def _folds(channel: ChannelFit) -> NDArray[np.bool_]:
    """Which orders 1..m have more of their variance from folding than from noise."""
    exceeds: NDArray[np.bool_] = channel.folded[1:] > 0.5 * channel.variance[1:]
    return exceeds


def estimate_clock_rates(fits: Mapping[str, DwellFit]) -> dict[str, tuple[float, float]]:
    """Relative rate by which each channel's clock runs slow, with its standard deviation, over all dwells.

    Where the dwells scatter by more than their own deviations, the deviation is widened accordingly.
    """
    names = dict.fromkeys(name for fit in fits.values() for name in fit.channels)
    rates = {}
    for name in names:
        having = [fit for fit in fits.values() if name in fit.channels]
        rate = np.array([fit.channels[name].drift_hz / fit.frequency for fit in having])
        weight = np.array([fit.frequency**2 / fit.channels[name].drift_variance for fit in having])
        total = float(np.sum(weight))
        if total == 0.0:
            continue
        mean = float(weight @ rate) / total
        scatter = float(weight @ (rate - mean) ** 2) / max(len(having) - 1, 1)
        rates[name] = (mean, float(np.sqrt(max(scatter, 1.0) / total)))
    return rates


def check_clocks(
    source: str, fits: Mapping[str, DwellFit], driven: str
) -> tuple[dict[str, float], tuple[DataWarning, ...]]:
    """Factors [1] to stretch the time of channels by whose clock differs from that of ``driven``, with warnings."""
    rates = estimate_clock_rates(fits)
    stretch: dict[str, float] = {}
    found = []
    lead, lead_sd = rates[driven]
    for name, (rate, deviation) in rates.items():
        apart = rate - lead
        if name == driven or abs(apart) <= _CLOCK_SIGMAS * np.hypot(deviation, lead_sd):
            continue
        stretch[name] = 1.0 + apart
        what = (
            f"the clock runs {1e6 * abs(apart):.3g} ppm (+- {1e6 * deviation:.2g})"
            f" {'slower' if apart > 0 else 'faster'} than that of {driven}; its time was scaled, about mid-dwell"
        )
        found.append(
            DataWarning("clock_rate_differs", what, source, "", name, None, "synchronise the loggers' clocks")
        )
    return stretch, tuple(found)


class _End(NamedTuple):
    """A part of a dwell at one of its ends, by channel: the fundamental, and what is left without all orders (rms).

    Both are in the unit of the channel; ``samples`` is their number.
    """

    fundamental: NDArray[np.complex128]
    left: NDArray[np.float64]
    samples: int


def _ends(group: ClockGroup, frequency: float, periods: int, highest: int) -> list[_End]:
    """The first and the last whole ``periods`` of a dwell.

    By least squares with orders up to ``highest``, so that a gap in the samples does not look like a change.
    """
    span, orders = periods / frequency, np.arange(1, highest + 1)
    ends = []
    for inside in (group.time < group.time[0] + span, group.time > group.time[-1] - span):
        angle = 2.0 * np.pi * frequency * np.outer(group.time[inside], orders)
        columns = np.column_stack([np.cos(angle), np.sin(angle), np.ones(angle.shape[0])])
        values = group.values[:, inside].T
        weights, *_ = np.linalg.lstsq(columns, values)
        left = np.sqrt(np.mean((values - columns @ weights) ** 2, axis=0))
        ends.append(_End(weights[0] - 1j * weights[highest], left, angle.shape[0]))
    return ends
