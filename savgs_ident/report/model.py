"""Reports on a model without recordings: simulated responses, a simulated sweep, exported files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.core.presentation import Origin
from savgs_ident.export.gather import Gathered
from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.report.text import READINGS, channel_label, fixed, plain, table
from savgs_ident.report.theme import BLUE, GREY, new_figure, styled
from savgs_ident.simulate.frequency_response import (
    DURATION_S,
    HIGHEST_HZ,
    LOWEST_HZ,
    RATE_HZ,
    ModelCurve,
    SimulatedResponse,
    SimulatedSweep,
)


def response_record(solved: SimulatedResponse) -> dict[str, object]:
    """Frequencies, how each was solved, and the response of each channel, SI; None where not solved."""
    curve = solved.curve("")
    return {
        "schema": 1,
        "kind": "periodic",
        "effects": list(solved.origin.effects),
        "frequency_hz": solved.frequency,
        "status": [status.name.lower() for status in solved.status],
        "road_peak_to_peak_m": 2.0 * np.abs(np.asarray(solved.excitation.harmonics["road_height"])[:, 1]),
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
        headers += [f"{_SHORT[name]}\n[{shown.per_input}]", "phase\n[deg]", f"p-p\n[{shown.unit}]"]
        columns.append([fixed(value, 3) for value in channel["per_metre_of_road"]])
        columns.append([fixed(value, 1) for value in channel["phase_deg"]])
        columns.append([fixed(shown.scale * value, 3) for value in channel["peak_to_peak"]])
    headers.append("solution")
    columns.append([status.replace("_", " ") for status in record["status"]])
    return table(title, headers, zip(*columns, strict=True), texts=(len(headers) - 1,))


_SHORT = {"sprung_accel": "accel", "susp_deflection": "deflection"}


def _channel(solved: SimulatedResponse, curve: ModelCurve, c: int, name: str) -> dict[str, object]:
    transfer = curve.transfer[:, c]
    return {
        "unit": CANONICAL_UNITS[name],
        "amplitude": np.abs(transfer * np.asarray(solved.excitation.harmonics["road_height"])[:, 1]),
        "per_metre_of_road": np.abs(transfer),
        "phase_deg": np.degrees(np.angle(transfer)),
        "peak_to_peak": curve.peak_to_peak[:, c],
    }


def _cells(values: Sequence[float]) -> list[object]:
    return ["" if np.isnan(value) else repr(float(value)) for value in values]


def sweep_record(sweep: SimulatedSweep) -> dict[str, object]:
    """How it ended and the largest readings; the series itself is in the CSV."""
    return {
        "schema": 1,
        "kind": "sweep",
        "effects": list(sweep.origin.effects),
        "status": sweep.status.name.lower(),
        "from_hz": LOWEST_HZ,
        "to_hz": HIGHEST_HZ,
        "duration_s": DURATION_S,
        "rate_hz": RATE_HZ,
        "channels": {
            name: {"unit": CANONICAL_UNITS[name]} | _largest(sweep, values)
            for name, values in zip(READINGS, sweep.readings, strict=True)
        },
    }


def sweep_columns(sweep: SimulatedSweep) -> dict[str, Sequence[object]]:
    """The series, headed as a recording of a rig is."""
    series = {"time": sweep.time, "road_height": sweep.road} | dict(
        zip(READINGS, sweep.readings, strict=True)
    )
    units = {"time": "s"} | dict(CANONICAL_UNITS)
    return {
        f"{name} [{units[name]}]": [f"{value:.9g}" for value in values] for name, values in series.items()
    }


def sweep_text(record: Mapping[str, Any]) -> RenderableType:
    """The largest readings and where they are."""
    rows = [
        (
            channel_label(name).title,
            channel_label(name).unit,
            fixed(channel_label(name).scale * channel["largest"], 3),
            fixed(channel_label(name).scale * channel["smallest"], 3),
            fixed(channel["peak_frequency_hz"], 3),
        )
        for name, channel in record["channels"].items()
    ]
    title = f"Sweep from {record['from_hz']:g} to {record['to_hz']:g} Hz in {record['duration_s']:g} s"
    if record["status"] != "converged":
        return plain(f"{title}: {record['status'].replace('_', ' ')}")
    return table(title, ("channel", "unit", "largest", "smallest", "peak at [Hz]"), rows, texts=(0, 1))


def sweep_figure(sweep: SimulatedSweep) -> Figure:
    """Both readings over time, with the frequency of the cam on top."""
    with styled():
        figure = new_figure(10.5, 6.5)
        panels = figure.subplots(len(READINGS), 1, sharex=True)
        for axes, shown, values in zip(panels, READINGS.values(), sweep.readings, strict=True):
            axes.plot(sweep.time, shown.scale * values, color=BLUE, linewidth=0.7)
            axes.set_ylabel(f"{shown.title}\n[{shown.unit}]")
            axes.axhline(0.0, color=GREY, linewidth=0.6)
        panels[-1].set_xlabel("time [s]")
        panels[-1].set_xlim(0.0, DURATION_S)
        per_second = (HIGHEST_HZ - LOWEST_HZ) / DURATION_S
        top = panels[0].secondary_xaxis(
            "top", functions=(lambda t: LOWEST_HZ + per_second * t, lambda f: (f - LOWEST_HZ) / per_second)
        )
        top.set_xlabel("road frequency [Hz]")
        return figure


def _largest(sweep: SimulatedSweep, values: NDArray[np.float64]) -> dict[str, float | None]:
    if not sweep.status.ok:
        return {"largest": None, "smallest": None, "peak_frequency_hz": None}
    at = int(np.argmax(np.abs(values)))
    return {
        "largest": float(values.max()),
        "smallest": float(values.min()),
        "peak_frequency_hz": float(sweep.frequency[at]),
    }


def export_record(
    gathered: Gathered, written: Mapping[str, Sequence[Path]], origin: Origin
) -> dict[str, Any]:
    """The model, where its numbers come from, and the files by format."""
    model = gathered.model
    verdict = model.diagnosis.get("verdict")
    return {
        "schema": 1,
        "model": origin.model,
        "rig": origin.rig,
        "effects": list(origin.effects),
        "files": list(dict.fromkeys(str(file) for files in written.values() for file in files)),
        "formats": {name: [str(file) for file in files] for name, files in written.items()},
        "parameters": len(model.table),
        "covariance": len(model.covariance[0]),
        "samples": len(next(iter(model.samples.values()), ())),
        "verdict": verdict,
        "said": list(gathered.said),
        "trusted": not gathered.doubts,
        "doubts": list(gathered.doubts),
        "command": origin.command_line,
        "versions": dict(origin.versions),
    }


def export_text(record: Mapping[str, Any]) -> RenderableType:
    """What :func:`export_record` says, for people."""
    rows = [(name, ", ".join(files)) for name, files in record["formats"].items()]
    known = f"covariance of {record['covariance']}" if record["covariance"] else "no covariance"
    samples = f"{record['samples']} draws of a posterior" if record["samples"] else "no posterior"
    title = f"{record['rig']}: frictionless rig + {' + '.join(record['effects']) or 'nothing'}"
    return Group(
        plain(title, "bold"),
        plain(f"{record['parameters']} parameters, {known}, {samples}"),
        *(plain(sentence) for sentence in record["said"]),
        plain(""),
        table("Written", ("format", "files"), rows, (0, 1)),
    )
