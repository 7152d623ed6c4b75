"""What a posterior predicts for a repetition of the recordings, drawn and counted, by kind of test."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.fit.result import OverWindows
from savgs_ident.inference.result import HarmonicPosterior, MotionPosterior, Posterior
from savgs_ident.report.bode import predictive_band, predictive_figure
from savgs_ident.report.drive import drive_figure
from savgs_ident.report.html import Picture, embed
from savgs_ident.report.posterior.text import NORMAL_95
from savgs_ident.report.spectra import predicted_spectrum, predicted_spectrum_figure
from savgs_ident.report.text import DASH, channel_labels, numeral, per_input_words, unit_text
from savgs_ident.responses.selection import by_kind

SPEEDS = 4
"""Parts into which the rows along a motion are counted."""

OF_DWELLS = (
    "First harmonic {per_input}. The band holds 95 % of the repetitions of the campaign that the posterior predicts, "
    "with noise and model discrepancy. The band is as thin as the line; the lowest panel shows the distance of each "
    "measured point from the middle of its band, in half-widths of the band. Orange: magnitude and phase together "
    "lie outside the 95 % region."
)

OF_WINDOWS = (
    "Root mean squares over the windows, at each frequency that is compared. The band holds 95 % of the repetitions "
    "of the campaign that the posterior predicts, with noise and model discrepancy. The lower panel shows the "
    "distance of the measured spectrum from the middle of the band, in half-widths of the band."
)

OF_MOTION = (
    "The first seconds: speed, the force of the drive, and what the middle of the posterior leaves of it. The band "
    "holds 95 % of the repetitions that the posterior predicts, with noise and model discrepancy."
)
"""What the pictures show."""


@dataclass(frozen=True)
class InsideRow:
    """How many measured harmonics of one order, or in one octave, lie inside; a cell for each channel."""

    where: str
    cells: tuple[str, ...]


def order_rows(posterior: HarmonicPosterior) -> tuple[InsideRow, ...]:
    """Measured harmonics inside the 95 % region, by order and channel; only orders that are compared."""
    compared = np.flatnonzero(np.any(posterior.predictive.used, axis=(0, 1)))
    return tuple(InsideRow(str(k), _inside(posterior, [int(k)])) for k in compared)


def octave_rows(posterior: HarmonicPosterior) -> tuple[InsideRow, ...]:
    """The same of windows, by octaves."""
    used = posterior.predictive.used
    over = OverWindows.of(posterior.measured, np.any(used, axis=1))
    octave = np.floor(np.log2(over.frequency / over.frequency[0]) + 1e-9).astype(int)
    rows = []
    for each in np.unique(octave):
        hertz = over.frequency[octave == each]
        rows.append(
            InsideRow(f"{hertz[0]:.2g} to {hertz[-1]:.2g} Hz", _inside(posterior, over.known[octave == each]))
        )
    return tuple(rows)


def _inside(posterior: HarmonicPosterior, places: Sequence[int] | NDArray[np.int64]) -> tuple[str, ...]:
    """How many of the harmonics at these places lie inside, a cell for each channel."""
    used = posterior.predictive.used[:, :, places]
    inside = posterior.predictive.inside[:, :, places] & used
    return tuple(_count_inside(inside[:, c].sum(), used[:, c].sum()) for c in range(used.shape[1]))


def _count_inside(part: int, whole: int) -> str:
    return f"{part} of {whole}" if whole else DASH


@dataclass(frozen=True)
class Predicted:
    """What is predicted of one kind of test.

    Attributes:
        pictures: of each channel.
        note: what they show.
        by: by what it is counted how much is inside: "octave".
        head: the head of that column.
        titles: those of the columns of counts.
        inside: the counts.
    """

    pictures: list[Picture]
    note: str
    by: str
    head: str
    titles: tuple[str, ...]
    inside: tuple[InsideRow, ...]


def predicted_of(posterior: Posterior) -> list[Predicted]:
    """Of each kind of test that is compared, in the channels in which anything is; of dwells, first harmonics."""
    if isinstance(posterior, MotionPosterior):
        return [_of_motion(posterior)]
    assert isinstance(posterior, HarmonicPosterior), posterior
    dwells, windows = by_kind(posterior)
    channels, both, found = (
        range(len(posterior.model.channels)),
        dwells is not None and windows is not None,
        [],
    )
    titles = tuple(shown.title for shown in channel_labels(posterior.model).values())
    if dwells is not None:
        first = dwells.predictive.used[..., 1]
        pictures = [predicted_picture(dwells, c) for c in channels if first[:, c].any()]
        note = ("Dwells. " * both) + OF_DWELLS.format(per_input=per_input_words(posterior.model))
        found.append(Predicted(pictures, note, "harmonic order", "Order", titles, order_rows(dwells)))
    if windows is not None:
        used = windows.predictive.used
        pictures = [predicted_spectrum_picture(windows, c) for c in channels if used[:, c].any()]
        note = ("Windows of tests that do not repeat. " * both) + OF_WINDOWS
        found.append(Predicted(pictures, note, "octave", "Frequency", titles, octave_rows(windows)))
    return found


def _of_motion(posterior: MotionPosterior) -> Predicted:
    inside, total = posterior.count_inside
    words = (
        f"Force of the drive over time, measured against the prediction: {inside} of {total} rows are inside."
    )
    pictures = [embed(predicted_force_figure(posterior), words)]
    return Predicted(pictures, OF_MOTION, "speed", "Speed", ("force of the drive",), speed_rows(posterior))


def speed_rows(posterior: MotionPosterior) -> tuple[InsideRow, ...]:
    """Rows of force inside the 95 % interval, by quarters of all rows in the order of their speed."""
    unit = unit_text(f"{posterior.model.plant.coordinates[0].unit}/s")
    speed = np.abs(posterior.motion.rows(posterior.motion.velocity))
    rows = []
    for part in np.array_split(np.argsort(speed), SPEEDS):
        ends = (numeral(speed[place], 0.1 * speed.max()) for place in (part[0], part[-1]))
        where = f"{' to '.join(ends)} {unit}"
        rows.append(InsideRow(where, (f"{int(posterior.predictive.inside[part].sum())} of {part.size}",)))
    return tuple(rows)


def predicted_force_figure(posterior: MotionPosterior) -> Figure:
    """The force of the drive over the first seconds, measured and as the posterior's middle needs it."""
    plant, motion = posterior.model.plant, posterior.motion
    models = (("middle of the posterior", np.mean(posterior.predictive.model, axis=0)),)
    spread = float(np.sqrt(np.mean(np.var(posterior.predictive.replicated, axis=0))))
    units = plant.inputs[0].unit, f"{plant.coordinates[0].unit}/s"
    velocity = motion.rows(motion.velocity)
    return drive_figure(
        motion.row_times,
        velocity,
        posterior.measured,
        models,
        NORMAL_95 * spread,
        units,
        "95 % of repetitions",
    )


def predicted_spectrum_picture(posterior: HarmonicPosterior, c: int) -> Picture:
    """What is predicted for one channel in windows, against what was measured."""
    title = tuple(channel_labels(posterior.model).values())[c].title
    _, recorded, ends = predicted_spectrum(posterior, c)
    within = int(np.sum((ends[0] <= recorded) & (recorded <= ends[1])))
    words = (
        f"Spectrum of the {title} over the windows, measured against the 95 % predictive band: at {within} of "
        f"{recorded.size} frequencies it is inside."
    )
    return embed(predicted_spectrum_figure(posterior, c), words)


def predicted_picture(posterior: HarmonicPosterior, c: int) -> Picture:
    """What is predicted for one channel in dwells, against what was measured."""
    title = tuple(channel_labels(posterior.model).values())[c].title
    band = predictive_band(posterior, c)
    compared = np.isfinite(band.measured)
    words = (
        f"Magnitude and phase of the {title} over frequency, measured against the 95 % predictive band:"
        f" {np.sum(band.inside & compared)} of {np.sum(compared)} first harmonics are inside."
    )
    return embed(predictive_figure(posterior, c), words)
