"""Checks of one test as a whole: does it have the channels that a response needs, for long enough, and does
the road move as the test's name says."""

import numpy as np

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.checks_values import longest_constant
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Channel, Recording

RESPONSES = ("sprung_accel", "susp_deflection")
"""Channels of which a test with a moving road needs at least one."""

_FEWEST_PERIODS, _FEW_PERIODS = 3.0, 6.0
"""Fewer periods leave no estimate of what does not repeat; few leave a poor one."""
_FREQUENCY_OFF = 0.05
_LEAST_RATE = 4.0
"""Samples a period below which even the first harmonic is doubtful."""
_STILL = 1e-3
"""Peak-to-peak road [m] that a standstill may have."""
_STUCK_SHARE = 0.20


def stuck_channels(recording: Recording, place: Place) -> dict[str, DataWarning]:
    """Channels that stand still while the test goes on, with a warning each.

    In a steady oscillation nothing is constant for a whole period; elsewhere a fifth of the record is the
    bound, because a sweep begins at rest. The link may be held, so its channels are not judged.
    """
    if recording.kind not in ("dwell", "sweep"):
        return {}
    found = {}
    for name in ("road_height", *RESPONSES):
        channel = recording.channels.get(name)
        if channel is None:
            continue
        length, start = longest_constant(channel)
        allowed = _STUCK_SHARE * recording.duration_s
        if recording.kind == "dwell" and recording.frequency_hz:
            allowed = min(allowed, 1.0 / recording.frequency_hz)
        if length > allowed:
            found[name] = Place(place.source, place.test, name).warning(
                "stuck_sensor",
                f"keeps one value for {length:.3g} s while the test goes on, left out of this test",
                "check the sensor",
                time=start,
            )
    return found


def check_complete(recording: Recording, place: Place) -> None:
    """Raises :class:`InputError` where a test with a moving road lacks the road or every response."""
    if recording.kind not in ("dwell", "sweep"):
        return
    here = ", ".join(recording.channels) or "none"
    if "road_height" not in recording.channels:
        raise Place(place.source, place.test, "road_height").error(
            f"the channel is missing or unusable (there is: {here})", "record it, or map it in channels.toml"
        )
    if not any(name in recording.channels for name in RESPONSES):
        raise Place(place.source, place.test, RESPONSES[0]).error(
            f"neither {' nor '.join(RESPONSES)} is there and usable (there is: {here})",
            "record one of them, or map it in channels.toml",
        )


def check_test(recording: Recording, place: Place) -> tuple[DataWarning, ...]:
    """What a dwell or a standstill has to say; raises :class:`InputError` for a dwell that is too short."""
    if recording.kind == "standstill":
        return _check_still(recording, place)
    if recording.kind != "dwell":
        return ()
    measured = measured_frequency(recording.channels["road_height"])
    told = recording.frequency_hz
    frequency = told or measured
    periods = recording.duration_s * frequency
    if periods < _FEWEST_PERIODS:
        raise place.error(
            f"the dwell holds {periods:.1f} periods in {recording.duration_s:.2f} s, too few for a response",
            f"record at least {_FEWEST_PERIODS:.0f} periods, better 8 and more",
        )
    return (
        *_few_periods(periods, place),
        *_frequency_off(told, measured, place),
        *_undersampled(recording, frequency, place),
    )


def measured_frequency(road: Channel) -> float:
    """Frequency [Hz] of the road from its upward crossings of mid height (hysteresis a fifth of its travel).

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


def _few_periods(periods: float, place: Place) -> tuple[DataWarning, ...]:
    if periods >= _FEW_PERIODS:
        return ()
    return (
        place.warning(
            "few_periods",
            f"the dwell holds only {periods:.1f} periods, its noise is poorly known",
            "record at least 8 periods",
        ),
    )


def _frequency_off(told: float | None, measured: float, place: Place) -> tuple[DataWarning, ...]:
    if told is None or abs(measured / told - 1.0) <= _FREQUENCY_OFF:
        return ()
    return (
        Place(place.source, place.test, "road_height").warning(
            "frequency_mismatch",
            f"the road moves at {measured:.4g} Hz, the test is said to be at {told:.4g} Hz",
            "check the name of the test and the unit of the time",
        ),
    )


def _undersampled(recording: Recording, frequency: float, place: Place) -> tuple[DataWarning, ...]:
    return tuple(
        Place(place.source, place.test, name).warning(
            "undersampled",
            f"has {channel.rate_hz / frequency:.1f} samples a period",
            f"sample at least {_LEAST_RATE:.0f} times a period",
        )
        for name, channel in recording.channels.items()
        if name in ("road_height", *RESPONSES) and channel.rate_hz < _LEAST_RATE * frequency
    )


def _check_still(recording: Recording, place: Place) -> tuple[DataWarning, ...]:
    road = recording.channels.get("road_height")
    if road is None or np.ptp(road.values) <= _STILL:
        return ()
    return (
        Place(place.source, place.test, "road_height").warning(
            "standstill_moves",
            f"the road moves by {1e3 * float(np.ptp(road.values)):.3g} mm in a standstill",
            "check the name of the test",
        ),
    )
