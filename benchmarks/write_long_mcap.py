"""Write a long MCAP campaign: dwell after dwell, six channels at a high rate, as the rig's logger does.

    python -m benchmarks.write_long_mcap long.mcap --minutes 60 --rate-hz 1000

An hour at 1 kHz is 3.6 million messages of six numbers. The signals are those of a linear quarter car with
some noise: what matters here is how fast and in how much memory they are read.
"""

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

_START_NS = 1_763_715_600_000_000_000
_DWELL_S = 60.0
_PAUSE_S = 0.5
_FREQUENCIES_HZ = (0.5, 1.0, 1.5, 2.0, 2.35, 2.75, 3.5, 4.5, 6.0)
_ROAD_M = 0.01375
UNITS = {
    "road_height": "m",
    "sprung_accel": "m/s^2",
    "susp_deflection": "m",
    "link_angle": "rad",
    "link_velocity": "rad/s",
    "motor_current": "A",
}
_NOISE = np.array([0.0, 0.05, 1e-4, 1e-5, 1e-3, 0.02])
_LINE = (
    '{"road_height":%.6f,"sprung_accel":%.4f,"susp_deflection":%.6f,'
    '"link_angle":%.6f,"link_velocity":%.4f,"motor_current":%.4f}'
)
_EVENT_SCHEMA = {
    "type": "object",
    "properties": {
        "test": {"type": "string"},
        "event": {"type": "string"},
        "frequency_hz": {"type": ["number", "null"]},
    },
}


def write_long_mcap(path: Path | str, minutes: float = 60.0, rate_hz: float = 1000.0) -> int:
    """Write ``minutes`` of dwells of at most a minute each, sampled at ``rate_hz`` [Hz].

    Zstandard chunks of 1 MiB, topics ``/rig/daq`` and ``/rig/test`` in JSON. Returns how many samples
    (messages of six channels) were written.
    """
    random = np.random.default_rng(1)
    samples = 0
    with Path(path).open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        writer.start()
        daq, test = _channels(writer)
        for index, (start, length) in enumerate(_dwells(minutes)):
            frequency = _FREQUENCIES_HZ[index % len(_FREQUENCIES_HZ)]
            name = f"dwell_{frequency:.2f}Hz_{index}"
            _event(writer, test, start, name, "start", frequency)
            time = np.arange(round(length * rate_hz)) / rate_hz
            table = _quarter_car(time, frequency) + random.standard_normal((time.size, 6)) * _NOISE
            stamps = _nanoseconds(start + time)
            for stamp, row in zip(stamps.tolist(), table.tolist(), strict=True):
                writer.add_message(daq, stamp, (_LINE % tuple(row)).encode(), stamp)
            _event(writer, test, start + length, name, "end", frequency)
            samples += time.size
        writer.finish()
    return samples


def _dwells(minutes: float) -> Iterator[tuple[float, float]]:
    """Start and length [s] of each dwell."""
    start, end = 0.0, 60.0 * minutes
    while start < end:
        length = min(_DWELL_S, end - start)
        yield start, length - _PAUSE_S
        start += length


def _channels(writer: Writer) -> tuple[int, int]:
    properties = {name: {"type": "number", "description": unit} for name, unit in UNITS.items()}
    daq = writer.register_schema(
        "rig.Daq", "jsonschema", json.dumps({"type": "object", "properties": properties}).encode()
    )
    event = writer.register_schema("rig.TestEvent", "jsonschema", json.dumps(_EVENT_SCHEMA).encode())
    return (
        writer.register_channel("/rig/daq", "json", daq),
        writer.register_channel("/rig/test", "json", event),
    )


def _event(writer: Writer, channel: int, at: float, test: str, event: str, frequency: float) -> None:
    stamp = int(_nanoseconds(np.array(at)))
    message = {"test": test, "event": event, "frequency_hz": frequency}
    writer.add_message(channel, stamp, json.dumps(message).encode(), stamp)


def _nanoseconds(time: NDArray[np.float64]) -> NDArray[np.int64]:
    return _START_NS + np.rint(1e9 * time).astype(np.int64)


def _quarter_car(time: NDArray[np.float64], frequency: float) -> NDArray[np.float64]:
    """Six channels [SI], (n, 6): a single mass on k = 60 kN/m, c = 2 kN s/m over the road."""
    s = 2j * np.pi * frequency
    mass, stiffness, damping = 320.0, 6.0e4, 2.0e3
    body = _ROAD_M * (damping * s + stiffness) / (mass * s**2 + damping * s + stiffness)
    turn = np.exp(s * time)
    return np.column_stack(
        [
            (_ROAD_M * turn).real,
            (s**2 * body * turn).real,
            ((_ROAD_M - body) * turn).real,
            np.full(time.size, np.pi / 2),
            np.zeros(time.size),
            2.6 + 0.5 * turn.real,
        ]
    )


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="write a long MCAP campaign")
    parser.add_argument("path", type=Path)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate-hz", type=float, default=1000.0)
    options = parser.parse_args()
    samples = write_long_mcap(options.path, options.minutes, options.rate_hz)
    print(f"{samples} samples in {options.path}")


if __name__ == "__main__":
    main()
