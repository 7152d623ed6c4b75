"""Time in an MCAP file: when a sample was taken, and when a test began and ended.

A message carries up to three times: the stamp in its header (set by the driver of the sensor), the publish time
and the log time (set when the message reached the recorder). A sensor samples regularly, a network delivers in
bursts; so :func:`choose_clock` takes the clock with regular increments. Irregularity is the 10-90 % spread of
the increments over their median: about 0.1 for a jittered sensor, above 1 for bursts.

Tests are marked by events on a topic of their own, in one of two usual forms: a ROS 2 ``std_msgs/String`` with
``start dwell_2Hz`` / ``end dwell_2Hz``, or JSON
``{"test": "dwell_2Hz", "event": "start", "frequency_hz": 2.0}``. :func:`pair_events` makes them into spans.
"""

import json
import re
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning

_BURSTY = 0.5
"""Irregularity above which a clock shows deliveries rather than samples."""
_CLOCK_SAMPLES = 1 << 17
"""Samples from which the irregularity is computed: enough, and no more memory for a longer file."""
_MARGIN = 2.0
"""The header clock is left only for one that is this much more regular."""
_SAME_EPOCH_NS = 2_000_000_000
"""Header and log time further apart than this do not count from the same instant."""


@dataclass(frozen=True)
class ClockChoice:
    """The time of every sample [ns, on the scale of the log time], (n,), the clock's name, and warnings."""

    time: NDArray[np.int64]
    name: str
    warnings: tuple[DataWarning, ...]


def choose_clock(
    log: NDArray[np.int64],
    publish: NDArray[np.int64],
    header: NDArray[np.int64] | None,
    *,
    topic: str,
    source: str,
    forced: str | None = None,
) -> ClockChoice:
    """Choose among the clocks of one topic, all of shape (n,) in [ns]; ``forced`` names the one to take."""
    clocks = {"log": log} if publish is log else {"publish": publish, "log": log}
    if header is not None:
        clocks = {"header": header} | clocks
    spread = {name: irregularity(time) for name, time in clocks.items()}
    name = forced if forced in clocks else _most_trusted(spread)
    warnings = []
    if forced not in clocks and header is not None and max(spread.values()) > _BURSTY and log.size > 2:
        warnings.append(_clock_warning(name, spread, topic, source))
    time, moved = _on_log_scale(clocks[name], log)
    if moved:
        warnings.append(
            DataWarning(
                "clock_offset",
                f"the {name} clock differs from the log time by {moved * 1e-9:.3f} s, moved onto it",
                source=source,
                channel=topic,
                remedy="synchronise the sensor's clock with the recorder's",
            )
        )
    return ClockChoice(time, name, tuple(warnings))


def irregularity(time: NDArray[np.int64]) -> float:
    """10-90 % spread of the increments of a clock (n,) over their median [1].

    Infinite where the clock stands still.
    """
    if time.size < 3:
        return inf
    low, middle, high = np.quantile(np.diff(time[:_CLOCK_SAMPLES]), [0.1, 0.5, 0.9])
    return float((high - low) / middle) if middle > 0 else inf


def _most_trusted(spread: dict[str, float]) -> str:
    """The first of header, publish, log to which no later one is more regular by the margin."""
    best = next(iter(spread))
    for name, value in spread.items():
        if spread[best] > _MARGIN * value and spread[best] > _BURSTY / _MARGIN:
            best = name
    return best


def _clock_warning(name: str, spread: dict[str, float], topic: str, source: str) -> DataWarning:
    shown = ", ".join(f"{clock} {value:.2f}" for clock, value in spread.items())
    return DataWarning(
        "clock_choice",
        f"its clocks disagree; the {name} clock is taken as the most regular (irregularity: {shown})",
        source=source,
        channel=topic,
        remedy='if another is right, set clock = "header", "log" or "publish" under [time] in channels.toml',
    )


def _on_log_scale(time: NDArray[np.int64], log: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """A clock of another epoch moved by the smallest delay seen; 0 where it has the same epoch."""
    if time is log:
        return time, 0
    delay = log - time
    if abs(int(np.median(delay))) < _SAME_EPOCH_NS:
        return time, 0
    offset = int(delay.min())
    return time + offset, offset


_TOPIC_ENDS = ("test", "tests", "test_event", "test_events", "event", "events")
_EVENT_TEXT = re.compile(r"^\s*(start|begin|end|stop)\b[\s:]+(\S.*?)\s*$", re.IGNORECASE)
_LARGEST_HZ = 1e6
_STARTS = ("start", "begin")
_ENDS = ("end", "stop")


@dataclass(frozen=True)
class Event:
    """``time`` [ns] at which the test ``name`` starts or ends; ``frequency_hz`` if the event gives it."""

    time: int
    name: str
    is_start: bool
    frequency_hz: float | None = None


@dataclass(frozen=True)
class Span:
    """A test from ``start`` to ``stop`` [ns], both included; ``stop`` None: to the end of the data."""

    name: str
    start: int
    stop: int | None
    frequency_hz: float | None


def looks_like_events(topic: str) -> bool:
    """Whether a topic's name is a usual one for test events."""
    return topic.rstrip("/").rpartition("/")[2].lower() in _TOPIC_ENDS


def parse_event(payload: bytes, encoding: str, time: int) -> Event | None:
    """The event in a message, or None where it is something else."""
    if encoding == "json":
        return _from_json(payload, time)
    text = _cdr_string(payload)
    match = _EVENT_TEXT.match(text) if text is not None else None
    return Event(time, match[2], match[1].lower() in _STARTS) if match else None


def _from_json(payload: bytes, time: int) -> Event | None:
    try:
        message = json.loads(payload)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict):
        return None
    name, event, frequency = (message.get(key) for key in ("test", "event", "frequency_hz"))
    if not isinstance(name, str) or not name.strip() or event not in (*_STARTS, *_ENDS):
        return None
    return Event(time, name.strip(), event in _STARTS, _positive(frequency))


def _positive(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if 0.0 < value < _LARGEST_HZ else None


def _cdr_string(payload: bytes) -> str | None:
    if len(payload) < 8 or payload[1] > 7:
        return None
    (length,) = struct.unpack_from("<I" if payload[1] & 1 else ">I", payload, 4)
    return payload[8 : 8 + length].rstrip(b"\x00").decode("utf-8", errors="replace")


def pair_events(events: Sequence[Event], source: str) -> tuple[tuple[Span, ...], tuple[DataWarning, ...]]:
    """Pair starts with ends. A test without its end runs to the next start (or the end of the data)."""
    spans: list[Span] = []
    warnings: list[DataWarning] = []
    open_span: Span | None = None
    for event in sorted(events, key=lambda event: event.time):
        if event.is_start:
            if open_span is not None:
                spans.append(replace(open_span, stop=event.time - 1))
                warnings.append(
                    _unpaired("has no end event, taken to end at the next start", open_span.name, source)
                )
            open_span = Span(event.name, event.time, None, event.frequency_hz)
        elif open_span is not None and open_span.name == event.name:
            spans.append(replace(open_span, stop=event.time))
            open_span = None
        else:
            warnings.append(
                _unpaired("has an end event without a start, which is ignored", event.name, source)
            )
    if open_span is not None:
        spans.append(open_span)
        warnings.append(
            _unpaired("has no end event, taken to last to the end of the data", open_span.name, source)
        )
    return _unique(spans), tuple(warnings)


def _unique(spans: list[Span]) -> tuple[Span, ...]:
    seen: Counter[str] = Counter()
    named = []
    for span in spans:
        seen[span.name] += 1
        named.append(span if seen[span.name] == 1 else replace(span, name=f"{span.name}#{seen[span.name]}"))
    return tuple(named)


def _unpaired(what: str, test: str, source: str) -> DataWarning:
    return DataWarning(
        "unpaired_event",
        what,
        source=source,
        test=test,
        remedy="log a start and an end event for every test",
    )
