"""A model solved under the road and link of measured dwells, and drawn against them."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from savgs_ident.cli.console import Progress
from savgs_ident.core.rig import Rig
from savgs_ident.report.bode_record import Compared
from savgs_ident.report.curves import measured_points
from savgs_ident.report.residuals import comparable, whitened
from savgs_ident.report.solving import solve, solve_between, without_effects
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.measured import measured_excitation

SIMQC_LABEL = "the same without friction (SimQC)"


def compare(rig: Rig, effects: Sequence[str], measured: HarmonicResponse, progress: Progress) -> Compared:
    """Solve the model with and without its effects at the measured dwells."""
    excitation = measured_excitation(measured, rig.parameters["psi_nominal"].value)
    progress("solving the model at the dwells")
    model = solve(rig, effects, excitation, measured.orders)
    progress("solving SimQC at the dwells")
    frictionless = solve(without_effects(rig, effects), effects, excitation, measured.orders)
    used = comparable(measured, measured.orders) & model.ok[:, None, None]
    return Compared(measured, model, frictionless, used)


def draw_comparison(
    rig: Rig, effects: Sequence[str], compared: Compared, source: str, out: Path, progress: Progress
) -> tuple[Path, ...]:
    """Write bode.png and bode.pdf, the models solved between the dwells too; ``source`` was measured."""
    title = f"Model and measurement: {Path(source).name}"
    label = "identified model" if rig.provenance else "model as drawn"
    progress("solving the model between the dwells")
    shown = {label: (rig, compared.model)}
    if effects:
        shown[SIMQC_LABEL] = (without_effects(rig, effects), compared.frictionless)
    # A solver needs one core and leaves Python free: both curves, and loading what draws them, take the time of one.
    with ThreadPoolExecutor() as pool:
        found = [pool.submit(solve_between, which, effects, known) for which, known in shown.values()]
        from savgs_ident.report.bode import bode_figure
        from savgs_ident.report.picture import write_figure
    curves = [each.result().curve(name) for name, each in zip(shown, found, strict=True)]
    progress("drawing")
    residuals = whitened(compared.measured, compared.model.harmonics, compared.used)
    points = measured_points(compared.measured)
    return write_figure(out, "bode", bode_figure(title, points, curves, residuals))
