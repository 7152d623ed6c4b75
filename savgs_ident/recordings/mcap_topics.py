"""Topics of an MCAP file cut into tests: each topic has its clock, each test the samples between its events."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.channels import Binding, ChannelMap
from savgs_ident.recordings.mcap_timing import Span, choose_clock
from savgs_ident.recordings.recording import (
    RecordedChannel,
    Recording,
    RecordingLayout,
    classify_test,
    unix_time,
)


@dataclass(frozen=True)
class TopicData:
    """Everything read from a topic: clocks [ns] and channels (SI), all (n,), in order of log time."""

    topic: str
    bindings: tuple[Binding, ...]
    log: NDArray[np.int64]
    publish: NDArray[np.int64]
    header: NDArray[np.int64] | None
    values: dict[str, NDArray[np.float64]]

    def in_order(self, order: NDArray[np.intp]) -> "TopicData":
        """The same samples in another ``order``, (n,)."""
        log = self.log[order]
        return replace(
            self,
            log=log,
            publish=log if self.publish is self.log else self.publish[order],
            header=None if self.header is None else self.header[order],
            values={name: column[order] for name, column in self.values.items()},
        )


def split_tests(
    topics: tuple[TopicData, ...], spans: tuple[Span, ...], channel_map: ChannelMap, path: Path
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """The channels of every test, with time from its start [s]; samples outside every test are dropped."""
    source = str(path)
    times: list[NDArray[np.int64]] = []
    warnings: list[DataWarning] = []
    for data in topics:
        choice = choose_clock(
            data.log, data.publish, data.header, topic=data.topic, source=source, forced=channel_map.clock
        )
        times.append(choice.time)
        warnings.extend(choice.warnings)
    if not spans:
        start = min(int(time.min()) for time in times)
        spans = (Span(path.stem, start, None, None),)
    by_topic = [_samples_of(spans, time) for time in times]
    recordings = []
    for number, span in enumerate(spans):
        channels: dict[str, RecordedChannel] = {}
        for data, mine in zip(topics, by_topic, strict=True):
            channels |= _channels_of(data, mine[number], channel_map.layout)
        kind, named = classify_test(span.name)
        frequency = span.frequency_hz if span.frequency_hz is not None else named
        kind = "dwell" if kind == "other" and frequency is not None else kind
        frequency = frequency if kind == "dwell" else None
        recordings.append(Recording(span.name, kind, frequency, channels, unix_time(1e-9 * span.start)))
    return tuple(recordings), tuple(warnings)


class _Samples(NamedTuple):
    """Places of the samples of a test in their topic, and their time from its start [s], (n,)."""

    where: slice | NDArray[np.intp]
    time: NDArray[np.float64]


def _samples_of(spans: Sequence[Span], time: NDArray[np.int64]) -> list[_Samples]:
    """The samples of each test, by their ``time`` [ns], which is overwritten: a clock of the topic is lost with it.

    Seconds of tests one after the other stand where the nanoseconds stood: both together would take twice the memory.
    """
    places = [_places_within(span, time) for span in spans]
    ends = [(each.start, each.stop) for each in places if isinstance(each, slice)]
    apart = len(ends) == len(places) and all(
        before[1] <= after[0] for before, after in pairwise(sorted(ends))
    )
    seconds = time.view(np.float64) if apart else np.empty(0)
    found = []
    for span, where in zip(spans, places, strict=True):
        since = 1e-9 * (time[where] - span.start).astype(np.float64)
        if apart:
            seconds[where] = since
            since = seconds[where]
        found.append(_Samples(where, since))
    return found


def _places_within(span: Span, time: NDArray[np.int64]) -> slice | NDArray[np.intp]:
    inside = time >= span.start
    if span.stop is not None:
        inside &= time <= span.stop
    picked = np.flatnonzero(inside)
    if picked.size == 0:
        return slice(0, 0)
    whole = slice(int(picked[0]), int(picked[-1]) + 1)
    return whole if whole.stop - whole.start == picked.size else picked


def _channels_of(data: TopicData, samples: _Samples, layout: RecordingLayout) -> dict[str, RecordedChannel]:
    if not samples.time.size:
        return {}
    return {
        binding.channel: RecordedChannel(
            binding.channel,
            layout.si_unit(binding.channel),
            samples.time,
            data.values[binding.channel][samples.where],
            binding.label,
        )
        for binding in data.bindings
    }
