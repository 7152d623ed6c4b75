"""Roads: the spectrum and the variance that ISO 8608 gives them, the bump's shape and timing, soft initial_states."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import welch

from savgs_ident.control.closed_loop.programme import BAND, REFERENCE, STEP, bump_road, iso_height, iso_road
from savgs_ident.plants.profiles import Faded, Sine
from savgs_ident.plants.quarter_car.inputs import RoadMotion

from ..in_one_test import over
from .loops import along

GEOMETRIC_MEAN = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}
"""G_d(0.1 cycles/m) [m^3], from table C.1 of the standard."""

LONG = 400.0
"""A drive that is long enough for its statistics [s]."""


def spectrum(grade: str, n: NDArray[np.float64]) -> NDArray[np.float64]:
    """G_d [m^3] at spatial frequencies [cycles/m]."""
    return GEOMETRIC_MEAN[grade] * (n / 0.1) ** -2.0


def test_the_standard_is_read_as_it_is_printed() -> None:
    assert pytest.approx(0.1) == REFERENCE
    assert pytest.approx((0.011, 2.83)) == BAND


@pytest.mark.slow
@over("grade", GEOMETRIC_MEAN)
@over("speed", [5.0, 20.0, 40.0])
def test_the_spectrum_of_a_road_is_that_of_its_class_at_any_speed(grade: str, speed: float) -> None:
    """Estimated by Welch's method and compared band by band, within four deviations of such an estimate."""
    part = 2**15
    frequency, density = welch(iso_height(grade, speed, LONG), 1.0 / STEP, nperseg=part, detrend="linear")
    n, found = frequency / speed, density * speed
    parts = 2.0 * LONG / STEP / part
    edges = np.geomspace(max(0.02, 4.0 * n[1]), 0.9 * BAND[1], 6)
    for low, high in pairwise(edges):
        inside = (n >= low) & (n < high)
        ratio = np.mean(found[inside] / spectrum(grade, n[inside]))
        assert ratio == pytest.approx(1.0, abs=4.0 / np.sqrt(parts * np.sum(inside)))


@pytest.mark.slow
@pytest.mark.parametrize("grade", GEOMETRIC_MEAN)
def test_the_variance_is_the_integral_of_the_spectrum_over_the_band(grade: str) -> None:
    height = iso_height(grade, 20.0, 4.0 * LONG)
    area = GEOMETRIC_MEAN[grade] * 0.1**2 * (1.0 / BAND[0] - 1.0 / BAND[1])
    # The lines of so long a road lie 0.3 % of the band's lower end apart.
    assert np.var(height) == pytest.approx(area, rel=0.003)


def test_nothing_is_slower_or_faster_than_the_band() -> None:
    height, speed = iso_height("C", 20.0, 20.0), 20.0
    n = np.fft.rfftfreq(height.size, STEP) / speed
    size = np.abs(np.fft.rfft(height))
    outside = (n < BAND[0]) | (n > BAND[1])
    assert np.max(size[outside]) < 1e-9 * np.max(size)
    assert np.all(size[~outside] > 1e-4 * np.max(size))


def test_each_class_is_twice_as_high_as_the_one_before() -> None:
    roads = [iso_height(grade, 20.0, 10.0) for grade in GEOMETRIC_MEAN]
    for smoother, rougher in pairwise(roads):
        assert rougher == pytest.approx(2.0 * smoother, rel=1e-12, abs=1e-18)


def test_a_road_is_the_same_every_time() -> None:
    assert iso_height("B", 20.0, 10.0).tolist() == iso_height("B", 20.0, 10.0).tolist()


def test_a_class_that_there_is_none_of_is_refused() -> None:
    with pytest.raises(KeyError):
        iso_height("Z", 20.0, 10.0)


def test_the_plate_follows_the_road_between_its_beginning_and_its_end() -> None:
    duration, fade = 4.0, 0.5
    table = iso_height("B", 20.0, duration + fade)
    times = STEP * np.arange(round((duration + 2.0 * fade) / STEP))
    height, velocity = along(iso_road("B", 20.0, duration, fade), times)
    going = (times >= fade) & (times <= duration)
    assert height[going] == pytest.approx(table[: times.size][going[: table.size]], abs=1e-15)
    gone = times > duration + fade
    for values in (height, velocity):
        assert values[0] == 0.0
        assert np.all(values[gone] == 0.0)
    assert np.std(height[going]) > 1e-3


@given(
    height=st.floats(0.01, 0.12),
    length=st.floats(0.5, 8.0),
    speed=st.floats(2.0, 20.0),
    start=st.floats(0.1, 2.0),
)
def test_a_bump_is_one_wave_of_a_cosine_in_its_place(
    height: float, length: float, speed: float, start: float
) -> None:
    passing, steepest = length / speed, np.pi * height / length * speed
    share = np.linspace(-0.5, 1.5, 801)
    found, velocity = along(bump_road(height, length, speed, start), start + passing * share)
    on = (share > 0.0) & (share < 1.0)
    assert found == pytest.approx(
        np.where(on, 0.5 * height * (1.0 - np.cos(2.0 * np.pi * share)), 0.0), abs=2e-5 * height
    )
    # A table of 200 pieces knows the slope less well.
    assert velocity == pytest.approx(
        np.where(on, steepest * np.sin(2.0 * np.pi * share), 0.0), abs=0.01 * steepest
    )
    assert np.max(found) == pytest.approx(height, rel=1e-9)
    assert share[np.argmax(found)] == pytest.approx(0.5)


@pytest.mark.parametrize("corner", [0.0, 0.5, 3.0, 3.5])
def test_a_faded_road_has_neither_steps_nor_kinks(corner: float) -> None:
    """At its corners height and velocity go on as they came, and it lies still at both ends."""
    faded = RoadMotion(Faded(Sine(0.01, 2.3, 0.0, 0.4, 0.0), 3.0, 0.5))
    step = 1e-6
    height, velocity = along(faded, corner + step * np.arange(-4.0, 5.0))
    assert np.diff(height) / step == pytest.approx(0.5 * (velocity[1:] + velocity[:-1]), abs=1e-8)
    assert np.max(np.abs(np.diff(velocity))) < 3.0 * step


def test_a_faded_road_is_the_road_itself_between_and_lies_still_outside() -> None:
    inner = Sine(0.01, 2.3, 0.0, 0.4, 0.0)
    times = np.linspace(-0.2, 4.0, 4201)
    height, velocity = along(RoadMotion(Faded(inner, 3.0, 0.5)), times)
    whole = 0.01 * np.cos(2.0 * np.pi * 2.3 * times + 0.4)
    going = (times >= 0.5) & (times <= 3.0)
    assert height[going] == pytest.approx(whole[going], abs=1e-15)
    assert np.all(np.abs(height) <= np.abs(whole) + 1e-15)
    outside = (times <= 0.0) | (times >= 3.5 + 1e-9)
    assert np.max(np.abs(height[outside])) < 1e-18
    assert np.max(np.abs(velocity[outside])) < 1e-18
