"""The models before and after a diagnosis against the measurement: over frequency, or along a driven motion.

Of dwells: before, recalibrated, after, three models against the measured first harmonics. The curves of a Bode plot
hide what matters where a gap is a few per cent of a resonance. So the lowest panel shows the gap itself,
|predicted - measured| / |measured|, over the noise of the measurement: what calibration closes lies between the
first and the second curve, what the named effect closes between the second and the third.

Of a drive: above the force over one cycle of the measured motion, below what each model leaves of it: a friction
that is missing steps where the velocity changes its sign, an inertia where the carriage accelerates. The noise is a
band about zero.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from savgs_ident.diagnosis.result import Diagnosis, DriveForces, Responses
from savgs_ident.fit.result import measured_points
from savgs_ident.report.bode import LINES, draw_magnitude, draw_phase
from savgs_ident.report.diagnosis.text import model_label
from savgs_ident.report.drive import drive_figure
from savgs_ident.report.html import Picture, embed
from savgs_ident.report.text import channel_labels
from savgs_ident.report.theme import PALE, frequency_axis, magnitude_axis, new_figure, styled
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.curves import ModelCurve, measured_programmes, model_curve

_MARKERS = ("o", "s", "^")


@dataclass(frozen=True)
class FirstHarmonicGap:
    """Gap of the first harmonic of one channel [%], (D,), of each model and of the noise; NaN where not compared."""

    before: NDArray[np.float64]
    recalibrated: NDArray[np.float64]
    after: NDArray[np.float64]
    noise: NDArray[np.float64]


def compared_tests(diagnosis: Diagnosis) -> tuple[HarmonicResponse, Responses]:
    """The dwells or windows of a diagnosis, measured and predicted; it must not be one along a drive's motion."""
    assert diagnosis.measured is not None
    assert isinstance(diagnosis.responses, Responses)
    return diagnosis.measured, diagnosis.responses


def first_harmonic_gap(diagnosis: Diagnosis, c: int) -> FirstHarmonicGap:
    """The gap of the plant's channel ``c`` dwell by dwell."""
    (measured, answers), name = compared_tests(diagnosis), diagnosis.given.channels[c].name
    if name not in measured.channels:
        nothing = np.full(len(measured.tests), np.nan)
        return FirstHarmonicGap(nothing, nothing, nothing, nothing)
    channel = measured.channel(name)
    seen = np.where(measured.valid[:, channel, 1], measured.harmonics[:, channel, 1], np.nan)
    noise = np.sqrt(np.trace(measured.covariance[:, channel, 1], axis1=-2, axis2=-1))

    def of(predicted: NDArray[np.complex128]) -> NDArray[np.float64]:
        return np.asarray(100.0 * np.abs(predicted[:, c, 1] - seen) / np.abs(seen))

    return FirstHarmonicGap(
        of(answers.before), of(answers.recalibrated), of(answers.after), 100.0 * noise / np.abs(seen)
    )


def compared_channels(diagnosis: Diagnosis) -> tuple[int, ...]:
    """The places of the channels whose first harmonic is compared in any dwell; it must be one of dwells."""
    return tuple(
        c
        for c in range(len(diagnosis.given.channels))
        if np.any(np.isfinite(first_harmonic_gap(diagnosis, c).recalibrated))
    )


def diagnosis_bode_figure(diagnosis: Diagnosis, c: int) -> Figure:
    """Magnitude, phase and gap of the first harmonic of the plant's channel ``c``."""
    labels, driven = channel_labels(diagnosis.given), diagnosis.given.plant.inputs[0].name
    shown, measured = tuple(labels.values())[c], compared_tests(diagnosis)[0]
    points, curves = measured_points(measured, tuple(labels), driven), _curves(diagnosis)
    frequency = measured.frequency
    with styled():
        figure = new_figure(4.5, 7.6)
        figure.set_layout_engine("none")
        places = {"left": 0.155, "right": 0.985, "bottom": 0.062, "top": 0.875, "hspace": 0.12}
        panels = figure.subplots(3, 1, height_ratios=(1.2, 0.9, 1.1), gridspec_kw=places)
        magnitude, phase, gap = panels
        figure.suptitle(shown.title, y=0.985, fontsize=10.0, fontweight="bold")
        draw_magnitude(magnitude, curves, points, c, shown)
        draw_phase(phase, curves, points, c, shown)
        _draw_gap(gap, frequency, first_harmonic_gap(diagnosis, c))
        for axes in panels:
            frequency_axis(axes, float(frequency[0]), float(frequency[-1]), labelled=axes is gap)
            axes.yaxis.set_label_coords(-0.135, 0.5)
        _explain_models(figure, magnitude)
        return figure


def bode_picture(diagnosis: Diagnosis, c: int) -> Picture:
    """The Bode figure of the plant's channel ``c`` for the page, with its words."""
    gap = first_harmonic_gap(diagnosis, c)
    largest = [
        f"{name} {np.max(values[np.isfinite(values)], initial=0.0):.3g} %"
        for name, values in (
            ("before", gap.before),
            ("recalibrated", gap.recalibrated),
            ("after", gap.after),
        )
    ]
    title = tuple(channel_labels(diagnosis.given).values())[c].title
    words = f"Magnitude, phase and gap of the {title} over frequency; largest gap {', '.join(largest)}."
    return embed(diagnosis_bode_figure(diagnosis, c), words)


def _explain_models(figure: Figure, axes: Axes) -> None:
    """The models in the order in which they were made, then the measurement and its noise."""
    lines, _ = axes.get_legend_handles_labels()
    after, recalibrated, before, points = lines
    noise = Patch(color=PALE, label="measurement noise")
    figure.legend(
        handles=[before, recalibrated, after, points, noise],
        loc="upper center",
        bbox_to_anchor=(0.53, 0.968),
        ncols=2,
        columnspacing=1.4,
    )


def _curves(diagnosis: Diagnosis) -> list[ModelCurve]:
    """The models, the last one first: it has the strongest line."""
    measured, answers = compared_tests(diagnosis)
    driven = measured.harmonics[:, measured.channel(diagnosis.given.plant.inputs[0].name), 1]
    # Responses are those of fits, which are solved in all dwells together.
    solved = np.ones(measured.frequency.size, dtype=np.bool_)
    lines = measured_programmes(measured, diagnosis.given.plant)
    return [
        model_curve(label, measured.frequency, harmonics, driven, solved, lines)
        for label, harmonics in (
            (model_label(diagnosis), answers.after),
            ("recalibrated", answers.recalibrated),
            ("before, as given", answers.before),
        )
    ]


def _draw_gap(axes: Axes, frequency: NDArray[np.float64], gap: FirstHarmonicGap) -> None:
    """The gaps on a logarithmic scale down to half of the smallest noise; smaller ones lie on its edge."""
    magnitude_axis(axes)
    axes.set_ylabel("gap [% of the response]")
    every = np.concatenate([gap.before, gap.recalibrated, gap.after])
    top = float(np.max(every[np.isfinite(every)], initial=1.0))
    noise = gap.noise[np.isfinite(gap.noise) & (gap.noise > 0.0)]
    bottom = max(0.5 * float(np.min(noise, initial=top)), 1e-4 * top)
    axes.fill_between(frequency, bottom, np.maximum(gap.noise, bottom), color=PALE, linewidth=0.0, zorder=0.5)
    for values, line, marker in zip((gap.after, gap.recalibrated, gap.before), LINES, _MARKERS, strict=True):
        axes.plot(frequency, np.maximum(values, bottom), marker=marker, markersize=3.2, **line)
    axes.set_ylim(bottom, 1.6 * top)


def drive_figure_of(diagnosis: Diagnosis) -> Figure:
    """The force of the drive and what is left of it; the diagnosis must be one along a motion."""
    forces = diagnosis.responses
    assert isinstance(forces, DriveForces)
    noise = diagnosis.shrink.floor * float(np.sqrt(np.mean(forces.measured**2)))
    models = (
        (model_label(diagnosis), forces.after),
        ("recalibrated", forces.recalibrated),
        ("before, as given", forces.before),
    )
    plant = diagnosis.given.plant
    units = plant.inputs[0].unit, f"{plant.coordinates[0].unit}/s"
    return drive_figure(forces.time, forces.velocity, forces.measured, models, noise, units)


def drive_words(diagnosis: Diagnosis) -> str:
    """What the figure shows, for those who do not see it."""
    forces = diagnosis.responses
    assert isinstance(forces, DriveForces)

    def left(force: NDArray[np.float64]) -> str:
        return f"{np.sqrt(np.mean((forces.measured - force) ** 2)):.3g} N"

    return (
        f"Force of the drive over time, measured and as three models need it; rms left: {left(forces.before)} before,"
        f" {left(forces.recalibrated)} recalibrated, {left(forces.after)} after."
    )


def drive_picture(diagnosis: Diagnosis) -> Picture | None:
    """The force along a motion for the page, with its words; there is none of dwells."""
    if not isinstance(diagnosis.responses, DriveForces):
        return None
    return embed(drive_figure_of(diagnosis), drive_words(diagnosis))
