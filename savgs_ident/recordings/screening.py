"""All checks over a campaign. What is wrong with one test costs that test, not the afternoon.

A test that cannot be used is left out with a warning that says why; if no test is left, the first reason is
the error.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.checks_clipping import check_clipping
from savgs_ident.recordings.checks_physics import check_physics
from savgs_ident.recordings.checks_record import check_complete, check_test, stuck_channels
from savgs_ident.recordings.checks_time import LONGEST_GAP, check_stamps, check_time
from savgs_ident.recordings.checks_values import check_missing, check_possible
from savgs_ident.recordings.gravity import remove_gravity
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Channel, Recording


def screen(
    recordings: Sequence[Recording], source: str
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """The recordings that can be used, cleaned, and everything the checks found.

    Raises :class:`InputError` where none can be used.
    """
    kept: list[Recording] = []
    warnings: list[DataWarning] = []
    errors: list[InputError] = []
    for recording in recordings:
        try:
            cleaned, found = screen_test(recording, source)
        except InputError as error:
            errors.append(error)
            continue
        kept.append(cleaned)
        warnings.extend(found)
    if not kept:
        raise errors[0] if errors else InputError("holds no test", source=source, remedy="record again")
    level, gravity = remove_gravity(kept, source)
    return level, (
        *(_left_out(error) for error in errors),
        *warnings,
        *gravity,
        *check_clipping(level, source),
        *check_physics(level, source),
    )


def screen_test(recording: Recording, source: str) -> tuple[Recording, tuple[DataWarning, ...]]:
    """One test with cleaned channels; raises :class:`InputError` where it cannot be used."""
    channels: dict[str, Channel] = {}
    warnings: list[DataWarning] = []
    longest_gap = inf if recording.kind == "other" else LONGEST_GAP
    for name, channel in recording.channels.items():
        place = Place(source, recording.name, name)
        check_stamps(channel, Place(source, recording.name, "time"))
        whole, found = check_missing(channel, place, longest_gap)
        warnings.extend(found)
        if whole is None:
            continue
        ordered, found = check_time(whole, place, longest_gap)
        warnings.extend(found)
        check_possible(ordered, place)
        channels[name] = ordered
    place = Place(source, recording.name)
    cleaned = replace(recording, channels=channels)
    stuck = stuck_channels(cleaned, place)
    cleaned = replace(cleaned, channels={k: v for k, v in channels.items() if k not in stuck})
    check_complete(cleaned, place)
    if not cleaned.channels:
        raise place.error("has no channel with data", "record the test again")
    return cleaned, (
        *_once(warnings),
        *stuck.values(),
        *check_test(cleaned, place),
        *_unknown(cleaned, place),
    )


def _once(warnings: list[DataWarning]) -> tuple[DataWarning, ...]:
    """Channels of one table share their clock: what is said of the clock is said once."""
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


def _unknown(recording: Recording, place: Place) -> tuple[DataWarning, ...]:
    if recording.kind != "other":
        return ()
    return (
        place.warning(
            "test_kind_unknown",
            "what kind of test this is cannot be told from its name",
            "call it dwell_<f>Hz, sweep... or standstill, by events, a test column or the file's name",
        ),
    )
