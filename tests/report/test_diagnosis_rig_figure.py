"""The rig is drawn at its hardpoints, with the share of every port and the named ones in orange."""

from itertools import combinations
from math import hypot

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.patches import Circle, Rectangle
from numpy.testing import assert_allclose

from savgs_ident.diagnosis.result import Diagnosis
from savgs_ident.plants.quarter_car.ports import LOCATION_WORDS, PORTS
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.report.diagnosis.drawing import port_marks, rig_figure, rig_points
from savgs_ident.report.theme import BLUE, ORANGE

from .diagnosis_synthetic import KINDS, SHARES


def test_the_linkage_is_drawn_at_the_hardpoints_of_the_rig(diagnosis: Diagnosis, rig: Rig) -> None:
    at, p = rig_points(diagnosis.given.table), rig.parameters
    assert (p["C_y"].value, p["C_z"].value) == at.C
    assert hypot(at.F[0] - at.G[0], at.F[1] - at.G[1]) == pytest.approx(p["l_SL"].value)
    assert at.carriages[1] - at.carriages[0] == pytest.approx(p["l_tb"].value)
    # Across the strut, as a link at 90 deg stands.
    strut = (at.F[0] - at.E[0], at.F[1] - at.E[1])
    link = (at.F[0] - at.G[0], at.F[1] - at.G[1])
    cosine = (strut[0] * link[0] + strut[1] * link[1]) / (hypot(*strut) * hypot(*link))
    assert abs(cosine) < 0.05
    circles = [patch for patch in rig_figure(diagnosis).axes[0].patches if isinstance(patch, Circle)]
    centres = [tuple(patch.get_center()) for patch in circles]
    for joint in (at.A, at.B, at.C, at.D, at.E, at.F):
        assert joint in centres


def test_every_port_has_a_place_a_name_and_its_share(diagnosis: Diagnosis) -> None:
    assert set(LOCATION_WORDS) == {port.location for port in PORTS}
    marks = {mark.port: mark for mark in port_marks(diagnosis)}
    assert set(marks) == set(LOCATION_WORDS)
    for port, (share, _) in SHARES.items():
        assert marks[port].share == share
        assert marks[port].place is not None
    figure = rig_figure(diagnosis)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert set(LOCATION_WORDS.values()) <= set(texts)
    assert "94 %" in texts
    bars = [
        patch.get_width()
        for patch in figure.axes[0].patches
        if isinstance(patch, Rectangle) and patch.get_facecolor() in (to_rgba(ORANGE), to_rgba(BLUE))
    ]
    longest = max(bars)
    whole = longest / SHARES["rail"][0]
    expected = [max(share, 0.0) for share, _ in SHARES.values()]
    assert_allclose(sorted(width / whole for width in bars), sorted(expected), atol=1e-9)


def test_the_named_ports_alone_are_orange(by_kind: dict[str, Diagnosis]) -> None:
    for kind, count in (("none", 0), ("effect", 1), ("several", 2), ("unknown", 1)):
        diagnosis = by_kind[kind]
        assert sum(mark.named for mark in port_marks(diagnosis)) == count
        dots = [
            patch.get_center()
            for patch in rig_figure(diagnosis).axes[0].patches
            if isinstance(patch, Circle) and patch.get_facecolor() == to_rgba(ORANGE)
        ]
        places = [mark.place for mark in port_marks(diagnosis) if mark.named]
        assert sorted(map(tuple, dots)) == sorted(place for place in places if place is not None)


def test_no_two_texts_of_the_rig_touch_and_none_is_cut_off(by_kind: dict[str, Diagnosis]) -> None:
    for kind in KINDS:
        figure = rig_figure(by_kind[kind])
        canvas = FigureCanvasAgg(figure)
        boxes = [text.get_window_extent(canvas.get_renderer()) for text in figure.axes[0].texts]
        assert len(boxes) > 20
        for one, other in combinations(boxes, 2):
            assert not one.overlaps(other)
        width, height = figure.get_size_inches() * figure.dpi
        for box in boxes:
            assert box.x0 >= 0.0
            assert box.y0 >= 0.0
            assert box.x1 <= width
            assert box.y1 <= height
