"""The two kinds of simulation behind ``simulate``, with their files."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import RenderableType

from savgs_ident.cli.console import Progress, Voice
from savgs_ident.core.rig import Rig
from savgs_ident.recordings.read import read_campaign
from savgs_ident.report.bode import response_figure
from savgs_ident.report.curves import ModelCurve
from savgs_ident.report.files import write_json, write_table
from savgs_ident.report.picture import write_figure
from savgs_ident.report.response_record import response_columns, response_record, response_text
from savgs_ident.report.solving import Solved, solve
from savgs_ident.report.sweep import solve_sweep, sweep_columns, sweep_figure, sweep_record, sweep_text
from savgs_ident.report.terminal import plain
from savgs_ident.responses.estimate import estimate_response
from savgs_ident.simulate.excitation import Excitation, cam_excitation
from savgs_ident.simulate.measured import measured_excitation

PROGRAMME = (
    0.5, 0.8, 1.1, 1.4, 1.6, 1.75, 1.85, 1.95, 2.0, 2.05, 2.15, 2.25, 2.3, 2.35, 2.4, 2.45, 2.55, 2.65, 2.75,
    2.85, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0,
)  # fmt: skip
"""The frequencies of a campaign's dwells [Hz]."""


def simulate_responses(
    rig: Rig,
    effects: Sequence[str],
    frequency: tuple[float, ...],
    campaign: Path | None,
    orders: int,
    voice: Voice,
    out: Path,
) -> bool:
    """Periodic responses at frequencies [Hz], shown and written; whether all were found."""
    with voice.working() as progress:
        excitation = _excitation(rig, frequency, campaign, orders, progress)
        progress(f"solving {excitation.frequency.shape[0]} periodic motions")
        solved = solve(rig, effects, excitation, orders)
        record = {"schema": 1, "kind": "periodic", "effects": list(effects)} | response_record(solved)
        files = [
            write_json(out / "simulate.json", record),
            write_table(out / "simulate.csv", response_columns(record)),
        ]
        progress("drawing")
        files += write_figure(
            out, "simulate", response_figure("Simulated response", [_curve(solved, effects)])
        )
    voice.show(response_text("Periodic response to the cam", record), _written(files))
    voice.hand_over(record)
    return bool(np.all(solved.ok))


def simulate_sweep(rig: Rig, effects: Sequence[str], voice: Voice, out: Path) -> bool:
    """A sweep from standstill, shown and written; whether the integration ended well."""
    with voice.working() as progress:
        progress("integrating a sweep of 60 s")
        solution = solve_sweep(rig, effects)
        record = {"schema": 1, "kind": "sweep", "effects": list(effects)} | sweep_record(solution)
        files = [
            write_json(out / "simulate.json", record),
            write_table(out / "simulate.csv", sweep_columns(solution)),
        ]
        progress("drawing")
        files += write_figure(out, "simulate", sweep_figure(solution))
    voice.show(sweep_text(record), _written(files))
    voice.hand_over(record)
    return solution.status.ok


def _excitation(
    rig: Rig, frequency: tuple[float, ...], campaign: Path | None, orders: int, progress: Progress
) -> Excitation:
    if campaign is not None:
        progress(f"reading {campaign}")
        recorded = read_campaign(campaign, progress=progress.fraction(f"reading {campaign}"))
        return measured_excitation(estimate_response(recorded, orders), rig.parameters["psi_nominal"].value)
    values = rig.parameters.values_of(("cam_peak_to_peak", "psi_nominal"))
    return cam_excitation(np.unique(frequency or PROGRAMME), *values)


def _curve(solved: Solved, effects: Sequence[str]) -> ModelCurve:
    return solved.curve("with " + ", ".join(effects) if effects else "SimQC (without friction)")


def _written(files: Sequence[Path]) -> RenderableType:
    return plain("Written: " + ", ".join(str(file) for file in files))
