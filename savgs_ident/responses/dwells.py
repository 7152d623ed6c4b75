"""Dwells of a campaign to one harmonic response.

    response = estimate_response(campaign, orders=9)
    accel = response.harmonics[:, response.channel("body_accel"), 1]

Every dwell is fitted on its actual stamps, channel by channel as far as the sampling carries, spikes and dropouts
left out; the noise is what does not repeat from period to period; then the time origin is moved to the instant,
within half a period of mid-record, at which the fundamental of the driven input is real and positive. What the checks
of a dwell and of its fit find (:mod:`savgs_ident.responses.dwell_checks`) are warnings of the response.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.dwell_checks import (
    check_clocks,
    check_folding,
    check_frequency,
    check_noise,
    check_steady,
)
from savgs_ident.responses.dwell_fit import ChannelFit, DwellFit
from savgs_ident.responses.fundamental import (
    ClockGroup,
    group_by_clock,
    highest_valid_order,
    strongest_line,
)
from savgs_ident.responses.harmonic_response import HarmonicResponse, unbiased_peak_to_peak
from savgs_ident.responses.outliers import check_outliers, fit_robust_dwell

FEWEST_PERIODS = 3
_LINE_SHARE = 0.2
"""Share of the driven input's mean square in its strongest line from which on it moves periodically: noise of some
hundred samples has a twentieth at most, a sawtooth three fifths."""
_NO_MOTION = {"road_height": "no_road_motion"}
"""Codes of warnings are contract: that of the road is older than tests of other inputs."""


def estimate_response(campaign: Campaign, orders: int = 15, driven: str = "") -> HarmonicResponse:
    """Complex harmonics, covariance and peak-to-peak of all dwells of ``campaign``, sorted by frequency.

    ``driven`` is the input that moves in them, that of the campaign's layout if empty.

    ``orders`` is the highest order kept; a channel sampled at r Hz is valid up to 0.4 r / f. The covariance
    holds the noise of the channel and the phase noise of the driven input, which sets the time origin (a part common
    to all entries of a dwell; it is left out for the fundamental of that input itself). The mean (order 0) has
    no imaginary part, and variance 0 for it. A constant offset between the clocks of two channels cannot be
    seen in periodic data: stamps are taken as true up to their rate, which is checked.

    Dwells that cannot be used are left out with a warning: ``no_road_motion`` (``no_input_motion`` where another
    input is driven), ``too_few_periods`` (3 are needed to separate noise from signal), ``not_determined``. Further
    warnings: ``outlying_samples``, ``unreliable_sensor``, ``frequency_differs``, ``not_steady``,
    ``clock_rate_differs``, ``noise_above_standstill``, ``folded_orders``.

    Raises :class:`InputError` when ``orders`` is below 1 or no dwell can be used.
    """
    if orders < 1:
        raise InputError(f"orders is {orders}", source="orders", remedy="ask for at least order 1")
    # Beside other programs threads of the linear algebra wait for each other: it takes up to five times as long.
    with threadpool_limits(1, "blas"):
        return _estimated(campaign, orders, driven or campaign.layout.driven)


def _estimated(campaign: Campaign, orders: int, driven: str) -> HarmonicResponse:
    recorded = campaign
    campaign = campaign.only({*campaign.names} - {*campaign.layout.free})
    fits, groups, warnings = _fit_all(campaign, orders, {}, driven)
    if not fits:
        raise _no_dwell(campaign, warnings)
    stretch, clock_warnings = check_clocks(campaign.source, fits, driven)
    if stretch:
        fits, groups, warnings = _fit_all(campaign, orders, stretch, driven)
    for test, fit in fits.items():
        warnings += check_steady(campaign.source, test, groups[test], fit)
    warnings += clock_warnings + check_noise(campaign, fits) + check_folding(campaign.source, fits)
    response = _assemble(campaign, fits, orders, warnings, driven)
    return replace(response, beside=_means_beside(recorded, response.tests))


def _means_beside(campaign: Campaign, tests: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Means of the free channels in each test [their units], (D,) by name; NaN where there is none."""
    recordings = {each.name: each.channels for each in campaign.recordings}

    def mean(test: str, name: str) -> float:
        channel = recordings[test].get(name)
        values = np.zeros(0) if channel is None else channel.values[np.isfinite(channel.values)]
        return float(values.mean()) if values.size else np.nan

    return {name: np.array([mean(test, name) for test in tests]) for name in campaign.layout.free}


def _fit_all(
    campaign: Campaign, orders: int, stretch: Mapping[str, float], driven: str
) -> tuple[dict[str, DwellFit], dict[str, tuple[ClockGroup, ...]], tuple[DataWarning, ...]]:
    """Fits and channels of the usable dwells by name, and warnings with the reasons of the others."""
    fits: dict[str, DwellFit] = {}
    kept: dict[str, tuple[ClockGroup, ...]] = {}
    warnings: tuple[DataWarning, ...] = ()
    for recording in campaign.of_kind("dwell"):
        groups = group_by_clock(recording, _middle(recording, driven), stretch)
        start, refusal = _start_frequency(campaign.source, recording, groups, driven)
        if refusal is None:
            try:
                dwell = fit_robust_dwell(groups, driven, start, orders)
            except np.linalg.LinAlgError:
                what = "the time stamps do not determine the harmonics"
                remedy = "look for repeated or clustered time stamps"
                refusal = DataWarning(
                    "not_determined", what, campaign.source, recording.name, "", None, remedy
                )
        if refusal is not None:
            warnings += (refusal,)
            continue
        fits[recording.name], kept[recording.name] = dwell.fit, dwell.groups
        warnings += check_outliers(campaign.source, recording, dwell.outliers)
        warnings += check_frequency(campaign.source, recording, dwell.fit.frequency, driven)
    return fits, kept, warnings


def _middle(recording: Recording, driven: str) -> float:
    """Middle of the record of the driven input [s], 0 where there is none."""
    lead = recording.channels.get(driven)
    return 0.0 if lead is None or lead.time.size == 0 else 0.5 * float(lead.time[0] + lead.time[-1])


def _start_frequency(
    source: str, recording: Recording, groups: tuple[ClockGroup, ...], driven: str
) -> tuple[float, DataWarning | None]:
    """Initial frequency [Hz], or the warning that the dwell cannot be used."""

    def refuse(code: str, what: str, remedy: str) -> tuple[float, DataWarning]:
        return 0.0, DataWarning(code, what, source, recording.name, driven, None, remedy)

    lead = next((group for group in groups if driven in group.names), None)
    still = _NO_MOTION.get(driven, "no_input_motion")
    if lead is None:
        return refuse(still, f"{driven} was not recorded", "map its channel, or leave this test out")
    moved = lead.values[lead.names.index(driven)]
    if np.ptp(moved) == 0.0:
        return refuse(still, f"{driven} does not move", "name this test a standstill")
    frequency, share = strongest_line(lead.time, moved)
    if share < _LINE_SHARE:
        return refuse(
            still,
            f"{driven} does not move to and fro: its strongest line has {100 * share:.2g} % of its mean square",
            "name this test a standstill, or look at what drives it",
        )
    periods = min(group.span_s for group in groups) * frequency
    if periods < FEWEST_PERIODS - 0.3:
        return refuse(
            "too_few_periods",
            f"{periods:.1f} periods are recorded, {FEWEST_PERIODS} are needed to separate noise from signal",
            f"record at least {FEWEST_PERIODS / frequency:.3g} s",
        )
    if highest_valid_order(lead, frequency, 1) < 1:
        return refuse(
            "too_few_samples",
            f"{driven} is sampled at {lead.rate_hz:.3g} Hz, too slow for {frequency:.3g} Hz",
            f"sample it at {3 * frequency:.3g} Hz or faster",
        )
    return frequency, None


def _no_dwell(campaign: Campaign, warnings: tuple[DataWarning, ...]) -> InputError:
    warnings = (*warnings, *campaign.left_out)
    if not warnings:
        return InputError(
            "there is no harmonic dwell", source=campaign.source, remedy="name the tests dwell_<f>Hz"
        )
    first = warnings[0]
    return InputError(
        f"no dwell can be used; the first: {first.what}",
        source=campaign.source,
        test=first.test,
        channel=first.channel,
        remedy=first.remedy,
    )


def _assemble(
    campaign: Campaign,
    fits: Mapping[str, DwellFit],
    orders: int,
    warnings: tuple[DataWarning, ...],
    driven: str,
) -> HarmonicResponse:
    """The record: dwells sorted by frequency, channels as recorded, time origins moved."""
    tests = tuple(sorted(fits, key=lambda test: fits[test].frequency))
    present = {name for fit in fits.values() for name in fit.channels}
    channels = tuple(name for name in campaign.names if name in present)
    shape = (len(tests), len(channels), orders + 1)
    harmonics = np.zeros(shape, dtype=np.complex128)
    covariance = np.zeros((*shape, 2, 2))
    valid = np.zeros(shape, dtype=np.bool_)
    dof = np.zeros(shape)
    noise_sd, peak, peak_sd = (np.zeros(shape[:2]) for _ in range(3))
    for d, test in enumerate(tests):
        lead = fits[test].channels[driven]
        for name, fit in fits[test].channels.items():
            c, upto = channels.index(name), slice(0, fit.amplitude.size)
            harmonics[d, c, upto], covariance[d, c, upto] = _at_origin_of(lead, fit)
            valid[d, c, upto] = True
            dof[d, c, upto] = fit.dof
            noise_sd[d, c] = fit.noise_sd
        peak[d], peak_sd[d] = unbiased_peak_to_peak(harmonics[d], covariance[d], valid[d])
    return HarmonicResponse(
        tests=tests,
        channels=channels,
        frequency=np.array([fits[test].frequency for test in tests]),
        frequency_sd=np.array([fits[test].frequency_sd for test in tests]),
        harmonics=harmonics,
        covariance=covariance,
        valid=valid,
        peak_to_peak=peak,
        peak_to_peak_sd=peak_sd,
        noise_sd=noise_sd,
        periods=np.array([fits[test].periods for test in tests]),
        warnings=warnings,
        covariance_dof=dof,
        recorded=np.array([campaign.when(test) for test in tests]),
    )


def _at_origin_of(lead: ChannelFit, fit: ChannelFit) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Harmonics and covariance of (Re, Im) of ``fit``, the origin where the fundamental of ``lead`` is positive.

    An error dphi of its phase turns X_k by -k dphi, which adds k^2 |X_k|^2 var(dphi) across it.
    """
    order = np.arange(fit.amplitude.size)
    turn = np.exp(-1j * order * np.angle(lead.amplitude[1]))
    harmonics = fit.amplitude * turn
    across = order**2 * _phase_variance(lead)
    if fit is lead:
        harmonics[1] = abs(lead.amplitude[1])
        across[1] = 0.0
    spread = fit.variance + across * np.abs(harmonics) ** 2
    skew = fit.pseudo_variance * turn**2 - across * harmonics**2
    covariance = np.empty((order.size, 2, 2))
    covariance[:, 0, 0] = 0.5 * (spread + skew.real)
    covariance[:, 1, 1] = 0.5 * (spread - skew.real)
    covariance[:, 0, 1] = covariance[:, 1, 0] = 0.5 * skew.imag
    return harmonics, covariance


def _phase_variance(fit: ChannelFit) -> float:
    """Variance of the phase of the fundamental [rad^2]."""
    turn = np.exp(-1j * np.angle(fit.amplitude[1]))
    spread = 0.5 * (fit.variance[1] - (fit.pseudo_variance[1] * turn**2).real)
    return float(spread / abs(fit.amplitude[1]) ** 2)
