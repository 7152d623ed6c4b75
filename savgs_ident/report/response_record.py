"""Simulated responses as a JSON object, as a table on disk and as a table in the terminal."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import RenderableType

from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.report.curves import ModelCurve
from savgs_ident.report.readings import READINGS
from savgs_ident.report.solving import Solved
from savgs_ident.report.terminal import fixed, table


def response_record(solved: Solved) -> dict[str, object]:
    """Frequencies, how each was solved, and the response of each channel, SI; None where not solved."""
    curve = solved.curve("")
    return {
        "frequency_hz": solved.frequency,
        "status": [status.name.lower() for status in solved.status],
        "road_peak_to_peak_m": 2.0 * np.abs(np.asarray(solved.excitation.road)[:, 1]),
        "channels": {name: _channel(solved, curve, c, name) for c, name in enumerate(READINGS)},
    }


def response_columns(record: Mapping[str, Any]) -> dict[str, Sequence[object]]:
    """The same as columns headed by name and unit; an empty cell where not solved."""
    columns: dict[str, Sequence[object]] = {
        "frequency [Hz]": record["frequency_hz"],
        "status": record["status"],
        "road peak to peak [m]": record["road_peak_to_peak_m"],
    }
    for name, channel in record["channels"].items():
        unit = channel["unit"]
        columns[f"{name} first harmonic [{unit}]"] = _cells(channel["amplitude"])
        columns[f"{name} per road [{unit}/m]"] = _cells(channel["per_metre_of_road"])
        columns[f"{name} phase to road [deg]"] = _cells(channel["phase_deg"])
        columns[f"{name} peak to peak [{unit}]"] = _cells(channel["peak_to_peak"])
    return columns


def response_text(title: str, record: Mapping[str, Any]) -> RenderableType:
    """The responses as a table."""
    headers = ["f\n[Hz]"]
    columns = [[fixed(value, 3) for value in record["frequency_hz"]]]
    for name, shown in READINGS.items():
        channel = record["channels"][name]
        headers += [f"{_SHORT[name]}\n[{shown.per_road}]", "phase\n[deg]", f"p-p\n[{shown.unit}]"]
        columns.append([fixed(value, 3) for value in channel["per_metre_of_road"]])
        columns.append([fixed(value, 1) for value in channel["phase_deg"]])
        columns.append([fixed(shown.scale * value, 3) for value in channel["peak_to_peak"]])
    headers.append("solution")
    columns.append([status.replace("_", " ") for status in record["status"]])
    return table(title, headers, zip(*columns, strict=True), texts=(len(headers) - 1,))


_SHORT = {"sprung_accel": "accel", "susp_deflection": "deflection"}


def _channel(solved: Solved, curve: ModelCurve, c: int, name: str) -> dict[str, object]:
    transfer = curve.transfer[:, c]
    return {
        "unit": CANONICAL_UNITS[name],
        "amplitude": np.abs(transfer * np.asarray(solved.excitation.road)[:, 1]),
        "per_metre_of_road": np.abs(transfer),
        "phase_deg": np.degrees(np.angle(transfer)),
        "peak_to_peak": curve.peak_to_peak[:, c],
    }


def _cells(values: Sequence[float]) -> list[object]:
    return ["" if np.isnan(value) else repr(float(value)) for value in values]
