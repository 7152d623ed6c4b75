"""Checks of a dwell and of its fit: what is found travels with the response as warnings."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.clocks import ClockGroup
from savgs_ident.responses.dwell_fit import ChannelFit, DwellFit

FEWEST_PERIODS = 3
_FREQUENCY_MISS = 0.02
_STEADY_SHARE = 0.01
_STEADY_SIGMAS = 5.0
_NOISE_FACTOR = 1.5
_CLOCK_SIGMAS = 5.0


def check_frequency(source: str, recording: Recording, measured: float) -> tuple[DataWarning, ...]:
    """A warning where the road moves at another frequency [Hz] than the test's name or label says."""
    asked = recording.frequency_hz
    if asked is None or abs(measured - asked) <= _FREQUENCY_MISS * asked:
        return ()
    what = f"the road moves at {measured:.4g} Hz, {asked:.4g} Hz was asked for; the measured one is used"
    remedy = "check the test's label or the cam drive"
    return (DataWarning("frequency_differs", what, source, recording.name, "road_height", None, remedy),)


def check_steady(
    source: str, test: str, groups: tuple[ClockGroup, ...], fit: DwellFit
) -> tuple[DataWarning, ...]:
    """Warnings for channels whose fundamental changes between the first and the last third of the dwell.

    A change counts when it exceeds both 1 % of the fundamental and five of its standard deviations.
    """
    found = []
    for group in groups:
        names = [name for name in group.names if name in fit.channels]
        if not names:
            continue
        first, last, samples = _end_fundamentals(group, fit.frequency, max(fit.periods // 3, 1))
        for i, name in enumerate(group.names):
            channel = fit.channels[name]
            size = abs(channel.amplitude[1])
            change = abs(last[i] - first[i])
            deviation = np.sqrt(8.0 * channel.density[1] / samples)
            if change > max(_STEADY_SHARE * size, _STEADY_SIGMAS * deviation):
                what = f"not steady: the fundamental changes by {100 * change / size:.2g} % within the dwell"
                remedy = "let the rig settle longer before recording, or leave this dwell out"
                found.append(DataWarning("not_steady", what, source, test, name, None, remedy))
    return tuple(found)


def check_noise(campaign: Campaign, fits: Mapping[str, DwellFit]) -> tuple[DataWarning, ...]:
    """One warning for each channel that is much noisier in the dwells than at standstill.

    More noise in motion than at rest means that something moves which does not repeat from period to period:
    rattle, a transient not yet over, a supply that hums with the load, or orders above the sampling.
    """
    found = []
    for name, at_rest in _standstill_noise(campaign).items():
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
    """Which orders 1..m owe more of their variance to folding than to noise."""
    exceeds: NDArray[np.bool_] = channel.folded[1:] > 0.5 * channel.variance[1:]
    return exceeds


def clock_rates(fits: Mapping[str, DwellFit]) -> dict[str, tuple[float, float]]:
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
    source: str, fits: Mapping[str, DwellFit], road: str
) -> tuple[dict[str, float], tuple[DataWarning, ...]]:
    """Factors [1] by which to stretch the time of channels whose clock differs from the road's, with warnings."""
    rates = clock_rates(fits)
    stretch: dict[str, float] = {}
    found = []
    lead, lead_sd = rates[road]
    for name, (rate, deviation) in rates.items():
        apart = rate - lead
        if name == road or abs(apart) <= _CLOCK_SIGMAS * np.hypot(deviation, lead_sd):
            continue
        stretch[name] = 1.0 + apart
        what = (
            f"the clock runs {1e6 * abs(apart):.3g} ppm (+- {1e6 * deviation:.2g})"
            f" {'slower' if apart > 0 else 'faster'} than the road's; its time was scaled, about mid-dwell"
        )
        found.append(
            DataWarning("clock_rate_differs", what, source, "", name, None, "synchronise the loggers' clocks")
        )
    return stretch, tuple(found)


def _end_fundamentals(
    group: ClockGroup, frequency: float, periods: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], int]:
    """Fundamental over the first and over the last whole ``periods``, and the samples in each."""
    count = max(round(periods / frequency * group.rate_hz), 1)
    ends = []
    for part in (slice(None, count), slice(-count, None)):
        turns = np.exp(-2j * np.pi * frequency * group.time[part])
        values = group.values[:, part] - group.values[:, part].mean(axis=1, keepdims=True)
        ends.append(2.0 * np.mean(values * turns, axis=1))
    return ends[0], ends[1], count


def _standstill_noise(campaign: Campaign) -> dict[str, float]:
    """Standard deviation of each channel about its trend over the standstill records, where it is not 0."""
    noise: dict[str, float] = {}
    for recording in campaign.of_kind("standstill"):
        for channel in recording.channels.values():
            usable = np.isfinite(channel.values)
            if np.count_nonzero(usable) < 16:
                continue
            time, values = channel.time[usable], channel.values[usable]
            trend = np.polynomial.Polynomial.fit(time, values, 1)
            spread = float(np.std(values - trend(time)))
            if spread > 0.0:
                noise[channel.name] = max(spread, noise.get(channel.name, 0.0))
    return noise
