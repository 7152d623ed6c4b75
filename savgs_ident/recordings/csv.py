"""CSV campaigns: one table with a ``test`` column, or one test a file; plain or gzipped.

    test,time [s],road_height [m],susp_deflection [mm]
    dwell_0.50Hz,0.00001,-0.005737,-5.737

The unit stands in the header (``name [unit]``, ``name (unit)``, ``name_unit``) or in a row of units below it.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.channels import (
    Binding,
    ChannelMap,
    Progress,
    Reader,
    Reading,
    bind,
    unit_factor_or_si,
)
from savgs_ident.recordings.csv_head import CsvHead, read_head
from savgs_ident.recordings.csv_table import GZIP_MAGIC, CsvTable, TextBlocks
from savgs_ident.recordings.recording import (
    RecordedChannel,
    Recording,
    RecordingLayout,
    classify_test,
    normalise,
    unix_time,
)
from savgs_ident.recordings.signals import rules_for, test_of

TEST_COLUMNS = ("test", "test_name", "run", "condition")
"""Usual names of the column with the test's name."""
_MOST_REPEATS = 20
"""A test that comes back more often than this is not a repeated test but a table out of order."""


def read_csv(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one CSV file; raises :class:`InputError` where it is no table of measurements."""
    text = TextBlocks(path, progress)
    # What is refused half-way leaves no file open.
    with closing(iter(text)) as blocks:
        return _read_table(path, text, blocks, channel_map)


def _read_table(path: Path, text: TextBlocks, blocks: Iterator[bytes], channel_map: ChannelMap) -> Reading:
    source, first = str(path), next(blocks, b"")
    if not first:
        raise _nothing_whole(text, source)
    layout = channel_map.layout
    head = read_head(first, layout, source)
    warnings: list[DataWarning] = []
    candidates = head.candidates()
    time_position, time_factor = _time_column(head, channel_map, source, warnings)
    if head.skipped:
        warnings.append(
            DataWarning(
                "lines_skipped",
                f"{head.skipped} lines above the names of the columns are not read",
                source=source,
                remedy="none needed, if these are titles and remarks",
            )
        )
    rules = rules_for(candidates, channel_map, source)
    bindings, notes = bind(candidates, rules, channel_map, source)
    warnings.extend(notes)
    if not bindings:
        raise _no_channel(head, layout, source)
    positions = {int(binding.key) for binding in bindings} | {time_position}
    dates = _dates(head, time_position)
    table = CsvTable(head, tuple(sorted(positions)), _test_column(head, channel_map, source), source, dates)
    for block in _chain(head.body, blocks):
        table.append(block)
    if table.rows == 0:
        raise InputError(
            "has a header but no data", source=source, remedy="record again, or give another file"
        )
    runs = table.runs or [(test_of(path), 0)]
    columns = {position: table.take(position) for position in positions}
    # An overflow becomes infinite, which the checks report.
    with np.errstate(over="ignore", invalid="ignore"):
        time = columns[time_position] * time_factor
        channels = {binding.channel: _channel_values(columns, binding) for binding in bindings}
        recordings = _split_tests(runs, time, channels, bindings, layout)
    warnings.extend(_end_warnings(text, source, time))
    warnings.extend(_repeat_warnings(recordings, runs, source))
    return Reading(recordings, tuple(warnings))


CSV = Reader(
    name="CSV",
    suffixes=(".csv", ".csv.gz", ".tsv", ".txt"),
    magic=(GZIP_MAGIC,),
    plain_text=True,
    read=read_csv,
)


def _chain(body: bytes, blocks: Iterable[bytes]) -> Iterator[bytes]:
    if body:
        yield body
    yield from blocks


def _nothing_whole(text: TextBlocks, source: str) -> InputError:
    if text.cut:
        return InputError(f"{text.cut}, nothing in it is whole", source=source, remedy="copy the file again")
    if text.tail:
        return InputError("has a single line", source=source, remedy="give a table with a header and data")
    return InputError("is empty", source=source, remedy="record again, or give another file")


def _no_channel(head: CsvHead, layout: RecordingLayout, source: str) -> InputError:
    return InputError(
        "no column is known: found " + ", ".join(f"'{name}'" for name in head.columns[:20]),
        source=source,
        remedy="name the columns as " + ", ".join(layout.names) + ", or map them in channels.toml",
    )


def _position(head: CsvHead, wanted: str, channel: str, layout: RecordingLayout, source: str) -> int:
    """Where the column stands that the map calls ``wanted``."""
    for position, text in enumerate(head.columns):
        if wanted == text or normalise(wanted) == normalise(layout.split_header(text).label):
            return position
    raise InputError(
        f"channels.toml names column '{wanted}', the file does not have it",
        source=source,
        channel=channel,
        remedy="the columns are " + ", ".join(head.columns[:20]),
    )


def _time_column(
    head: CsvHead, channel_map: ChannelMap, source: str, warnings: list[DataWarning]
) -> tuple[int, float]:
    layout = channel_map.layout
    if channel_map.time_column is not None:
        position = _position(head, channel_map.time_column, "time", layout, source)
    else:
        labels = [layout.split_header(text).label for text in head.columns]
        found = [i for i, label in enumerate(labels) if layout.canonical_name(label) == "time"]
        if not found:
            raise InputError(
                "no column is the time: found " + ", ".join(f"'{name}'" for name in head.columns[:20]),
                source=source,
                channel="time",
                remedy="call it 'time [s]', or name it under [time] in channels.toml",
            )
        exact = [i for i in found if normalise(labels[i]) == "time"]
        position = (exact or found)[0]
    if _dates(head, position):
        return position, 1.0
    unit = channel_map.time_unit or layout.split_header(head.columns[position]).unit or head.units[position]
    return position, unit_factor_or_si(unit, "time", layout, head.columns[position], source, warnings)


def _dates(head: CsvHead, time_position: int) -> frozenset[int]:
    """The column of the time, where it holds dates and not numbers."""
    cell = head.first[time_position] if time_position < len(head.first) else ""
    looks = sum(cell.count(mark) for mark in ":-/T") >= 2 and not cell.startswith("-")
    return frozenset({time_position}) if looks else frozenset()


def _test_column(head: CsvHead, channel_map: ChannelMap, source: str) -> int | None:
    if channel_map.test_column is not None:
        return _position(head, channel_map.test_column, "test", channel_map.layout, source)
    names = [normalise(text) for text in head.columns]
    return next((names.index(name) for name in TEST_COLUMNS if name in names), None)


def _channel_values(columns: dict[int, NDArray[np.float64]], binding: Binding) -> NDArray[np.float64]:
    values = columns[int(binding.key)]
    if binding.gain == 1.0 and binding.bias == 0.0:
        return values
    return values * binding.gain + binding.bias


def _split_tests(
    runs: list[tuple[str, int]],
    time: NDArray[np.float64],
    channels: dict[str, NDArray[np.float64]],
    bindings: Sequence[Binding],
    layout: RecordingLayout,
) -> tuple[Recording, ...]:
    """One recording a run of equal test names; rows without a name belong to no test."""
    stops = [start for _, start in runs[1:]] + [time.size]
    seen: Counter[str] = Counter()
    recordings = []
    for (name, start), stop in zip(runs, stops, strict=True):
        if not name:
            continue
        seen[name] += 1
        clock = _from_zero(time[start:stop])
        kind, frequency = classify_test(name)
        recordings.append(
            Recording(
                name=name if seen[name] == 1 else f"{name}#{seen[name]}",
                kind=kind,
                frequency_hz=frequency,
                channels={
                    each.channel: RecordedChannel(
                        each.channel,
                        layout.si_unit(each.channel),
                        clock,
                        channels[each.channel][start:stop],
                        each.label,
                    )
                    for each in bindings
                },
                start=unix_time(float(time[start])),
            )
        )
    return tuple(recordings)


def _from_zero(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Time from the start of the test; a clock that already restarts there is left as it is."""
    if time.size < 2 or not np.isfinite(time[0]):
        return time
    steps = np.diff(time[np.isfinite(time)])
    starts_here = steps.size > 0 and 0.0 <= time[0] <= np.median(steps)
    return time if starts_here else time - time[0]


def _end_warnings(text: TextBlocks, source: str, time: NDArray[np.float64]) -> Iterator[DataWarning]:
    if text.cut:
        yield DataWarning(
            "truncated_file",
            f"{text.cut}, the whole lines before that are used",
            source=source,
            time=float(time[-1]),
            remedy="copy the file again",
        )
    elif text.tail.strip():
        yield DataWarning(
            "unfinished_line",
            "the last line has no line end and may be cut, it is left out",
            source=source,
            time=float(time[-1]),
            remedy="end the file with a newline",
        )


def _repeat_warnings(
    recordings: tuple[Recording, ...], runs: list[tuple[str, int]], source: str
) -> Iterator[DataWarning]:
    for name, count in Counter(name for name, _ in runs if name).items():
        if count > _MOST_REPEATS:
            raise InputError(
                f"the rows of this test are in {count} pieces",
                source=source,
                test=name,
                remedy="sort the table so that the rows of a test stand together",
            )
        if count > 1:
            yield DataWarning(
                "repeated_test",
                f"is there {count} times, kept as separate tests",
                source=source,
                test=name,
                remedy="give repeated tests their own names",
            )
    if not recordings:
        raise InputError("no row belongs to a test", source=source, remedy="fill the test column")
