"""Dwells of a campaign to one harmonic response.

    >>> response = estimate_response(campaign, orders=9)           # doctest: +SKIP
    >>> accel = response.harmonics[:, response.channel("sprung_accel"), 1]   # doctest: +SKIP

Every dwell is fitted on its actual stamps, channel by channel as far as the sampling carries; the noise is
what does not repeat from period to period; then the time origin is moved to the instant, within half a period
of mid-record, at which the road's fundamental is real and positive.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import CANONICAL_UNITS, Campaign, Recording
from savgs_ident.responses.clocks import ClockGroup, group_by_clock, highest_valid_order
from savgs_ident.responses.dwell_checks import (
    FEWEST_PERIODS,
    check_clocks,
    check_folding,
    check_frequency,
    check_noise,
    check_steady,
)
from savgs_ident.responses.dwell_fit import ChannelFit, DwellFit, fit_dwell
from savgs_ident.responses.fundamental import coarse_frequency
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.peak_to_peak_noise import unbiased_peak_to_peak

ROAD = "road_height"


def estimate_response(campaign: Campaign, orders: int = 15) -> HarmonicResponse:
    """Complex harmonics, covariance and peak-to-peak of all dwells of ``campaign``, sorted by frequency.

    ``orders`` is the highest order kept; a channel sampled at r Hz is valid up to 0.4 r / f. The covariance
    holds the noise of the channel and the phase noise of the road, which sets the time origin (a part common
    to all entries of a dwell; it is left out for the road's fundamental itself). The mean (order 0) has
    no imaginary part, and variance 0 for it. A constant offset between the clocks of two channels cannot be
    seen in periodic data: stamps are taken as true up to their rate, which is checked.

    Dwells that cannot be used are left out with a warning: ``no_road_motion``, ``too_few_periods`` (3 are
    needed to tell noise from signal), ``not_determined``. Further warnings: ``frequency_differs``,
    ``not_steady``, ``clock_rate_differs``, ``noise_above_standstill``, ``folded_orders``.

    Raises :class:`InputError` when ``orders`` is below 1 or no dwell can be used.
    """
    if orders < 1:
        raise InputError(f"orders is {orders}", source="orders", remedy="ask for at least order 1")
    fits, groups, warnings = _fit_all(campaign, orders, {})
    if not fits:
        raise _no_dwell(campaign, warnings)
    stretch, clock_warnings = check_clocks(campaign.source, fits, ROAD)
    if stretch:
        fits, groups, warnings = _fit_all(campaign, orders, stretch)
    for test, fit in fits.items():
        warnings += check_steady(campaign.source, test, groups[test], fit)
    return _assemble(fits, orders, warnings + clock_warnings + _check_all(campaign, fits))


def _fit_all(
    campaign: Campaign, orders: int, stretch: Mapping[str, float]
) -> tuple[dict[str, DwellFit], dict[str, tuple[ClockGroup, ...]], tuple[DataWarning, ...]]:
    """Fits and channels of the usable dwells by name, and why the others are not used."""
    fits: dict[str, DwellFit] = {}
    kept: dict[str, tuple[ClockGroup, ...]] = {}
    warnings: tuple[DataWarning, ...] = ()
    for recording in campaign.of_kind("dwell"):
        groups = group_by_clock(recording, _middle(recording), stretch)
        start, refusal = _start_frequency(campaign.source, recording, groups)
        if refusal is None:
            try:
                fit = fit_dwell(groups, ROAD, start, orders)
            except np.linalg.LinAlgError:
                what = "the time stamps do not determine the harmonics"
                remedy = "look for repeated or clustered time stamps"
                refusal = DataWarning(
                    "not_determined", what, campaign.source, recording.name, "", None, remedy
                )
        if refusal is not None:
            warnings += (refusal,)
            continue
        fits[recording.name], kept[recording.name] = fit, groups
        warnings += check_frequency(campaign.source, recording, fit.frequency)
    return fits, kept, warnings


def _check_all(campaign: Campaign, fits: Mapping[str, DwellFit]) -> tuple[DataWarning, ...]:
    return check_noise(campaign, fits) + check_folding(campaign.source, fits)


def _middle(recording: Recording) -> float:
    """Middle of the road's record [s], 0 where there is none."""
    road = recording.channels.get(ROAD)
    return 0.0 if road is None or road.time.size == 0 else 0.5 * float(road.time[0] + road.time[-1])


def _start_frequency(
    source: str, recording: Recording, groups: tuple[ClockGroup, ...]
) -> tuple[float, DataWarning | None]:
    """Where to start the frequency, or why the dwell cannot be used."""

    def refuse(code: str, what: str, remedy: str) -> tuple[float, DataWarning]:
        return 0.0, DataWarning(code, what, source, recording.name, ROAD, None, remedy)

    lead = next((group for group in groups if ROAD in group.names), None)
    if lead is None:
        return refuse(
            "no_road_motion", "no road height recorded", "map the road channel, or leave this test out"
        )
    road = lead.values[lead.names.index(ROAD)]
    if np.ptp(road) == 0.0:
        return refuse("no_road_motion", "the road does not move", "name this test a standstill")
    frequency = coarse_frequency(lead.time, road)
    periods = min(group.span_s for group in groups) * frequency
    if periods < FEWEST_PERIODS - 0.3:
        return refuse(
            "too_few_periods",
            f"{periods:.1f} periods are recorded, {FEWEST_PERIODS} are needed to tell noise from signal",
            f"record at least {FEWEST_PERIODS / frequency:.3g} s",
        )
    if highest_valid_order(lead, frequency, 1) < 1:
        return refuse(
            "too_few_samples",
            f"the road is sampled at {lead.rate_hz:.3g} Hz, too slow for {frequency:.3g} Hz",
            f"sample it at {3 * frequency:.3g} Hz or faster",
        )
    return frequency, None


def _no_dwell(campaign: Campaign, warnings: tuple[DataWarning, ...]) -> InputError:
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
    fits: Mapping[str, DwellFit], orders: int, warnings: tuple[DataWarning, ...]
) -> HarmonicResponse:
    """The record: dwells sorted by frequency, channels in canonical order, time origins moved."""
    tests = tuple(sorted(fits, key=lambda test: fits[test].frequency))
    present = {name for fit in fits.values() for name in fit.channels}
    channels = tuple(name for name in CANONICAL_UNITS if name in present)
    channels += tuple(sorted(present - set(channels)))
    shape = (len(tests), len(channels), orders + 1)
    harmonics = np.zeros(shape, dtype=np.complex128)
    covariance = np.zeros((*shape, 2, 2))
    valid = np.zeros(shape, dtype=np.bool_)
    dof = np.zeros(shape)
    noise_sd, peak, peak_sd = (np.zeros(shape[:2]) for _ in range(3))
    for d, test in enumerate(tests):
        road = fits[test].channels[ROAD]
        for name, fit in fits[test].channels.items():
            c, upto = channels.index(name), slice(0, fit.amplitude.size)
            harmonics[d, c, upto], covariance[d, c, upto] = _at_road_origin(fit, road)
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
    )


def _at_road_origin(fit: ChannelFit, road: ChannelFit) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Harmonics and covariance of (Re, Im) with the origin where the road's fundamental is real and positive.

    An error dphi of the road's phase turns X_k by -k dphi, which adds k^2 |X_k|^2 var(dphi) across it.
    """
    order = np.arange(fit.amplitude.size)
    turn = np.exp(-1j * order * np.angle(road.amplitude[1]))
    harmonics = fit.amplitude * turn
    across = order**2 * _phase_variance(road)
    if fit is road:
        harmonics[1] = abs(road.amplitude[1])
        across[1] = 0.0
    spread = fit.variance + across * np.abs(harmonics) ** 2
    skew = fit.pseudo_variance * turn**2 - across * harmonics**2
    covariance = np.empty((order.size, 2, 2))
    covariance[:, 0, 0] = 0.5 * (spread + skew.real)
    covariance[:, 1, 1] = 0.5 * (spread - skew.real)
    covariance[:, 0, 1] = covariance[:, 1, 0] = 0.5 * skew.imag
    return harmonics, covariance


def _phase_variance(road: ChannelFit) -> float:
    """Variance of the phase of the road's fundamental [rad^2]."""
    turn = np.exp(-1j * np.angle(road.amplitude[1]))
    spread = 0.5 * (road.variance[1] - (road.pseudo_variance[1] * turn**2).real)
    return float(spread / abs(road.amplitude[1]) ** 2)
