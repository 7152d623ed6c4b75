"""A sweep of the cam from standstill, simulated: its series, its largest readings, its picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import RenderableType

from savgs_ident.core.rig import Rig
from savgs_ident.core.status import Status
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.actuation import held_link
from savgs_ident.model.road import sweep_road
from savgs_ident.model.values import as_values
from savgs_ident.recordings.recording import CANONICAL_UNITS
from savgs_ident.report.readings import READINGS
from savgs_ident.report.style import BLUE, GREY, new_figure, styled
from savgs_ident.report.terminal import fixed, plain, table
from savgs_ident.simulate.transient import simulate_transient

LOWEST_HZ, HIGHEST_HZ, DURATION_S, RATE_HZ = 0.0, 3.0, 60.0, 500.0
"""The paper's sweep, and how densely it is written down."""


@dataclass(frozen=True)
class Sweep:
    """A simulated sweep: ``time`` [s], ``road`` [m] and ``readings`` (2, n), SI, channels as in READINGS."""

    time: NDArray[np.float64]
    road: NDArray[np.float64]
    readings: NDArray[np.float64]
    status: Status

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Frequency of the cam at each instant [Hz], (n,)."""
        return LOWEST_HZ + (HIGHEST_HZ - LOWEST_HZ) * self.time / DURATION_S


def solve_sweep(rig: Rig, effects: Sequence[str]) -> Sweep:
    """The sweep of a rig with the named effects, the link held at its nominal angle."""
    p = as_values(model_parameters(rig, effects).as_dict())
    time = np.linspace(0.0, DURATION_S, round(DURATION_S * RATE_HZ) + 1)
    cam, angle = rig.parameters.values_of(("cam_peak_to_peak", "psi_nominal"))
    road = sweep_road(cam, LOWEST_HZ, HIGHEST_HZ, DURATION_S)
    solution = simulate_transient(build_model(rig, effects), p, road, held_link(angle), time)
    readings = np.stack([np.asarray(getattr(solution.readings, name)) for name in READINGS])
    return Sweep(time, np.asarray(solution.inputs.road.height), readings, solution.status())


def sweep_record(sweep: Sweep) -> dict[str, object]:
    """How it ended and the largest readings; the series itself is in the CSV."""
    return {
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


def sweep_columns(sweep: Sweep) -> dict[str, Sequence[object]]:
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
            READINGS[name].title,
            READINGS[name].unit,
            fixed(READINGS[name].scale * channel["largest"], 3),
            fixed(READINGS[name].scale * channel["smallest"], 3),
            fixed(channel["peak_frequency_hz"], 3),
        )
        for name, channel in record["channels"].items()
    ]
    title = f"Sweep from {record['from_hz']:g} to {record['to_hz']:g} Hz in {record['duration_s']:g} s"
    if record["status"] != "converged":
        return plain(f"{title}: {record['status'].replace('_', ' ')}")
    return table(title, ("channel", "unit", "largest", "smallest", "peak at [Hz]"), rows, texts=(0, 1))


def sweep_figure(sweep: Sweep) -> Figure:
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


def _largest(sweep: Sweep, values: NDArray[np.float64]) -> dict[str, float | None]:
    if not sweep.status.ok:
        return {"largest": None, "smallest": None, "peak_frequency_hz": None}
    at = int(np.argmax(np.abs(values)))
    return {
        "largest": float(values.max()),
        "smallest": float(values.min()),
        "peak_frequency_hz": float(sweep.frequency[at]),
    }
