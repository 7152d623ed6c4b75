"""The rig with its ports: the share of the gap that a law at each port explains, the named port in orange.

A side view from the rig's own hardpoints: y from the rail to the wheel, z up from the road plate. Drawn to scale are
the linkage, the wheel and the carriages; body, frame, cam and instruments are schematic. The single link is a
hundredth of the rig's height, so it is enlarged in a lens. A port is a dot at its place with a line to its name; the
bar under the name is the share of the recalibrated gap in held-out tests that a law learned there explains.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import cos, hypot, isfinite, sin

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Ellipse, FancyArrow, FancyBboxPatch, Polygon, Rectangle
from matplotlib.transforms import Affine2D
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.plants.quarter_car.ports import LOCATION_WORDS
from savgs_ident.report.text import DASH, percentage
from savgs_ident.report.theme import BLUE, GREY, INK, ORANGE, PALE, new_figure, printable, styled

Point = tuple[float, float]

BODY = "#dfe7ef"
STEEL = "#5b6670"
RUBBER = "#c4c8cc"
FLOOR = -0.30
"""Height of the frame's floor [m]."""

LENS = (0.635, 0.885)
"""Centre of the lens over the single link [m]."""

LENS_RADIUS = 0.135
_ENLARGED = 7.0
_TYRE_HALF_WIDTH = 0.105
_RIM_RADIUS = 0.235


@dataclass(frozen=True)
class RigPoints:
    """Points of the linkage in the nominal state [m], as (y, z), the carriages' heights and the wheel."""

    A: Point
    B: Point
    C: Point
    D: Point
    E: Point
    F: Point
    G: Point
    W: Point
    crank: float
    carriages: tuple[float, float]
    tyre_radius: float
    tilt: float


def rig_points(parameters: ParameterTable) -> RigPoints:
    """The points of a rig."""

    def at(name: str) -> Point:
        return parameters[f"{name}_y"].value, parameters[f"{name}_z"].value

    length, start, turn = parameters.values_of(("l_SL", "theta_0", "psi_nominal"))
    middle, apart = parameters.values_of(("z_tb", "l_tb"))
    crank, pivot = start + turn, at("G")
    return RigPoints(
        **{name: at(name) for name in "ABCDEGW"},
        F=(pivot[0] + length * cos(crank), pivot[1] + length * sin(crank)),
        crank=crank,
        carriages=(middle - 0.5 * apart, middle + 0.5 * apart),
        tyre_radius=parameters["r_free"].value,
        tilt=parameters["tilt"].value,
    )


def _draw_rig(axes: Axes, at: RigPoints) -> None:
    """Everything but the ports."""
    _draw_frame(axes, at)
    _draw_road(axes, at)
    _draw_wheel(axes, at)
    _draw_body(axes, at)
    _draw_linkage(axes, at)
    _draw_strut(axes, at)
    _draw_instruments(axes, at)
    _draw_lens(axes, at)


def _draw_frame(axes: Axes, at: RigPoints) -> None:
    top = at.carriages[1] + 0.17
    axes.add_patch(
        Rectangle((-0.035, FLOOR), 0.06, top - FLOOR, facecolor="#eceff2", edgecolor=STEEL, lw=1.0)
    )
    axes.add_patch(Rectangle((0.025, 0.33), 0.014, top - 0.36, facecolor=STEEL, edgecolor="none"))
    axes.add_patch(
        Rectangle((-0.035, FLOOR - 0.035), 0.9, 0.035, facecolor="#eceff2", edgecolor=STEEL, lw=1.0)
    )
    for left in np.arange(-0.035, 0.86, 0.03):
        axes.plot([left, left - 0.025], [FLOOR - 0.035, FLOOR - 0.06], color=GREY, lw=0.7)
    axes.plot([-0.06, 0.865], [FLOOR - 0.035, FLOOR - 0.035], color=STEEL, lw=1.0)


def _draw_road(axes: Axes, at: RigPoints) -> None:
    """Plate on a guided post, on a cam."""
    y = at.W[0]
    axes.add_patch(Rectangle((y - 0.19, -0.022), 0.38, 0.022, facecolor=STEEL, edgecolor=INK, lw=0.8))
    axes.add_patch(Rectangle((y - 0.016, -0.125), 0.032, 0.103, facecolor="white", edgecolor=STEEL, lw=1.0))
    for side in (-0.042, 0.022):
        axes.add_patch(Rectangle((y + side, -0.1), 0.02, 0.055, facecolor="#eceff2", edgecolor=STEEL, lw=0.8))
    axes.add_patch(Ellipse((y, -0.19), 0.16, 0.13, facecolor="white", edgecolor=STEEL, lw=1.2))
    axes.add_patch(Circle((y + 0.018, -0.2), 0.011, facecolor=STEEL, edgecolor="none"))
    axes.add_patch(Polygon([(y - 0.05, FLOOR), (y + 0.086, FLOOR), (y + 0.018, -0.2)], facecolor="none",
                           edgecolor=STEEL, lw=0.9))  # fmt: skip


def _draw_wheel(axes: Axes, at: RigPoints) -> None:
    """Rim and tyre cut open, so that the upright is seen; the tyre ends at the plate."""
    tilted = Affine2D().rotate(at.tilt).translate(*at.W) + axes.transData
    plate = Rectangle((-1.0, 0.0), 3.0, 3.0, transform=axes.transData)
    outer, wide = at.tyre_radius, _TYRE_HALF_WIDTH
    for side in (-1.0, 1.0):
        low = min(side * _RIM_RADIUS, side * outer)
        tyre = FancyBboxPatch(
            (-wide + 0.03, low + 0.03), 2.0 * wide - 0.06, outer - _RIM_RADIUS - 0.06, transform=tilted,
            boxstyle="round,pad=0.03", facecolor=RUBBER, edgecolor=STEEL, lw=1.1,
        )  # fmt: skip
        axes.add_patch(tyre)
        tyre.set_clip_path(plate)
        axes.add_patch(
            Rectangle((-wide + 0.008, side * _RIM_RADIUS - 0.007), 2.0 * wide - 0.016, 0.014, transform=tilted,
                      facecolor=STEEL, edgecolor="none")
        )  # fmt: skip
    spoke = Rectangle((0.055, -_RIM_RADIUS), 0.014, 2.0 * _RIM_RADIUS, transform=tilted, facecolor=STEEL,
                      edgecolor="none")  # fmt: skip
    axes.add_patch(spoke)


def _draw_body(axes: Axes, at: RigPoints) -> None:
    """The sprung mass from the carriages to the pivots, with its payload on top."""
    a, b, g, (low, high) = at.A, at.B, at.G, at.carriages
    outline = [
        (0.085, low - 0.06), (a[0] - 0.03, a[1] - 0.045), (a[0] + 0.025, a[1] - 0.03), (b[0] + 0.03, b[1] + 0.01),
        (b[0] + 0.03, b[1] + 0.06), (g[0] + 0.055, g[1] - 0.015), (g[0] + 0.055, high + 0.02), (0.085, high + 0.02),
    ]  # fmt: skip
    axes.add_patch(Polygon(outline, closed=True, facecolor=BODY, edgecolor=STEEL, lw=1.3, joinstyle="round"))
    for level in range(3):
        axes.add_patch(
            Rectangle(
                (0.105, high + 0.022 + 0.026 * level),
                0.13,
                0.024,
                facecolor="#cfd6dd",
                edgecolor=STEEL,
                lw=0.8,
            )
        )
    for height in at.carriages:
        axes.add_patch(
            Rectangle((0.039, height - 0.04), 0.046, 0.08, facecolor="white", edgecolor=INK, lw=1.1)
        )
        for wheel in (-0.02, 0.02):
            axes.add_patch(Circle((0.05, height + wheel), 0.011, facecolor=STEEL, edgecolor="none"))
    axes.text(
        0.205, 0.5 * (low + high) + 0.08, "sprung\nmass", ha="center", va="center", fontsize=8.5, color=STEEL
    )


def _draw_linkage(axes: Axes, at: RigPoints) -> None:
    upright = [at.C, (at.W[0] + 0.012, at.W[1] - 0.05), (at.W[0] + 0.012, at.W[1] + 0.05), at.D]
    axes.add_patch(
        Polygon(upright, closed=True, facecolor="#aeb9c4", edgecolor=INK, lw=1.1, joinstyle="round")
    )
    axes.add_patch(
        Rectangle((at.W[0] - 0.01, at.W[1] - 0.03), 0.075, 0.06, facecolor="#aeb9c4", edgecolor=INK, lw=1.0)
    )
    for inner, outer in ((at.A, at.C), (at.B, at.D)):
        axes.plot([inner[0], outer[0]], [inner[1], outer[1]], color=INK, lw=4.2, solid_capstyle="round")
        axes.plot([inner[0], outer[0]], [inner[1], outer[1]], color="#8fa0b0", lw=2.4, solid_capstyle="round")
    for joint in (at.A, at.B, at.C, at.D):
        axes.add_patch(Circle(joint, 0.0115, facecolor="white", edgecolor=INK, lw=1.1, zorder=3.2))


def _draw_strut(axes: Axes, at: RigPoints) -> None:
    """Spring about a damper, from the eye on the lower wishbone to the crank pin."""
    eye, pin = np.array(at.E), np.array(at.F)
    length = float(np.linalg.norm(pin - eye))
    along = (pin - eye) / length
    across = np.array([-along[1], along[0]])

    def place(far: float, aside: float) -> NDArray[np.float64]:
        return np.asarray(eye + far * length * along + aside * across)

    turns, ends = 6, (0.26, 0.9)
    far = np.linspace(*ends, 2 * turns + 1)
    side = 0.043 * np.array([1.0 if n % 2 else -1.0 for n in range(far.size)])
    coil = np.array([place(f, s) for f, s in zip(far, side, strict=True)])
    # The half of each turn that lies behind the damper is drawn before it.
    for n in range(0, coil.shape[0] - 1, 2):
        axes.plot(*coil[n : n + 2].T, color=GREY, lw=1.5, solid_capstyle="round", zorder=2.2)
    tube = [place(0.06, -0.022), place(0.58, -0.022), place(0.58, 0.022), place(0.06, 0.022)]
    axes.plot(*np.array([place(0.58, 0.0), place(1.0, 0.0)]).T, color=STEEL, lw=3.0, zorder=2.3)
    axes.add_patch(Polygon(tube, closed=True, facecolor="#e9edf1", edgecolor=INK, lw=1.0, zorder=2.4))
    for n in range(1, coil.shape[0] - 1, 2):
        axes.plot(*coil[n : n + 2].T, color=STEEL, lw=2.4, solid_capstyle="round", zorder=2.5)
    for end in ends:
        axes.plot(*np.array([place(end, -0.052), place(end, 0.052)]).T, color=INK, lw=2.0, zorder=2.6)
    axes.add_patch(Circle(at.E, 0.0115, facecolor="white", edgecolor=INK, lw=1.1, zorder=3.2))


def locate_accelerometer(at: RigPoints) -> Point:
    """Where the accelerometer is [m]."""
    return 0.278, at.carriages[1] + 0.04


def locate_potentiometer(at: RigPoints) -> Point:
    """Where the middle of the potentiometer is [m]."""
    y = 0.80 * at.D[0] + 0.20 * at.B[0]
    return y, at.D[1] + 0.105


def _draw_instruments(axes: Axes, at: RigPoints) -> None:
    y, z = locate_accelerometer(at)
    axes.add_patch(Rectangle((y - 0.018, z - 0.019), 0.036, 0.03, facecolor="white", edgecolor=INK, lw=1.1))
    axes.add_patch(FancyArrow(y, z + 0.022, 0.0, 0.05, width=0.002, head_width=0.018, color=INK, lw=0.0))
    y, z = locate_potentiometer(at)
    foot = at.B[1] + (at.D[1] - at.B[1]) * (y - at.B[0]) / (at.D[0] - at.B[0])
    axes.plot([at.G[0] + 0.055, y], [z + 0.085, z + 0.085], color=STEEL, lw=2.4)
    axes.plot([y, y], [z, z + 0.085], color=INK, lw=1.2)
    axes.plot([y, y], [foot, z - 0.02], color=INK, lw=1.2)
    axes.add_patch(Rectangle((y - 0.013, z - 0.045), 0.026, 0.085, facecolor="white", edgecolor=INK, lw=1.1))


def _draw_lens(axes: Axes, at: RigPoints) -> None:
    """The single link enlarged, with its gear about G, and lines from where it is."""
    centre, g, f = np.array(LENS), np.array(at.G), np.array(at.F)
    span = centre - g
    length = hypot(*span)
    across = np.array([-span[1], span[0]]) / length
    for side in (-1.0, 1.0):
        ends: Sequence[NDArray[np.float64]] = (g + side * 0.02 * across, centre + side * LENS_RADIUS * across)
        axes.plot(*np.array(ends).T, color=GREY, lw=0.8, zorder=3.4)
    axes.add_patch(Circle(at.G, 0.021, facecolor="none", edgecolor=GREY, lw=1.0, zorder=3.4))
    axes.add_patch(Circle(at.F, 0.006, facecolor="white", edgecolor=INK, lw=0.9, zorder=3.3))
    lens = Circle(LENS, LENS_RADIUS, facecolor="white", edgecolor=GREY, lw=1.3, zorder=3.5)
    axes.add_patch(lens)
    middle = 0.5 * (f + g)

    def enlarged(point: NDArray[np.float64]) -> Point:
        y, z = centre + _ENLARGED * (point - middle)
        return float(y), float(z) + 0.012

    pivot, pin = enlarged(g), enlarged(f)
    eye = np.array(at.E)
    strut = np.array([pin, np.array(pin) + 0.3 * (eye - f) / np.linalg.norm(eye - f)])
    (rod,) = axes.plot(*strut.T, color=STEEL, lw=6.0, zorder=3.6)
    rod.set_clip_path(lens)
    axes.add_patch(
        Circle(pivot, 0.042, facecolor="#eceff2", edgecolor=STEEL, lw=1.0, ls=(0, (2, 1.4)), zorder=3.6)
    )
    axes.plot(*np.array([pivot, pin]).T, color=INK, lw=6.5, solid_capstyle="round", zorder=3.7)
    axes.plot(*np.array([pivot, pin]).T, color="#8fa0b0", lw=4.2, solid_capstyle="round", zorder=3.7)
    for joint in (pivot, pin):
        axes.add_patch(Circle(joint, 0.0105, facecolor="white", edgecolor=INK, lw=1.1, zorder=3.8))
    axes.text(
        LENS[0] + 0.06,
        LENS[1] - 0.07,
        f"\u00d7 {_ENLARGED:g}",
        ha="center",
        fontsize=8.5,
        color=STEEL,
        zorder=3.8,
    )


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
    """A port in the picture: where it is, where its name stands [m], its share, and whether the verdict names it."""

    port: str
    place: Point | None
    name_at: Point
    share: float
    named: bool


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
        "sensor.sprung_accel": locate_accelerometer(at),
        "sensor.susp_deflection": locate_potentiometer(at),
    }


def port_marks(diagnosis: Diagnosis) -> tuple[PortMark, ...]:
    """Every port with its mark; those that the picture has no place for are named below on the left."""
    places = port_places(rig_points(diagnosis.given.table))
    shares = {each.port: each.share for each in diagnosis.ports}
    names_at = {port: (_LEFT_EDGE, z) for port, z in zip(_LEFT_ROWS, _LEFT_HEIGHTS, strict=True)}
    names_at |= {port: (_RIGHT_EDGE, z) for port, z in zip(_RIGHT_ROWS, _RIGHT_HEIGHTS, strict=True)}
    others = [port for port in (*shares, *diagnosis.verdict.ports) if port not in names_at]
    for number, port in enumerate(dict.fromkeys(others)):
        names_at[port] = (_LEFT_EDGE, _LEFT_HEIGHTS[-1] - (number + 1) * _ROW)
    named = diagnosis.verdict.ports
    return tuple(
        PortMark(port, places.get(port), where, shares.get(port, float("nan")), port in named)
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
        _draw_rig(axes, rig_points(diagnosis.given.table))
        _draw_marks(axes, port_marks(diagnosis))
        return figure


def _draw_marks(axes: Axes, marks: Sequence[PortMark]) -> None:
    for mark in marks:
        _draw_name(axes, mark)
        if mark.place is not None:
            _draw_place(axes, mark, mark.place)


def _draw_place(axes: Axes, mark: PortMark, place: Point) -> None:
    y, z = mark.name_at
    start = (y + _BAR + 0.012 if y < 0.0 else y - 0.012, z)
    colour = ORANGE if mark.named else GREY
    across, up = zip(start, place, strict=True)
    axes.plot(across, up, color="white", lw=2.6, zorder=4.0)
    axes.plot(across, up, color=colour, lw=1.4 if mark.named else 0.8, zorder=4.1)
    if mark.named:
        axes.add_patch(Circle(place, 0.04, facecolor=ORANGE, alpha=0.22, edgecolor="none", zorder=4.2))
        axes.add_patch(Circle(place, 0.04, facecolor="none", edgecolor=ORANGE, lw=1.8, zorder=4.3))
    axes.add_patch(
        Circle(place, 0.0135, facecolor=ORANGE if mark.named else BLUE, edgecolor="white", lw=1.0, zorder=4.4)
    )


def _draw_name(axes: Axes, mark: PortMark) -> None:
    """Name above, bar and share below, at the height of the bar."""
    y, z = mark.name_at
    known = isfinite(mark.share)
    colour = ORANGE if mark.named else BLUE
    weight = "bold" if mark.named else "normal"
    axes.text(
        y,
        z + 0.028,
        printable(LOCATION_WORDS.get(mark.port, mark.port)),
        fontsize=9.0,
        fontweight=weight,
        color=INK,
        zorder=5,
    )
    axes.add_patch(Rectangle((y, z - 0.013), _BAR, 0.026, facecolor=PALE, edgecolor="none", zorder=5))
    if known:
        filled = _BAR * min(max(mark.share, 0.0), 1.0)
        axes.add_patch(
            Rectangle((y, z - 0.013), filled, 0.026, facecolor=colour, edgecolor="none", zorder=5.1)
        )
    share = percentage(mark.share, 0) if known else DASH
    axes.text(y, z - 0.024, share, fontsize=9.0, fontweight=weight, va="top", color=INK, zorder=5)
