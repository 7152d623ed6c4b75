"""Figures say what they show, in units, draw what they are given, and come out as valid files."""

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from numpy.typing import NDArray

from savgs_ident.fit.result import Fit, measured_points, whitened
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT, load_campaign
from savgs_ident.report.bode import bode_figure, response_figure
from savgs_ident.report.campaigns.inspect import campaign_figure
from savgs_ident.report.text import response_labels
from savgs_ident.report.theme import DPI, frequency_axis, new_figure, printable, write_figure
from savgs_ident.responses.summary import CampaignSummary, inspect
from savgs_ident.simulate.curves import ModelCurve, model_curve

LABELS = tuple(response_labels(RIG_LAYOUT).values())

HOSTILE = "a [bold red]b[/] $\\frac{1}{0}$ \x1b[31m\x07 漢 \ud800"


@pytest.fixture(scope="module")
def curves(mass_on_spring: Callable[..., NDArray[np.complex128]]) -> list[ModelCurve]:
    frequency = np.geomspace(0.5, 6.0, 40)
    road, ok = np.full(40, 0.01375 + 0.0j), np.ones(40, dtype=np.bool_)
    return [
        model_curve(f"damping {d}", frequency, mass_on_spring(frequency, d), road, ok) for d in (0.3, 0.1)
    ]


@pytest.fixture(scope="module")
def bode(fit: Fit, curves: list[ModelCurve]) -> Figure:
    residuals = whitened(fit.measured, fit.channels, fit.predicted, fit.used)
    return bode_figure(
        "A title",
        measured_points(fit.measured, fit.channels, "road_height"),
        curves,
        residuals,
        LABELS,
    )


@pytest.fixture(scope="module")
def summary(nominal_campaign: Path) -> CampaignSummary:
    return inspect(load_campaign(nominal_campaign))


def _panel(figure: Figure, row: int, column: int) -> Axes:
    return figure.axes[2 * row + column]


def test_every_panel_of_the_bode_figure_has_its_unit(bode: Figure) -> None:
    labels = [axes.get_ylabel() for axes in bode.axes]
    assert [label.split("[")[1] for label in labels[::2]] == [
        "m/s² per m of road]",
        "deg]",
        "m/s²]",
        "noise sd]",
    ]
    assert [label.split("[")[1] for label in labels[1::2]] == ["m per m of road]", "deg]", "mm]", "noise sd]"]
    assert all("[Hz]" in _panel(bode, 3, column).get_xlabel() for column in (0, 1))
    texts = [text.get_text() for text in bode.legends[0].get_texts()]
    assert texts == ["damping 0.3", "damping 0.1", "measured, ± 2 sd"]


def test_the_bode_figure_draws_the_numbers_it_is_given(
    bode: Figure, fit: Fit, curves: list[ModelCurve]
) -> None:
    lines = _panel(bode, 2, 1).get_lines()
    assert_allclose(lines[0].get_ydata(), 1e3 * curves[0].peak_to_peak[:, 1])
    assert_allclose(lines[1].get_ydata(), 1e3 * curves[1].peak_to_peak[:, 1])
    assert_allclose(lines[2].get_ydata(), 1e3 * fit.measured.peak_to_peak[:, 2])


def test_all_residuals_are_inside_their_panel(bode: Figure, fit: Fit) -> None:
    residuals = whitened(fit.measured, fit.channels, fit.predicted, fit.used)
    for column in (0, 1):
        low, high = _panel(bode, 3, column).get_ylim()
        assert low < np.nanmin(residuals[:, column])
        assert high > np.nanmax(residuals[:, column])
        drawn = sum(len(marks.get_offsets()) for marks in _panel(bode, 3, column).collections)
        assert drawn >= np.count_nonzero(np.isfinite(residuals[:, column]))


def test_nothing_solved_and_one_channel_only_is_drawn(fit: Fit, tmp_path: Path) -> None:
    other = replace(fit.measured, channels=("road_height", "sprung_accel", "something_else"))
    open_curve = ModelCurve("m", np.array([0.5, 6.0]), np.full((2, 2), np.nan + 0j), np.full((2, 2), np.nan))
    residuals = np.full((8, 2, 6, 2), np.nan)
    figure = bode_figure(
        "open",
        measured_points(other, fit.channels, "road_height"),
        [open_curve],
        residuals,
        LABELS,
    )
    png, _ = write_figure(tmp_path, "bode", figure)
    assert png.stat().st_size > 10_000


def test_pictures_are_valid_files_of_the_size_asked_for(bode: Figure, tmp_path: Path) -> None:
    png, pdf = write_figure(tmp_path, "bode", bode)
    head = png.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = bode.get_size_inches()
    assert struct.unpack(">II", head[16:24]) == (round(width * DPI), round(height * DPI))
    assert pdf.read_bytes().startswith(b"%PDF-")
    assert pdf.read_bytes().rstrip().endswith(b"%%EOF")


@pytest.mark.slow
def test_the_same_figure_gives_the_same_bytes(curves: list[ModelCurve], tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        write_figure(
            tmp_path / name,
            "r",
            response_figure("title", curves, LABELS),
        )
    for suffix in ("png", "pdf"):
        one, two = (tmp_path / name / f"r.{suffix}" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


def test_names_in_a_figure_are_neither_formulas_nor_missing_glyphs(
    curves: list[ModelCurve], tmp_path: Path
) -> None:
    named = [replace(curve, label=HOSTILE) for curve in curves]
    figure = response_figure(HOSTILE, named, LABELS)
    write_figure(tmp_path, "r", figure)
    shown = figure.legends[0].get_texts()[0].get_text()
    assert "[bold red]" in shown
    assert "$" in shown
    assert shown == printable(HOSTILE)
    assert "\x1b" not in shown


def test_the_picture_of_a_campaign_has_units_and_all_dwells(summary: CampaignSummary) -> None:
    figure = campaign_figure(summary)
    panels = figure.axes[:6]
    assert all("[" in axes.get_ylabel() for axes in panels)
    assert summary.response is not None
    for axes in panels[:2]:
        points = [line for line in axes.get_lines() if line.get_marker() == "o"]
        assert len(points[0].get_xdata()) == len(summary.response.tests) == 28
        assert any(line.get_linestyle() == "--" for line in axes.get_lines())


def test_a_campaign_without_dwells_is_drawn(summary: CampaignSummary, tmp_path: Path) -> None:
    bare = replace(summary, response=None, sweeps=(), standstill_noise={})
    figure = campaign_figure(bare)
    assert not any(axes.get_lines() for axes in figure.axes)
    for axes in figure.axes[:2]:
        assert [text.get_text() for text in axes.texts] == ["not recorded"]
    files = write_figure(tmp_path, "inspect", figure)
    assert [each.name for each in files] == ["inspect.png", "inspect.pdf"]
    assert all(each.stat().st_size > 1000 for each in files)


def test_a_response_at_a_single_frequency_is_seen(
    mass_on_spring: Callable[..., NDArray[np.complex128]],
) -> None:
    frequency = np.array([2.0])
    road, ok = np.full(1, 0.01375 + 0.0j), np.ones(1, dtype=np.bool_)
    curve = model_curve("one", frequency, mass_on_spring(frequency, 0.3), road, ok)
    figure = response_figure("one point", [curve], LABELS)
    assert all(axes.get_lines()[0].get_marker() == "o" for axes in figure.axes)


@pytest.mark.parametrize(
    ("lowest", "highest", "numbers"),
    [(0.5, 6.0, ["0.5", "1", "1.5", "2"]), (2.137, 2.137, ["2.137"]), (3.1, 3.6, ["3.1", "3.6"])],
)
def test_every_frequency_axis_has_numbers(lowest: float, highest: float, numbers: list[str]) -> None:
    figure = new_figure(5.0, 4.0)
    axes = figure.subplots()
    frequency_axis(axes, lowest, highest)
    figure.draw_without_rendering()
    low, high = axes.get_xlim()
    shown = [
        label.get_text()
        for place, label in zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
        if low <= place <= high
    ]
    assert list(dict.fromkeys(shown))[: len(numbers)] == numbers


@pytest.mark.parametrize(
    ("lowest", "highest", "some"),
    [
        (0.5, 6.0, [0.5, 1.0, 2.0, 5.0, 6.0]),
        (25.0, 180.0, [30.0, 50.0, 100.0, 150.0]),
        (0.008, 0.09, [0.01, 0.05]),
    ],
)
def test_a_frequency_axis_has_round_numbers_wherever_it_lies(
    lowest: float, highest: float, some: list[float]
) -> None:
    axes = Figure().subplots()
    frequency_axis(axes, lowest, highest)
    ticks = [float(each) for each in axes.get_xticks()]
    assert set(some) <= set(ticks)
    assert 4 <= len(ticks) <= 12
    assert all(lowest / 1.07 < each < 1.07 * highest for each in ticks)
