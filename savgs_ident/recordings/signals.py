"""Recordings from named signals: what readers of binary formats have in common.

A file of a test lab is a list of :class:`Signal` records, each with its own clock or none. They become the channels
of a test by ``channels.toml`` or by their usual names, as the columns of a table do:

    signals = [Signal("voltage", "V", None, volts), Signal("Time", "s", None, seconds)]
    reading = reading_of([("dwell_2Hz", signals)], channel_map, "run.mat")

A signal without a clock of its own takes that of the signal which is the time, by its name or by ``[time]`` in
``channels.toml``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.channels import (
    AbsentSignalError,
    Binding,
    ChannelMap,
    ChannelRule,
    Reading,
    SignalCandidate,
    bind,
    unit_factor_or_si,
)
from savgs_ident.recordings.recording import (
    RecordedChannel,
    Recording,
    RecordingLayout,
    classify_test,
    normalise,
    unix_time,
)

_SHOWN = 20
"""Names that a message lists."""


@dataclass(frozen=True)
class Signal:
    """One signal of a file.

    Attributes:
        name: as the file has it; a unit may be written there.
        unit: that the file says besides; None if it says none.
        time: its own clock [s], (n,); None where it has none.
        values: (n,).
        start: when its clock began [s since 1970, UTC]; None if that is not known.
    """

    name: str
    unit: str | None
    time: NDArray[np.float64] | None
    values: NDArray[np.float64]
    start: float | None = None

    @property
    def candidate(self) -> SignalCandidate:
        """As what is bound to a channel."""
        return SignalCandidate(self.name, self.name, self.unit, self.name)


def test_of(path: Path) -> str:
    """The test that a file is named after: ``dwell_1.7Hz`` of ``dwell_1.7Hz.mat``.

    >>> test_of(Path("dwell_1.7Hz.csv.gz")), test_of(Path("run"))
    ('dwell_1.7Hz', 'run')
    """
    return path.name.removesuffix(".gz").rpartition(".")[0] or path.name


def reading_of(
    tests: Sequence[tuple[str, Sequence[Signal]]],
    channel_map: ChannelMap,
    source: str,
    warnings: Sequence[DataWarning] = (),
) -> Reading:
    """The recordings of named tests; raises :class:`InputError` where a test has no time or no known signal."""
    recordings, found = [], list(warnings)
    for name, signals in tests:
        recording, noted = _recording_of(name, signals, channel_map, source)
        recordings.append(recording)
        found += noted
    return Reading(tuple(recordings), tuple(dict.fromkeys(found)))


def _recording_of(
    test: str, signals: Sequence[Signal], channel_map: ChannelMap, source: str
) -> tuple[Recording, list[DataWarning]]:
    layout = channel_map.layout
    warnings: list[DataWarning] = []
    clock = _clock(signals, channel_map, source, warnings)
    usable = {each.name: each for each in signals if each.time is not None or _suits(each, clock)}
    candidates = tuple(each.candidate for each in usable.values())
    bindings, noted = bind(candidates, rules_for(candidates, channel_map, source), channel_map, source)
    if not bindings:
        raise InputError(
            "no signal is known: found " + _listed(usable),
            source=source,
            test=test,
            remedy="name them as " + ", ".join(layout.names) + ", or map them in channels.toml",
        )
    missing = [each.label for each in bindings if usable[each.key].time is None and clock is None]
    if missing:
        raise InputError(
            f"'{missing[0]}' has no time: found " + _listed(usable),
            source=source,
            test=test,
            channel="time",
            remedy="call a signal 'time', or name it under [time] in channels.toml",
        )
    used = {each.key: usable[each.key] for each in bindings}
    times = {key: clock if each.time is None else each.time for key, each in used.items()}
    begin = min((float(each[0]) for each in times.values() if each is not None and each.size), default=0.0)
    start = next((each.start for each in used.values() if each.start is not None), unix_time(begin))
    channels = {
        each.channel: _channel(each, usable[each.key], times[each.key], begin, layout) for each in bindings
    }
    kind, frequency = classify_test(test)
    return Recording(test, kind, frequency, channels, start), [*warnings, *noted]


def _listed(signals: Mapping[str, Signal]) -> str:
    return ", ".join(f"'{name}'" for name in list(signals)[:_SHOWN]) or "none"


def _suits(signal: Signal, clock: NDArray[np.float64] | None) -> bool:
    """Whether a signal without a clock may be one of samples at all, and has as many as the time has."""
    return signal.values.size > 1 and (clock is None or signal.values.size == clock.size)


def _clock(
    signals: Sequence[Signal], channel_map: ChannelMap, source: str, warnings: list[DataWarning]
) -> NDArray[np.float64] | None:
    """The signal that is the time [s], for those that have none of their own; None where there is none."""
    layout, wanted = channel_map.layout, channel_map.time_column
    if wanted is not None:
        found = [each for each in signals if wanted in (each.name, layout.split_header(each.name).label)]
        if not found and all(each.time is not None for each in signals):
            # A folder may have files of several formats, and one map.
            return None
        if not found:
            raise InputError(
                f"channels.toml names '{wanted}' as the time, the file does not have it",
                source=source,
                channel="time",
                remedy="the signals are " + ", ".join(each.name for each in signals[:_SHOWN]),
            )
    else:
        found = [
            each for each in signals if layout.canonical_name(layout.split_header(each.name).label) == "time"
        ]
        found.sort(key=lambda each: normalise(layout.split_header(each.name).label) != "time")
    if not found:
        return None
    signal = found[0]
    unit = channel_map.time_unit or layout.split_header(signal.name).unit or signal.unit
    return signal.values * unit_factor_or_si(unit, "time", layout, signal.name, source, warnings)


def _channel(
    binding: Binding,
    signal: Signal,
    time: NDArray[np.float64] | None,
    begin: float,
    layout: RecordingLayout,
) -> RecordedChannel:
    assert time is not None
    with np.errstate(over="ignore", invalid="ignore"):
        values, since = signal.values * binding.gain + binding.bias, time - begin
    return RecordedChannel(binding.channel, layout.si_unit(binding.channel), since, values, binding.label)


def rules_for(
    candidates: Sequence[SignalCandidate], channel_map: ChannelMap, source: str
) -> list[tuple[ChannelRule, str]]:
    """The rules of the map that name a column, each with the key of its signal.

    Raises :class:`AbsentSignalError` for a column that the file does not have.
    """
    layout, found = channel_map.layout, []
    for rule in channel_map.rules:
        if rule.column is None:
            continue
        exact = [c.key for c in candidates if c.text == rule.column]
        wanted = normalise(rule.column)
        loose = [c.key for c in candidates if normalise(layout.split_header(c.text).label) == wanted]
        if not exact and not loose:
            raise AbsentSignalError(
                f"channels.toml names column '{rule.column}', the file does not have it",
                source=source,
                channel=rule.channel,
                remedy="the columns are " + ", ".join(c.text for c in candidates[:_SHOWN]),
            )
        found.append((rule, (exact or loose)[0]))
    return found


def without_clash(signals: Sequence[Signal]) -> list[Signal]:
    """The signals, those of a name that is there already with a number behind it."""
    seen: dict[str, int] = {}
    kept = []
    for each in signals:
        seen[each.name] = seen.get(each.name, 0) + 1
        count = seen[each.name]
        kept.append(each if count == 1 else replace(each, name=f"{each.name}#{count}"))
    return kept
