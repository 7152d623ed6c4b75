"""The rig with its ports: how much of the gap a law at each place can carry, the guilty one in orange.

A port is a dot at its place, tied to its name beside the rig; the bar under the name is the share of the recalibrated
gap that a law learned there explains in tests left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle

from savgs_ident.diagnose.result import Diagnosis
from savgs_ident.report.diagnosis_rig_drawing import (
    LENS,
    LENS_RADIUS,
    Point,
    RigPoints,
    accelerometer_at,
    draw_rig,
    potentiometer_at,
    rig_points,
)
from savgs_ident.report.diagnosis_words import port_words
from savgs_ident.report.numerals import DASH, percentage
from savgs_ident.report.style import BLUE, GREY, INK, ORANGE, PALE, label_of, new_figure, styled

WIDTH, HEIGHT = 5.17, 4.95
"""Size of the figure [inch]."""

_SCALE = 3.0
"""Inches of paper per metre of rig."""

_LEFT, _BOTTOM = -0.425, -0.39
_BAR = 0.2
_ROW = 0.16
_LEFT_EDGE, _RIGHT_EDGE = -0.405, 0.98
"""Where the left names begin and the right ones [m]."""

_LEFT_ROWS = ("sensor.sprung_accel", "rail", "inertia", "strut", "suspension", "frame")
_RIGHT_ROWS = ("link", "sensor.susp_deflection", "tyre_radial", "tyre_lateral", "road")
_LEFT_HEIGHTS = (1.12, 0.93, 0.74, 0.47, 0.22, -0.07)
_RIGHT_HEIGHTS = (1.0, 0.64, 0.42, 0.16, -0.1)


@dataclass(frozen=True)
class PortMark:
    """A port in the picture: where it is, where its name stands [m], its share, and whether it is guilty."""

    port: str
    place: Point | None
    name_at: Point
    share: float
    guilty: bool


def port_places(at: RigPoints) -> Mapping[str, Point]:
    """Where each port is in the picture [m]."""
    return {
        "rail": (0.062, at.carriages[1]),
        "strut": (0.5 * (at.E[0] + at.F[0]), 0.5 * (at.E[1] + at.F[1])),
        "suspension": at.A,
        "tyre_radial": (at.W[0], at.W[1] - 0.84 * at.tyre_radius),
        "tyre_lateral": (at.W[0] + 0.06, 0.004),
        "link": (LENS[0] + 0.86 * LENS_RADIUS, LENS[1] + 0.51 * LENS_RADIUS),
        "road": (at.W[0], -0.075),
        "frame": (-0.005, 0.14),
        "inertia": (0.205, 0.5 * sum(at.carriages) - 0.04),
        "sensor.sprung_accel": accelerometer_at(at),
        "sensor.susp_deflection": potentiometer_at(at),
    }


def port_marks(diagnosis: Diagnosis) -> tuple[PortMark, ...]:
    """Every port with its mark; those that the picture has no place for are named below on the left."""
    places = port_places(rig_points(diagnosis.rig.parameters))
    shares = {each.port: each.share for each in diagnosis.ports}
    names_at = {port: (_LEFT_EDGE, z) for port, z in zip(_LEFT_ROWS, _LEFT_HEIGHTS, strict=True)}
    names_at |= {port: (_RIGHT_EDGE, z) for port, z in zip(_RIGHT_ROWS, _RIGHT_HEIGHTS, strict=True)}
    others = [port for port in (*shares, *diagnosis.verdict.ports) if port not in names_at]
    for number, port in enumerate(dict.fromkeys(others)):
        names_at[port] = (_LEFT_EDGE, _LEFT_HEIGHTS[-1] - (number + 1) * _ROW)
    guilty = diagnosis.verdict.ports
    return tuple(
        PortMark(port, places.get(port), where, shares.get(port, float("nan")), port in guilty)
        for port, where in names_at.items()
    )


def rig_figure(diagnosis: Diagnosis) -> Figure:
    """The rig, its ports and their shares."""
    with styled():
        figure = new_figure(WIDTH, HEIGHT)
        figure.set_layout_engine("none")
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set_axis_off()
        axes.set_xlim(_LEFT, _LEFT + WIDTH / _SCALE)
        axes.set_ylim(_BOTTOM, _BOTTOM + HEIGHT / _SCALE)
        draw_rig(axes, rig_points(diagnosis.rig.parameters))
        _draw_marks(axes, port_marks(diagnosis))
        return figure


def _draw_marks(axes: Axes, marks: Sequence[PortMark]) -> None:
    for mark in marks:
        _draw_name(axes, mark)
        if mark.place is not None:
            _draw_place(axes, mark, mark.place)


def _draw_place(axes: Axes, mark: PortMark, place: Point) -> None:
    left = mark.name_at[0] < 0.0
    start = (
        (mark.name_at[0] + _BAR + 0.012, mark.name_at[1])
        if left
        else (mark.name_at[0] - 0.012, mark.name_at[1])
    )
    colour = ORANGE if mark.guilty else GREY
    across, up = zip(start, place, strict=True)
    axes.plot(across, up, color="white", lw=2.6, zorder=4.0)
    axes.plot(across, up, color=colour, lw=1.4 if mark.guilty else 0.8, zorder=4.1)
    if mark.guilty:
        axes.add_patch(Circle(place, 0.04, facecolor=ORANGE, alpha=0.22, edgecolor="none", zorder=4.2))
        axes.add_patch(Circle(place, 0.04, facecolor="none", edgecolor=ORANGE, lw=1.8, zorder=4.3))
    axes.add_patch(
        Circle(
            place, 0.0135, facecolor=ORANGE if mark.guilty else BLUE, edgecolor="white", lw=1.0, zorder=4.4
        )
    )


def _draw_name(axes: Axes, mark: PortMark) -> None:
    """Name above, bar and share below, at the height of the bar."""
    y, z = mark.name_at
    known = isfinite(mark.share)
    colour = ORANGE if mark.guilty else BLUE
    weight = "bold" if mark.guilty else "normal"
    axes.text(
        y, z + 0.028, label_of(port_words(mark.port)), fontsize=9.0, fontweight=weight, color=INK, zorder=5
    )
    axes.add_patch(Rectangle((y, z - 0.013), _BAR, 0.026, facecolor=PALE, edgecolor="none", zorder=5))
    if known:
        filled = _BAR * min(max(mark.share, 0.0), 1.0)
        axes.add_patch(
            Rectangle((y, z - 0.013), filled, 0.026, facecolor=colour, edgecolor="none", zorder=5.1)
        )
    share = percentage(mark.share, 0) if known else DASH
    axes.text(y, z - 0.024, share, fontsize=9.0, fontweight=weight, va="top", color=INK, zorder=5)
