"""The models before and after a diagnosis of tests that do not repeat: the gap over frequency, in windows.

Root mean squares over the windows of what each model misses, in per cent of the response at that frequency, and of
the noise of the measurement.
"""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.fit.result import OverWindows, comparable, recorded_spectra
from savgs_ident.report.bode import LINES
from savgs_ident.report.diagnosis.compared import compared_tests
from savgs_ident.report.diagnosis.text import model_label
from savgs_ident.report.html import Picture, embed
from savgs_ident.report.text import channel_labels
from savgs_ident.report.theme import PALE, magnitude_axis, new_figure, printable, styled


def gap_spectrum_figure(diagnosis: Diagnosis, c: int) -> Figure:
    """The gap of the plant's channel ``c`` over frequency."""
    shown = tuple(channel_labels(diagnosis.given).values())[c]
    frequency, noise, gaps = _gap_spectra(diagnosis, c)
    with styled():
        figure = new_figure(4.6, 4.0)
        axes = figure.subplots()
        axes.set_title(shown.title)
        axes.set_xlabel("frequency [Hz]")
        axes.set_ylabel("gap [% of the response]")
        bottom = 0.5 * float(np.min(np.concatenate([noise, *gaps.values()])))
        axes.fill_between(frequency, bottom, noise, color=PALE, linewidth=0.0, label="measurement noise")
        for (label, values), line in zip(gaps.items(), LINES, strict=True):
            axes.plot(frequency, values, marker="o", markersize=3.0, label=printable(label), **line)
        magnitude_axis(axes)
        axes.set_ylim(bottom=bottom)
        figure.legend(loc="outside upper center", ncols=2)
        return figure


def channels_in_windows(diagnosis: Diagnosis) -> tuple[int, ...]:
    """The places of the channels in which anything is compared in windows."""
    measured, answers = compared_tests(diagnosis)
    names = [each.name for each in diagnosis.given.channels]
    used = comparable(measured, names, answers.after.shape[2] - 1)
    return tuple(int(c) for c in np.flatnonzero(used.any(axis=(0, 2))))


def gap_spectrum_pictures(diagnosis: Diagnosis) -> list[Picture]:
    """The figures of all channels that were recorded, with their words."""
    pictures = []
    for c, shown in enumerate(channel_labels(diagnosis.given).values()):
        if c in channels_in_windows(diagnosis):
            largest = [
                f"{label} {np.max(values):.3g} %" for label, values in _gap_spectra(diagnosis, c)[2].items()
            ]
            words = f"Gap of the {shown.title} over frequency; largest {', '.join(largest)}."
            pictures.append(embed(gap_spectrum_figure(diagnosis, c), words))
    return pictures


def _gap_spectra(
    diagnosis: Diagnosis, c: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], dict[str, NDArray[np.float64]]]:
    """Frequencies [Hz], the noise there and the gap of each model [%], (n,) each."""
    measured, answers = compared_tests(diagnosis)
    names = [each.name for each in diagnosis.given.channels]
    orders = answers.after.shape[2]
    over = OverWindows.of(measured, comparable(measured, names, orders - 1)[:, c])
    recorded, spread = recorded_spectra(measured, names[c], orders)
    size = over.rms(np.abs(recorded) ** 2)
    models = {
        model_label(diagnosis): answers.after,
        "recalibrated": answers.recalibrated,
        "before, as given": answers.before,
    }
    gaps = {
        label: 100.0 * over.rms(np.abs(model[:, c] - recorded) ** 2) / size for label, model in models.items()
    }
    return over.frequency, 100.0 * over.rms(spread) / size, gaps
