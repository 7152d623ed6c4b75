"""All checks of a campaign: clean every test, and leave out the tests that cannot be used.

:func:`screen` checks the channels (:mod:`checks_signal`), then every test as a whole (the channels that a
response needs, for long enough, the driven channel moving at the frequency in the test's name), then the campaign by
what the layout knows of its plant. A test that cannot be used is left out with a warning that gives the reason; if no
test remains, the first reason is raised as the error.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

import numpy as np

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.threads import in_parallel
from savgs_ident.recordings.checks_signal import (
    LONGEST_GAP,
    DataLocation,
    check_clipping,
    check_missing,
    check_possible,
    check_stamps,
    check_time,
    find_longest_constant,
    ordinary_samples,
)
from savgs_ident.recordings.recording import RecordedChannel, Recording, RecordingLayout

_FEWEST_PERIODS, _FEW_PERIODS = 3.0, 6.0
"""Periods below which the noise (what does not repeat) cannot be estimated, or is estimated poorly."""
_FREQUENCY_OFF = 0.05
_SPIKE_FILTER = 11
"""Samples of the median that passes no spike and no dropout of five samples."""
_LEAST_RATE = 4.0
"""Samples a period below which even the first harmonic is doubtful."""
_STUCK_SHARE = 0.20


def screen(
    recordings: Sequence[Recording], layout: RecordingLayout, source: str
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """The usable recordings, cleaned, and all warnings.

    Raises :class:`InputError` where none is usable.
    """
    kept: list[Recording] = []
    warnings: list[DataWarning] = []
    errors: list[InputError] = []

    def screened(
        recording: Recording,
    ) -> tuple[Recording, tuple[DataWarning, ...]] | InputError:
        try:
            return screen_test(recording, layout, source)
        except InputError as error:
            return error

    for each in in_parallel(screened, recordings):
        if isinstance(each, InputError):
            errors.append(each)
            continue
        kept.append(each[0])
        warnings.extend(each[1])
    if not kept:
        raise errors[0] if errors else InputError("holds no test", source=source, remedy="record again")
    corrected = tuple(kept)
    for correct in layout.corrections:
        corrected, found = correct(corrected, source)
        warnings.extend(found)
    return corrected, (
        *(_left_out(error) for error in errors),
        *warnings,
        *check_clipping(corrected, source),
        *(warning for check in layout.checks for warning in check(corrected, source)),
    )


def screen_test(
    recording: Recording, layout: RecordingLayout, source: str
) -> tuple[Recording, tuple[DataWarning, ...]]:
    """One test with cleaned channels in the layout's order; raises :class:`InputError` where it cannot be used."""
    channels: dict[str, RecordedChannel] = {}
    warnings: list[DataWarning] = []
    longest_gap = inf if recording.kind == "other" else LONGEST_GAP
    for name in (name for name in layout.names if name in recording.channels):
        channel = recording.channels[name]
        place = DataLocation(source, recording.name, name)
        check_stamps(channel, DataLocation(source, recording.name, "time"))
        whole, found = check_missing(channel, place, longest_gap)
        warnings.extend(found)
        if whole is None:
            continue
        ordered, found = check_time(whole, place, longest_gap, layout.slowest_hz)
        warnings.extend(found)
        channels[name], found = check_possible(ordered, layout.specs[name], place)
        warnings.extend(found)
    place = DataLocation(source, recording.name)
    cleaned = replace(recording, channels=channels)
    stuck = find_stuck_channels(cleaned, layout, place)
    cleaned = replace(cleaned, channels={k: v for k, v in channels.items() if k not in stuck})
    check_complete(cleaned, layout, place)
    if not cleaned.channels:
        raise place.error("has no channel with data", "record the test again")
    return cleaned, (
        *_once(warnings),
        *stuck.values(),
        *check_test(cleaned, layout, place),
        *_unknown(cleaned, place),
    )


def find_stuck_channels(
    recording: Recording, layout: RecordingLayout, place: DataLocation
) -> dict[str, DataWarning]:
    """Channels that keep one value while the test goes on, with a warning each.

    In a steady oscillation nothing is constant for a whole period; in a sweep the bound is a fifth of the record,
    because it begins at rest. Other channels than the driven one and the responses may be held, and are not checked.
    """
    if recording.kind not in ("dwell", "sweep"):
        return {}
    found = {}
    for name in (layout.driven, *layout.responses):
        channel = recording.channels.get(name)
        if channel is None:
            continue
        length, start = find_longest_constant(channel)
        allowed = _STUCK_SHARE * recording.duration_s
        if recording.kind == "dwell" and recording.frequency_hz:
            allowed = min(allowed, 1.0 / recording.frequency_hz)
        if length > allowed:
            found[name] = DataLocation(place.source, place.test, name).warning(
                "stuck_sensor",
                f"keeps one value for {length:.3g} s while the test goes on, left out of this test",
                "check the sensor",
                time=start,
            )
    return found


def check_complete(recording: Recording, layout: RecordingLayout, place: DataLocation) -> None:
    """Raises :class:`InputError` where a dwell or a sweep lacks the driven channel or all responses."""
    if recording.kind not in ("dwell", "sweep"):
        return
    here = ", ".join(recording.channels) or "none"
    if layout.driven not in recording.channels:
        raise DataLocation(place.source, place.test, layout.driven).error(
            f"the channel is missing or unusable (there is: {here})", "record it, or map it in channels.toml"
        )
    if not any(name in recording.channels for name in layout.responses):
        raise DataLocation(place.source, place.test, layout.responses[0]).error(
            f"neither {' nor '.join(layout.responses)} is there and usable (there is: {here})",
            "record one of them, or map it in channels.toml",
        )


def check_test(recording: Recording, layout: RecordingLayout, place: DataLocation) -> tuple[DataWarning, ...]:
    """Warnings about a dwell or a standstill; raises :class:`InputError` for a dwell that is too short."""
    if recording.kind == "standstill":
        return _check_still(recording, layout, place)
    if recording.kind != "dwell":
        return ()
    nominal = recording.frequency_hz
    measured = _frequency_near(recording.channels[layout.driven], nominal)
    frequency = nominal or measured
    periods = recording.duration_s * frequency
    if periods < _FEWEST_PERIODS:
        raise place.error(
            f"the dwell holds {periods:.1f} periods in {recording.duration_s:.2f} s, too few for a response",
            f"record at least {_FEWEST_PERIODS:.0f} periods, better 8 and more",
        )
    return (
        *_few_periods(periods, place),
        *_frequency_off(nominal, measured, DataLocation(place.source, place.test, layout.driven)),
        *_undersampled(recording, frequency, layout, place),
    )


def measure_frequency(road: RecordedChannel) -> float:
    """Frequency [Hz] of the driven channel from its upward crossings of mid height (hysteresis 1/5 of its travel).

    0 where it does not cross twice.
    """
    values = road.values - 0.5 * (road.values.max() + road.values.min())
    band = 0.1 * float(np.ptp(road.values))
    state = np.where(values > band, 1, np.where(values < -band, -1, 0))
    firm = np.flatnonzero(state)
    up = firm[1:][np.diff(state[firm]) == 2]
    if up.size < 2:
        return 0.0
    return float((up.size - 1) / (road.time[up[-1]] - road.time[up[0]]))


def _frequency_near(road: RecordedChannel, nominal: float | None) -> float:
    """Frequency [Hz] of the driven channel; without its spikes where only so it is ``nominal`` [Hz]."""
    measured = measure_frequency(ordinary_samples(road))
    if nominal is not None and abs(measured / nominal - 1.0) > _FREQUENCY_OFF:
        # A fifth of a second and 20 MB to import, for recordings with spikes alone.
        from scipy.ndimage import median_filter

        smooth = measure_frequency(replace(road, values=median_filter(road.values, _SPIKE_FILTER)))
        if abs(smooth / nominal - 1.0) <= _FREQUENCY_OFF:
            return smooth
    return measured


def _few_periods(periods: float, place: DataLocation) -> tuple[DataWarning, ...]:
    if periods >= _FEW_PERIODS:
        return ()
    return (
        place.warning(
            "few_periods",
            f"the dwell holds only {periods:.1f} periods, its noise is poorly known",
            "record at least 8 periods",
        ),
    )


_TIMES = {"ms": 1e3, "us": 1e6}
_NEARLY = 0.05


def _frequency_off(nominal: float | None, measured: float, place: DataLocation) -> tuple[DataWarning, ...]:
    if nominal is None or abs(measured / nominal - 1.0) <= _FREQUENCY_OFF:
        return ()
    taken = [unit for unit, factor in _TIMES.items() if abs(nominal / measured / factor - 1.0) <= _NEARLY]
    as_if = f", as if its time were in {taken[0]} and had been read as s" if taken else ""
    return (
        place.warning(
            "frequency_mismatch",
            f"moves at {measured:.4g} Hz, the test is said to be at {nominal:.4g} Hz{as_if}",
            "check the name of the test and the unit of the time",
        ),
    )


def _undersampled(
    recording: Recording, frequency: float, layout: RecordingLayout, place: DataLocation
) -> tuple[DataWarning, ...]:
    return tuple(
        DataLocation(place.source, place.test, name).warning(
            "undersampled",
            f"has {channel.rate_hz / frequency:.1f} samples a period",
            f"sample at least {_LEAST_RATE:.0f} times a period",
        )
        for name, channel in recording.channels.items()
        if name in (layout.driven, *layout.responses) and channel.rate_hz < _LEAST_RATE * frequency
    )


def _check_still(
    recording: Recording, layout: RecordingLayout, place: DataLocation
) -> tuple[DataWarning, ...]:
    driven = recording.channels.get(layout.driven)
    if driven is None or (travel := float(np.ptp(ordinary_samples(driven).values))) <= layout.still:
        return ()
    return (
        DataLocation(place.source, place.test, layout.driven).warning(
            "standstill_moves",
            f"moves by {travel:.3g} {driven.unit} in a standstill",
            "check the name of the test",
        ),
    )


def _once(warnings: list[DataWarning]) -> tuple[DataWarning, ...]:
    """Channels of one table share their clock: a warning about the clock is given once."""
    seen: dict[tuple[str, str, float | None], DataWarning] = {}
    for warning in warnings:
        about_clock = warning.code in ("repeated_time", "time_jump")
        key = (warning.code, warning.what if about_clock else warning.channel, warning.time)
        seen.setdefault(key, warning)
    return tuple(seen.values())


def _left_out(error: InputError) -> DataWarning:
    return DataWarning(
        "test_left_out",
        f"{error.what}; the test is left out",
        error.source,
        error.test,
        error.channel,
        error.time,
        error.remedy,
    )


def _unknown(recording: Recording, place: DataLocation) -> tuple[DataWarning, ...]:
    if recording.kind != "other":
        return ()
    return (
        place.warning(
            "test_kind_unknown",
            "what kind of test this is does not follow from its name; without dwells it is taken for a road",
            "call it dwell_<f>Hz, sweep..., road..., step..., decay... or standstill, by events, a test column or "
            "the file",
        ),
    )
