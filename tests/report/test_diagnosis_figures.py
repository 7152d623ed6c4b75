"""Figures of a diagnosis draw what it says: gaps over the noise, loops, maps."""

from dataclasses import replace
from itertools import pairwise
from math import isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Rectangle
from numpy.testing import assert_allclose

from savgs_ident.diagnosis.gap import MapCell
from savgs_ident.diagnosis.result import Diagnosis, DriveForces
from savgs_ident.effects.base import PortKind
from savgs_ident.plants.model import PlantModel
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.report.diagnosis.block_diagram import block_figure, block_ports
from savgs_ident.report.diagnosis.compared import compared_channels, diagnosis_bode_figure, first_harmonic_gap
from savgs_ident.report.diagnosis.drawing import rig_figure
from savgs_ident.report.diagnosis.figures import (
    NOISE,
    colour_steps,
    gap_channels,
    gap_map_figure,
    gap_table,
    regime_figure,
    regime_picture,
    shrink_figure,
    shrink_rows,
)
from savgs_ident.report.diagnosis.loop_figures import MOST_LOOPS, force_figure, loop_time, spread_loops
from savgs_ident.report.diagnosis.text import law_label
from savgs_ident.report.html import embed

from .diagnosis_synthetic import KINDS, hostile

HOSTILE = "<b>$\\frac{1}{0}$\x1b漢\ud800</b>"


def test_the_gap_of_the_first_harmonic_is_the_one_that_was_put_in(diagnosis: Diagnosis) -> None:
    bump = 12.0 * np.exp(-(((diagnosis.measured.frequency - 2.0) / 0.8) ** 2))
    for c in (0, 1):
        gap = first_harmonic_gap(diagnosis, c)
        # Order 1 has 1.4 of the bump, and what lies below the noise is lost in it.
        assert np.all(np.abs(gap.recalibrated - 1.4 * bump) <= 5.0 * gap.noise + 1e-3)
        assert np.all(np.abs(gap.before - 2.8 * bump) <= 5.0 * gap.noise + 1e-3)
        # Noise in two components of the same size as the measurement's.
        assert np.mean((gap.after / gap.noise) ** 2) == pytest.approx(1.0, abs=0.6)


def test_the_bode_figure_has_units_every_model_and_every_point(diagnosis: Diagnosis) -> None:
    for c, per_road in ((0, "m/s² per m of road]"), (1, "m per m of road]")):
        figure = diagnosis_bode_figure(diagnosis, c)
        assert [axes.get_ylabel().split("[")[1] for axes in figure.axes] == [
            per_road, "deg]", "% of the response]"
        ]  # fmt: skip
        assert figure.axes[2].get_xlabel() == "frequency [Hz]"
        reported = [text.get_text() for text in figure.legends[0].get_texts()]
        assert reported == [
            "before, as given", "recalibrated", "with rail_stribeck", "measured, ± 2 sd", "measurement noise"
        ]  # fmt: skip
        magnitude = {line.get_label(): line.get_ydata() for line in figure.axes[0].get_lines()}
        road = diagnosis.measured.harmonics[:, 0, 1]
        assert_allclose(
            magnitude["recalibrated"], np.abs(diagnosis.responses.recalibrated[:, c, 1] / road), rtol=1e-12
        )
        points = [line for line in figure.axes[0].get_lines() if line.get_marker() == "o"]
        assert len(np.asarray(points[0].get_xdata())) == 28


def test_gaps_are_drawn_inside_the_panel_down_to_half_of_the_noise(diagnosis: Diagnosis) -> None:
    gap = first_harmonic_gap(diagnosis, 0)
    axes = diagnosis_bode_figure(diagnosis, 0).axes[2]
    low, high = axes.get_ylim()
    assert low == pytest.approx(0.5 * gap.noise.min())
    assert high > gap.before.max()
    after, recalibrated, before = (np.asarray(line.get_ydata()) for line in axes.get_lines())
    assert_allclose(after, np.maximum(gap.after, low))
    assert_allclose(recalibrated, np.maximum(gap.recalibrated, low))
    assert_allclose(before, np.maximum(gap.before, low))


def test_every_kind_of_verdict_is_drawn_without_an_empty_panel(by_kind: dict[str, Diagnosis]) -> None:
    for kind in KINDS:
        diagnosis = by_kind[kind]
        figures = [
            rig_figure(diagnosis),
            shrink_figure(diagnosis),
            *(diagnosis_bode_figure(diagnosis, c) for c in compared_channels(diagnosis)),
            *(gap_map_figure(diagnosis, channel) for channel in gap_channels(diagnosis)),
            *(force_figure(diagnosis, loop) for loop in diagnosis.loops),
        ]
        assert len(figures) == (6 if kind == "none" else 10)
        for figure in figures:
            assert all(axes.has_data() for axes in figure.axes)


def test_any_plant_is_drawn_as_a_block_with_each_port_once(diagnosis: Diagnosis) -> None:
    share = replace(diagnosis.ports[0], port="guide", share=0.62)
    found = replace(
        diagnosis,
        given=PlantModel(TwoMass(), PARAMETERS),
        ports=(share, replace(share, port="sensor.body_accel", share=-0.1)),
        verdict=replace(diagnosis.verdict, ports=("guide", HOSTILE)),
    )
    ports = {each.words: each for each in block_ports(found)}
    assert len(ports) == len({port.location for port in TwoMass.ports}) + 1
    words = TwoMass.location_words
    guide, accelerometer = (ports[words.get(name, name)] for name in ("guide", "body_accel"))
    assert (guide.side, guide.share, guide.named) == ("inside", 0.62, True)
    assert (accelerometer.side, accelerometer.named) == ("sensor", False)
    road = next(port.location for port in TwoMass.ports if port.kind is PortKind.INPUT)
    assert ports[words.get(road, road)].side == "input"
    figure = block_figure(found)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert {"62 %", "\u221210 %", "\u2013"} <= {*texts}
    figure.draw_without_rendering()
    assert all(text.get_window_extent().x1 <= figure.bbox.x1 for text in figure.axes[0].texts)
    assert embed(figure, "block").width > 300
    widths = sorted(patch.get_width() for patch in figure.axes[0].patches if isinstance(patch, Rectangle))
    # A negative share is an empty bar, one of 62 % is as long a part of a whole one.
    assert widths[0] == 0.0
    assert widths[1] == pytest.approx(0.62 * widths[-1])


def test_a_channel_that_was_not_recorded_has_no_bode_figure(diagnosis: Diagnosis) -> None:
    alone = replace(diagnosis.measured, channels=("road_height", "sprung_accel", "something_else"))
    assert compared_channels(replace(diagnosis, measured=alone)) == (0,)


def test_dwells_without_a_solution_are_left_open(diagnosis: Diagnosis) -> None:
    after = diagnosis.responses.after.copy()
    after[3:6] = np.nan
    figure = diagnosis_bode_figure(replace(diagnosis, responses=replace(diagnosis.responses, after=after)), 0)
    drawn = np.asarray(figure.axes[0].get_lines()[0].get_ydata())
    assert np.array_equal(np.flatnonzero(np.isnan(drawn)), [3, 4, 5])
    low, high = figure.axes[2].get_ylim()
    assert isfinite(low)
    assert isfinite(high)


def test_the_map_has_each_cell_at_its_dwell_and_order() -> None:
    cells = [
        MapCell("sprung_accel", 2.0, 3, 0.7, 12.0),
        MapCell("sprung_accel", 0.5, 1, 25.0, 300.0),
        MapCell("susp_deflection", 4.0, 1, 9.0, 9.0),
        MapCell("sprung_accel", 2.0, 1, 0.05, 1.0),
    ]
    frequency, orders, sigma, percent = gap_table(cells, "sprung_accel")
    assert frequency.tolist() == [0.5, 2.0]
    assert orders.tolist() == [1, 3]
    assert_allclose(sigma, [[300.0, 1.0], [np.nan, 12.0]])
    assert_allclose(percent, [[25.0, 0.05], [np.nan, 0.7]])


def test_what_is_within_the_noise_is_white_and_larger_gaps_are_darker(diagnosis: Diagnosis) -> None:
    sizes = (0.5, 1.9, 2.1, 7.0, 30.0, 400.0, 4000.0)
    cells = tuple(MapCell("sprung_accel", 1.0 + n, 1, 0.1, size) for n, size in enumerate(sizes))
    figure = gap_map_figure(replace(diagnosis, map=cells), "sprung_accel")
    mesh = figure.axes[0].collections[-1]
    figure.canvas = FigureCanvasAgg(figure)
    figure.canvas.draw()
    light = [float(np.mean(colour[:3])) for colour in np.asarray(mesh.get_facecolor())]
    assert light[0] == light[1] == 1.0
    assert light[1:] == sorted(light[1:], reverse=True)
    assert len(set(light[1:])) == 6


@given(st.floats(0.0, 1e5), st.sampled_from([(NOISE, 100.0), (0.1, 10.0)]))
def test_the_colours_change_at_growing_numbers_that_reach_the_largest_gap(
    largest: float, ends: tuple[float, float]
) -> None:
    first, least = ends
    steps = colour_steps(np.array([np.nan, -largest, 0.1]), first, least)
    assert steps[:2] == (0.0, first)
    assert list(steps) == sorted(set(steps))
    assert len(steps) <= 8
    assert steps[-1] <= max(largest, least) < max(2.5001 * steps[-1], 1e4 + 1e5)


def test_the_map_names_channel_units_and_dwells(diagnosis: Diagnosis) -> None:
    figure = gap_map_figure(diagnosis, "susp_deflection")
    above, below = figure.axes[:2]
    assert above.get_title(loc="left") == "gap [noise sd]"
    assert below.get_title(loc="left") == "gap [% of the response]"
    assert below.get_xlabel() == "frequency of the dwell [Hz]"
    assert above.get_ylabel() == "harmonic order"
    reported = [text.get_text() for text in below.get_xticklabels()]
    assert reported[0] == "0.5"
    assert reported[-1] == "6"
    assert [text.get_text() for text in above.get_yticklabels()] == [str(k) for k in range(1, 10)]


def test_turns_of_many_radians_are_drawn_in_radians(diagnosis: Diagnosis) -> None:
    loop = diagnosis.loops[1]
    wide = replace(loop, displacement=500.0 * loop.displacement, velocity=500.0 * loop.velocity)
    left, right = force_figure(diagnosis, replace(wide, motion_unit="rad")).axes
    assert (left.get_xlabel(), right.get_xlabel()) == ("velocity [rad/s]", "displacement [rad]")
    assert_allclose(np.asarray(left.get_lines()[1].get_xdata())[:-1], wide.velocity)


def test_a_loop_is_drawn_whole_over_velocity_and_displacement(diagnosis: Diagnosis) -> None:
    loop = diagnosis.loops[1]
    figure = force_figure(diagnosis, replace(loop, displacement=loop.displacement + 0.45))
    left, right = figure.axes
    assert left.get_xlabel() == "velocity [mm/s]"
    assert right.get_xlabel() == "displacement [mm]"
    assert left.get_ylabel() == "force [N]"
    inferred, law = left.get_lines()[1:]
    assert_allclose(np.asarray(inferred.get_xdata())[:-1], 1e3 * loop.velocity)
    assert_allclose(np.asarray(inferred.get_ydata())[:-1], loop.inferred)
    assert_allclose(np.asarray(law.get_ydata())[:-1], loop.law)
    # The loop closes, and a displacement counts from the middle of its range.
    over = np.asarray(right.get_lines()[1].get_xdata())
    assert over[0] == over[-1]
    assert over.min() == pytest.approx(-12.0, abs=0.01)
    assert over.max() == pytest.approx(12.0, abs=0.01)


def test_a_loop_without_a_law_has_one_line_and_displacements_are_in_millimetres(
    by_kind: dict[str, Diagnosis],
) -> None:
    loop = by_kind["unknown"].loops[0]
    figure = force_figure(by_kind["unknown"], replace(loop, unit="m", inferred=1e-5 * loop.inferred))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["inferred"]
    assert figure.axes[0].get_ylabel() == "signal [mm]"
    assert law_label(by_kind["several"], "sensor.sprung_accel") == "law of accel_lag"
    assert_allclose(np.asarray(figure.axes[0].get_lines()[1].get_ydata())[:-1], 1e-2 * loop.inferred)


def test_many_loops_are_thinned_from_the_first_test_to_the_last(diagnosis: Diagnosis) -> None:
    loops = tuple(replace(diagnosis.loops[0], frequency_hz=0.5 + 0.1 * n) for n in range(28))
    drawn = [loop.frequency_hz for loop in spread_loops(loops)]
    assert len(drawn) == MOST_LOOPS
    assert drawn == sorted(drawn)
    assert (drawn[0], drawn[-1]) == (loops[0].frequency_hz, loops[-1].frequency_hz)
    assert spread_loops(loops[:MOST_LOOPS]) == loops[:MOST_LOOPS]


def test_gaps_are_drawn_at_their_per_cent(diagnosis: Diagnosis) -> None:
    rows = shrink_rows(diagnosis)
    assert list(rows) == ["both channels", "acceleration", "deflection", "sweep"]
    axes = shrink_figure(diagnosis).axes[0]
    assert axes.get_xlabel().endswith("[%]")
    drawn = {
        (line.get_marker(), float(np.asarray(line.get_ydata())[0])): float(np.asarray(line.get_xdata())[0])
        for line in axes.get_lines()
        if line.get_marker() != "None" and np.asarray(line.get_xdata()).size
    }
    assert drawn["o", 0.0] == pytest.approx(17.32)
    assert drawn["s", 0.0] == pytest.approx(8.71)
    assert drawn["^", 2.0] == pytest.approx(0.31)
    assert drawn["|", 1.0] == pytest.approx(0.28)
    assert drawn["o", 3.0] == pytest.approx(18.81)
    assert drawn["|", 3.0] == pytest.approx(0.21)


def test_regimes_are_bars_at_their_per_cent_and_the_significant_ones_stand_out(diagnosis: Diagnosis) -> None:
    axes = regime_figure(diagnosis).axes[0]
    assert axes.get_xlabel() == "gap there [% of the response]"
    names = [each.get_text().replace("\n", " ") for each in axes.get_yticklabels()]
    assert names == [each.name for each in diagnosis.regimes]
    assert_allclose(
        [bar.get_width() for bar in axes.patches], [each.gap_percent for each in diagnosis.regimes]
    )
    assert len({bar.get_facecolor() for bar in axes.patches[:2]}) == 1
    assert axes.patches[0].get_facecolor() not in {bar.get_facecolor() for bar in axes.patches[2:]}
    assert [each.get_text() for each in axes.texts] == ["p = 0.012", "p = 0.041"]


def test_regimes_are_readable_on_a_narrow_screen(diagnosis: Diagnosis) -> None:
    """At 400 px no name leaves the picture, none overlaps another, and letters are at least 9 px high."""
    figure = regime_figure(diagnosis)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = 400.0 / figure.bbox.width
    boxes = [each.get_window_extent(canvas.get_renderer()) for each in figure.axes[0].get_yticklabels()]
    assert min(box.x0 for box in boxes) >= 0.0
    assert all(below.y1 <= above.y0 for above, below in pairwise(boxes))
    lines = [each.get_text().count("\n") + 1 for each in figure.axes[0].get_yticklabels()]
    assert min(pixels * box.height / count for box, count in zip(boxes, lines, strict=True)) >= 9.0
    shown = [each.get_window_extent(canvas.get_renderer()).x1 for each in figure.axes[0].texts]
    assert max(shown) <= figure.bbox.width


def test_without_regimes_there_is_no_picture_and_none_significant_says_so(
    by_kind: dict[str, Diagnosis],
) -> None:
    assert regime_picture(replace(by_kind["effect"], regimes=())) is None
    quiet = regime_picture(by_kind["none"])
    assert quiet is not None
    assert "in no regime" in quiet.alt


def test_names_in_figures_are_neither_formulas_nor_missing_glyphs(diagnosis: Diagnosis) -> None:
    attacked = hostile(diagnosis, HOSTILE)
    figures = [
        rig_figure(attacked),
        shrink_figure(attacked),
        diagnosis_bode_figure(attacked, 0),
        gap_map_figure(attacked, HOSTILE),
        force_figure(attacked, attacked.loops[0]),
        regime_figure(attacked),
    ]
    for figure in figures:
        assert embed(figure, "hostile").width > 300
    texts = [text.get_text() for text in figures[0].axes[0].texts]
    assert "<b>$\\frac{1}{0}$\\x1b\\u6f22\\ud800</b>" in texts


def test_a_loop_says_of_which_test_it_is_or_of_how_much_of_a_motion(by_kind: dict[str, Diagnosis]) -> None:
    diagnosis = by_kind["effect"]
    loop = diagnosis.loops[0]
    assert loop_time(diagnosis, loop) == "at 0.5 Hz"
    still = np.zeros(3)
    along = replace(diagnosis, responses=DriveForces("motion.mat", *([still] * 6)))
    assert loop_time(along, replace(loop, frequency_hz=1.0 / 24.84)) == "over the first 24.8 s"
