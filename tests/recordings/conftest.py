"""Small campaigns of a linear quarter car, written the way laboratories write them."""

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer
from numpy.typing import NDArray

Signals = dict[str, NDArray[np.float64]]

EPOCH_NS = 1_763_715_600_000_000_000
HEADERS = {
    "time": "time [s]",
    "road_height": "road_height [m]",
    "sprung_accel": "sprung_accel [m/s^2]",
    "susp_deflection": "susp_deflection [m]",
    "link_angle": "link_angle [rad]",
}


def _signals(frequency: float = 1.0, seconds: float = 10.0, rate: float = 100.0) -> Signals:
    random = np.random.default_rng(7)
    time = np.arange(round(seconds * rate)) / rate
    s = 2j * np.pi * frequency
    body = 0.01375 * (2e3 * s + 6e4) / (320 * s**2 + 2e3 * s + 6e4)
    turn = np.exp(s * time)
    return {
        "time": time,
        "road_height": np.round((0.01375 * turn).real, 6),
        "sprung_accel": np.round((s**2 * body * turn).real + 0.05 * random.standard_normal(time.size), 4),
        "susp_deflection": np.round(
            ((0.01375 - body) * turn).real + 1e-4 * random.standard_normal(time.size), 6
        ),
        "link_angle": np.full(time.size, 1.570796),
    }


def _csv(
    signals: Signals, *, test: str | None = None, headers: Mapping[str, str] = HEADERS, separator: str = ","
) -> bytes:
    names = list(signals)
    lines = [separator.join((["test"] if test else []) + [headers.get(name, name) for name in names])]
    lines += [
        separator.join(
            ([test] if test else []) + ["" if np.isnan(cell) else repr(float(cell)) for cell in row]
        )
        for row in np.column_stack([signals[name] for name in names])
    ]
    return ("\n".join(lines) + "\n").encode()


Message = tuple[str, int, bytes]
Topic = tuple[str, str, str, bytes]
"""Message encoding, schema name, schema encoding, schema text; an empty schema encoding: no schema."""


def _mcap(
    path: Path,
    topics: Mapping[str, Topic],
    messages: Sequence[Message],
    *,
    compression: CompressionType = CompressionType.ZSTD,
    chunked: bool = True,
    index: bool = True,
    chunk_size: int = 1 << 16,
) -> Path:
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=chunk_size,
            compression=compression,
            use_chunking=chunked,
            index_types=IndexType.ALL if index else IndexType.NONE,
            use_statistics=index,
            use_summary_offsets=index,
            repeat_channels=index,
            repeat_schemas=index,
        )
        writer.start()
        channels = {}
        for topic, (encoding, name, schema_encoding, text) in topics.items():
            schema = writer.register_schema(name, schema_encoding, text) if schema_encoding else 0
            channels[topic] = writer.register_channel(topic, encoding, schema)
        for topic, stamp, data in messages:
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path


def _json_messages(
    signals: Signals, test: str, frequency: float | None, start_s: float = 0.0
) -> list[Message]:
    start = EPOCH_NS + round(1e9 * start_s)
    names = [name for name in signals if name != "time"]
    stamps = start + np.rint(1e9 * signals["time"]).astype(np.int64)
    event = {"test": test, "frequency_hz": frequency}
    rows = np.column_stack([signals[name] for name in names]).tolist()
    samples = [
        ("/rig/daq", stamp, json.dumps(dict(zip(names, row, strict=True))).encode())
        for stamp, row in zip(stamps.tolist(), rows, strict=True)
    ]
    return [
        ("/rig/test", start, json.dumps(event | {"event": "start"}).encode()),
        *samples,
        ("/rig/test", int(stamps[-1]) + 1, json.dumps(event | {"event": "end"}).encode()),
    ]


_UNITS = {"road_height": "m", "sprung_accel": "m/s^2", "susp_deflection": "m", "link_angle": "rad"}
JSON_TOPICS: dict[str, Topic] = {
    "/rig/test": ("json", "rig.TestEvent", "jsonschema", b"{}"),
    "/rig/daq": (
        "json",
        "rig.Daq",
        "jsonschema",
        json.dumps({"properties": {name: {"description": unit} for name, unit in _UNITS.items()}}).encode(),
    ),
}


@pytest.fixture(scope="session")
def signals() -> Callable[..., Signals]:
    """``signals(frequency, seconds, rate)``: a noisy dwell of a linear quarter car, SI."""
    return _signals


@pytest.fixture(scope="session")
def csv_bytes() -> Callable[..., bytes]:
    """``csv_bytes(signals, test=..., headers=..., separator=...)``: a table with units in its header."""
    return _csv


@pytest.fixture(scope="session")
def write_mcap() -> Callable[..., Path]:
    """``write_mcap(path, topics, messages, ...)``: any MCAP file."""
    return _mcap


@pytest.fixture(scope="session")
def json_messages() -> Callable[..., list[Message]]:
    """``json_messages(signals, test, frequency, start_s)``: the samples and events of one test."""
    return _json_messages


@pytest.fixture(scope="session")
def json_topics() -> dict[str, Topic]:
    """The topics of ``json_messages``."""
    return JSON_TOPICS
