"""A fit along a measured motion, or a model held against one: as a JSON object, in the terminal, and drawn."""

from matplotlib.figure import Figure
from rich.console import Group, RenderableType

from savgs_ident.core.files import warning_record
from savgs_ident.fit.along_motion import MotionComparison, MotionFit
from savgs_ident.inference.drive_force import relative_miss, relative_noise
from savgs_ident.report.drive import drive_figure
from savgs_ident.report.fit import (
    correlation_record,
    identified_table,
    parameter_records,
    tolerance_tables,
    verdict_record,
    verdict_sentences,
)
from savgs_ident.report.text import fixed, plain, table


def motion_fit_record(fit: MotionFit) -> dict[str, object]:
    """Parameters first, then how well the force is explained and how the fit went; SI, gaps relative [1]."""
    before, after, noise = fit.gap
    record: dict[str, object] = {
        "schema": 1,
        "parameters": parameter_records(fit),
        "correlation": correlation_record(fit),
        "chi2": fit.chi2,
        "dof": fit.dof,
        "chi2_per_dof": fit.chi2 / fit.dof if fit.dof > 0 else None,
        "converged": fit.status.ok,
        "dwells": [],
        "trusted": fit.trusted,
        "doubt": fit.doubt or None,
        "gap": {"force": {"before": before, "after": after, "floor": noise}},
        "status": fit.status.name.lower(),
        "advice": fit.status.advice,
        "verdict": verdict_record(fit),
        "effects": fit.effects,
        "quantity": fit.compared["quantity"],
        "wall_s": fit.wall_s,
        "warnings": [warning_record(warning) for warning in fit.origin.warnings],
    }
    if fit.held_out is not None:
        apart = fit.held_out
        record["held_out"] = {
            "source": apart.source,
            "before": apart.as_given,
            "after": apart.identified,
            "floor": apart.noise,
        }
    return record


def motion_fit_text(fit: MotionFit) -> RenderableType:
    """Tables and sentences, most important first."""
    rows = [("this motion", *(fixed(100.0 * each, 2) for each in fit.gap))]
    if fit.held_out is not None:
        apart = fit.held_out
        gaps = (apart.as_given, apart.identified, apart.noise)
        rows.append(("held out", *(fixed(100.0 * each, 2) for each in gaps)))
    return Group(
        identified_table(fit),
        plain(
            f"chi2/dof = {fit.chi2:.1f}/{fit.dof} on {fit.measured.size} rows of force over "
            f"{fit.motion.row_times[-1] - fit.motion.row_times[0]:.3g} s (computed in {fit.wall_s:.1f} s)"
        ),
        plain(""),
        table(
            "Force of the drive, measured less needed (rms)",
            ("motion", "before\n[%]", "after\n[%]", "noise\n[%]"),
            rows,
        ),
        *tolerance_tables(fit),
        plain("Verdict", "bold"),
        *(plain(f"- {sentence}") for sentence in verdict_sentences(fit)),
    )


def _gaps(compared: MotionComparison) -> dict[str, float]:
    """Relative rms [1] of what is measured less what is needed, with and without effects, and that of the noise."""
    return {
        "model": relative_miss(compared.measured, compared.needed),
        "without_effects": relative_miss(compared.measured, compared.frictionless),
        "floor": relative_noise(compared.motion),
    }


def motion_comparison_record(compared: MotionComparison) -> dict[str, object]:
    """How well the force is predicted, gaps relative [1], and the force itself; SI."""
    return {
        "schema": 1,
        "effects": list(compared.model.effects),
        "converged": compared.trusted,
        "gap": {"force": _gaps(compared)},
        "unit": compared.model.plant.inputs[0].unit,
        "time_s": compared.motion.row_times,
        "measured": compared.measured,
        "identified": compared.needed,
        "frictionless": compared.frictionless,
        "warnings": [warning_record(warning) for warning in compared.origin.warnings],
    }


def motion_comparison_text(compared: MotionComparison) -> RenderableType:
    """The gap, and of how much it is."""
    time = compared.motion.row_times
    rows = [tuple(fixed(100.0 * each, 2) for each in _gaps(compared).values())]
    return Group(
        table(
            "Force of the drive, measured less needed (rms)",
            ("model\n[%]", "without effects\n[%]", "noise\n[%]"),
            rows,
        ),
        plain(f"{compared.measured.size} rows of force over {time[-1] - time[0]:.3g} s"),
    )


def compared_force_figure(compared: MotionComparison) -> Figure:
    """The force of the drive over the first seconds, measured and as the model needs it, and what is left."""
    plant, motion = compared.model.plant, compared.motion
    models = [("model", compared.needed)]
    if compared.model.effects:
        models.append(("the same without effects", compared.frictionless))
    units = plant.inputs[0].unit, f"{plant.coordinates[0].unit}/s"
    velocity = motion.rows(motion.velocity)
    return drive_figure(motion.row_times, velocity, compared.measured, models, motion.noise, units)


def force_figure(fit: MotionFit) -> Figure:
    """The force of the drive over the first seconds, measured and as the model needs it, and what is left."""
    plant = fit.estimated.plant
    models = (("identified model", fit.predicted), ("before the fit", fit.as_given))
    velocity = fit.motion.rows(fit.motion.velocity)
    units = plant.inputs[0].unit, f"{plant.coordinates[0].unit}/s"
    return drive_figure(fit.motion.row_times, velocity, fit.measured, models, fit.motion.noise, units)
