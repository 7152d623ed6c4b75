"""Reports on a model without recordings: simulated responses, a simulated sweep, exported files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Group, RenderableType

from savgs_ident.core.presentation import Origin
from savgs_ident.effects.base import per
from savgs_ident.export.gather import Gathered
from savgs_ident.plants.base import Input
from savgs_ident.report.text import (
    channel_labels,
    fixed,
    per_input_key,
    plain,
    shown_unit,
    significant,
    table,
)
from savgs_ident.report.theme import BLUE, GREY, new_figure, styled
from savgs_ident.simulate.public import (
    DURATION_S,
    HIGHEST_HZ,
    LOWEST_HZ,
    RATE_HZ,
    SimulatedResponse,
    SimulatedSweep,
)


def response_record(solved: SimulatedResponse) -> dict[str, object]:
    """Frequencies, how each was solved, and the response of each channel, SI; None where not solved."""
    curve, driven, key = solved.curve(""), solved.model.plant.inputs[0], per_input_key(solved.model)
    return {
        "schema": 1,
        "kind": "periodic",
        "effects": list(solved.origin.effects),
        "frequency_hz": solved.frequency,
        "status": [status.name.lower() for status in solved.status],
        f"{_key(driven)}_peak_to_peak_{driven.unit}": 2.0 * np.abs(solved.driven),
        "channels": {
            each.name: {
                "unit": each.unit,
                "amplitude": np.abs(curve.transfer[:, c] * solved.driven),
                key: np.abs(curve.transfer[:, c]),
                "phase_deg": np.degrees(np.angle(curve.transfer[:, c])),
                "peak_to_peak": curve.peak_to_peak[:, c],
            }
            for c, each in enumerate(solved.model.channels)
        },
    }


def response_columns(solved: SimulatedResponse) -> dict[str, Sequence[object]]:
    """The same as columns headed by name and unit; an empty cell where not solved."""
    record: Mapping[str, Any] = response_record(solved)
    driven, key = solved.model.plant.inputs[0], per_input_key(solved.model)
    columns: dict[str, Sequence[object]] = {
        "frequency [Hz]": record["frequency_hz"],
        "status": record["status"],
        f"{driven.about} peak to peak [{driven.unit}]": list(2.0 * np.abs(solved.driven)),
    }
    for name, channel in record["channels"].items():
        unit = channel["unit"]
        columns[f"{name} first harmonic [{unit}]"] = _cells(channel["amplitude"])
        columns[f"{name} per {driven.about} [{per(unit, driven.unit)}]"] = _cells(channel[key])
        columns[f"{name} phase to {driven.about} [deg]"] = _cells(channel["phase_deg"])
        columns[f"{name} peak to peak [{unit}]"] = _cells(channel["peak_to_peak"])
    return columns


def response_text(solved: SimulatedResponse) -> RenderableType:
    """The responses as a table."""
    record: Mapping[str, Any] = response_record(solved)
    key = per_input_key(solved.model)
    headers = ["f\n[Hz]"]
    columns = [[fixed(value, 3) for value in record["frequency_hz"]]]
    for name, shown in channel_labels(solved.model).items():
        channel = record["channels"][name]
        headers += [
            f"{shown.title.split(' ')[-1]}\n[{shown.per_input}]",
            "phase\n[deg]",
            f"p-p\n[{shown.unit}]",
        ]
        columns.append([fixed(value, 3) for value in channel[key]])
        columns.append([fixed(value, 1) for value in channel["phase_deg"]])
        columns.append([fixed(shown.scale * value, 3) for value in channel["peak_to_peak"]])
    headers.append("solution")
    columns.append([status.replace("_", " ") for status in record["status"]])
    return table(
        f"Periodic response to {_driven_by(solved)}",
        headers,
        zip(*columns, strict=True),
        texts=(len(headers) - 1,),
    )


def _driven_by(solved: SimulatedResponse) -> str:
    """What the plant is driven by, and how far."""
    driven = solved.model.plant.inputs[0]
    unit, scale = shown_unit(driven.unit)
    ends = dict.fromkeys(significant(2.0 * scale * end(np.abs(solved.driven))) for end in (np.min, np.max))
    return f"the {driven.about} of {' to '.join(ends)} {unit} peak to peak"


def _key(driven: Input) -> str:
    return driven.about.replace(" ", "_")


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
            each.name: {"unit": each.unit} | _largest(sweep, values)
            for each, values in zip(sweep.model.channels, sweep.readings, strict=True)
        },
    }


def sweep_columns(sweep: SimulatedSweep) -> dict[str, Sequence[object]]:
    """The series, headed as a recording of a rig is."""
    driven = sweep.model.plant.inputs[0]
    series = [("time", "s", sweep.time), (driven.name, driven.unit, sweep.driven)]
    for each, values in zip(sweep.model.channels, sweep.readings, strict=True):
        series.append((each.name, each.unit, values))
    return {f"{name} [{unit}]": [f"{value:.9g}" for value in values] for name, unit, values in series}


def sweep_text(sweep: SimulatedSweep) -> RenderableType:
    """The largest readings and where they are."""
    record: Mapping[str, Any] = sweep_record(sweep)
    title = f"Sweep from {record['from_hz']:g} to {record['to_hz']:g} Hz in {record['duration_s']:g} s"
    if record["status"] != "converged":
        return plain(f"{title}: {record['status'].replace('_', ' ')}")
    labels = channel_labels(sweep.model)
    rows = [
        (
            labels[name].title,
            labels[name].unit,
            fixed(labels[name].scale * channel["largest"], 3),
            fixed(labels[name].scale * channel["smallest"], 3),
            fixed(channel["peak_frequency_hz"], 3),
        )
        for name, channel in record["channels"].items()
    ]
    return table(title, ("channel", "unit", "largest", "smallest", "peak at [Hz]"), rows, texts=(0, 1))


def sweep_figure(sweep: SimulatedSweep) -> Figure:
    """The readings over time, with the frequency of the input on top."""
    labels = channel_labels(sweep.model).values()
    with styled():
        figure = new_figure(10.5, 6.5)
        panels = figure.subplots(len(sweep.readings), 1, sharex=True, squeeze=False)[:, 0]
        for axes, shown, values in zip(panels, labels, sweep.readings, strict=True):
            axes.plot(sweep.time, shown.scale * values, color=BLUE, linewidth=0.7)
            axes.set_ylabel(f"{shown.title}\n[{shown.unit}]")
            axes.axhline(0.0, color=GREY, linewidth=0.6)
        panels[-1].set_xlabel("time [s]")
        panels[-1].set_xlim(0.0, DURATION_S)
        per_second = (HIGHEST_HZ - LOWEST_HZ) / DURATION_S
        top = panels[0].secondary_xaxis(
            "top", functions=(lambda t: LOWEST_HZ + per_second * t, lambda f: (f - LOWEST_HZ) / per_second)
        )
        top.set_xlabel("frequency [Hz]")
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
    title = f"{record['rig']}: {' + '.join(record['effects']) or 'without effects'}"
    return Group(
        plain(title, "bold"),
        plain(f"{record['parameters']} parameters, {known}, {samples}"),
        *(plain(sentence) for sentence in record["said"]),
        plain(""),
        table("Written", ("format", "files"), rows, (0, 1)),
    )
