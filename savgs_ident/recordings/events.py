"""Where each test begins and ends in an MCAP file: events on a topic of their own.

Two usual forms: a ROS 2 ``std_msgs/String`` with ``start dwell_2Hz`` / ``end dwell_2Hz``, and JSON
``{"test": "dwell_2Hz", "event": "start", "frequency_hz": 2.0}``.
"""

import json
import re
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from savgs_ident.core.errors import DataWarning

_TOPIC_ENDS = ("test", "tests", "test_event", "test_events", "event", "events")
_SPOKEN = re.compile(r"^\s*(start|begin|end|stop)\b[\s:]+(\S.*?)\s*$", re.IGNORECASE)
_LARGEST_HZ = 1e6
_STARTS = ("start", "begin")
_ENDS = ("end", "stop")


@dataclass(frozen=True)
class Event:
    """``time`` [ns] at which the test ``name`` starts or ends; ``frequency_hz`` if the event tells it."""

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
    """Whether a topic's name says that it carries test events."""
    return topic.rstrip("/").rpartition("/")[2].lower() in _TOPIC_ENDS


def parse_event(payload: bytes, encoding: str, time: int) -> Event | None:
    """The event in a message, or None where it is something else."""
    if encoding == "json":
        return _from_json(payload, time)
    text = _cdr_string(payload)
    match = _SPOKEN.match(text) if text is not None else None
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


def spans_of(events: Sequence[Event], source: str) -> tuple[tuple[Span, ...], tuple[DataWarning, ...]]:
    """Pair starts with ends. A test without its end runs to the next start (or the end of the data)."""
    spans: list[Span] = []
    warnings: list[DataWarning] = []
    open_span: Span | None = None
    for event in sorted(events, key=lambda event: event.time):
        if event.is_start:
            if open_span is not None:
                spans.append(replace(open_span, stop=event.time - 1))
                warnings.append(
                    _lonely("has no end event, taken to end at the next start", open_span.name, source)
                )
            open_span = Span(event.name, event.time, None, event.frequency_hz)
        elif open_span is not None and open_span.name == event.name:
            spans.append(replace(open_span, stop=event.time))
            open_span = None
        else:
            warnings.append(_lonely("has an end event without a start, which is ignored", event.name, source))
    if open_span is not None:
        spans.append(open_span)
        warnings.append(
            _lonely("has no end event, taken to last to the end of the data", open_span.name, source)
        )
    return _unique(spans), tuple(warnings)


def _unique(spans: list[Span]) -> tuple[Span, ...]:
    seen: Counter[str] = Counter()
    named = []
    for span in spans:
        seen[span.name] += 1
        named.append(span if seen[span.name] == 1 else replace(span, name=f"{span.name}#{seen[span.name]}"))
    return tuple(named)


def _lonely(what: str, test: str, source: str) -> DataWarning:
    return DataWarning(
        "unpaired_event",
        what,
        source=source,
        test=test,
        remedy="log a start and an end event for every test",
    )
