"""Roads and link motions: what they are at every instant, and that their rates are derivatives."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.errors import InputError
from savgs_ident.plants.profiles import AbstractProfile, Constant, LinearSweep, Offset, Sine, tabulated
from savgs_ident.plants.quarter_car.inputs import (
    ImposedLink,
    RoadMotion,
    cam_road,
    flat_road,
    held_link,
    read_road,
    sweep_road,
)

TIMES = np.linspace(0.0, 4.0, 401)


def over(function: object, times: np.ndarray) -> np.ndarray:
    """A function of time at many times."""
    return np.asarray(jax.jit(jax.vmap(function))(jnp.asarray(times)))  # type: ignore[arg-type]


PROFILES: dict[str, AbstractProfile] = {
    "constant": Constant(0.3),
    "sine": Sine(0.01, 2.0, 0.2, 0.4, 1.5),
    "sweep": LinearSweep(0.01, 0.2, 2.0, 3.0),
    "offset": Offset(LinearSweep(0.01, 0.2, 2.0, 3.0), 0.3),
    "table": tabulated(TIMES[::7] ** 1.1, np.sin(3.0 * TIMES[::7])),
}


@pytest.mark.parametrize("name", PROFILES)
def test_the_rate_is_the_derivative(name: str) -> None:
    profile, step = PROFILES[name], 1e-5
    times = TIMES[3:-3] + 0.0031
    difference = (over(profile.value, times + step) - over(profile.value, times - step)) / (2.0 * step)
    rate = over(profile.rate, times)
    assert np.max(np.abs(rate - difference)) < 1e-6 * max(1.0, np.max(np.abs(rate)))


def test_a_cam_grows_from_rest_and_is_steady_then() -> None:
    road = cam_road(0.0275, 2.35, rise_time=1.0)
    height, velocity = over(road.height, TIMES), over(road.velocity, TIMES)
    assert height[0] == 0.0
    assert velocity[0] == 0.0
    steady = TIMES >= 1.0
    wave = 2.0 * np.pi * 2.35
    np.testing.assert_allclose(height[steady], 0.01375 * np.cos(wave * TIMES[steady]), atol=1e-15)
    np.testing.assert_allclose(velocity[steady], -0.01375 * wave * np.sin(wave * TIMES[steady]), atol=1e-13)


def test_a_cam_may_be_steady_from_the_start() -> None:
    height = over(cam_road(0.0275, 2.0).height, TIMES)
    np.testing.assert_allclose(height, 0.01375 * np.cos(4.0 * np.pi * TIMES), atol=1e-15)


@pytest.mark.parametrize(
    "road", [cam_road(0.0275, 2.35), sweep_road(0.0275, 0.5, 3.0, 2.5)], ids=["dwell", "sweep"]
)
def test_the_cam_is_at_nought_where_it_lifts_highest(road: RoadMotion) -> None:
    """Its height is the cosine of its angle, in the dwell, in the sweep and after it."""
    cam = jax.jit(jax.vmap(road.cam_at))(jnp.asarray(TIMES))
    assert cam is not None
    np.testing.assert_allclose(0.01375 * np.cos(cam.angle), over(road.height, TIMES), atol=1e-14)
    lift = -0.01375 * np.sin(cam.angle) * np.asarray(cam.speed)
    np.testing.assert_allclose(lift, over(road.velocity, TIMES), atol=1e-13)
    gained = np.diff(np.asarray(cam.angle)) / np.diff(TIMES)
    between = (np.asarray(cam.speed)[1:] + np.asarray(cam.speed)[:-1]) / 2.0
    np.testing.assert_allclose(gained, between, rtol=1e-9)


def test_nothing_turns_behind_a_road_that_no_cam_drives() -> None:
    for road in (flat_road(), RoadMotion(tabulated([0.0, 1.0], [0.0, 0.01]))):
        assert road.cam_at(jnp.zeros(())) is None


def test_a_sweep_starts_at_rest_and_gains_frequency_evenly() -> None:
    road = sweep_road(0.0275, 0.0, 3.0, 60.0)
    assert over(road.height, np.zeros(1))[0] == 0.0
    assert over(road.velocity, np.zeros(1))[0] == 0.0
    times = np.linspace(0.0, 62.0, 620_001)
    height = over(road.height, times)
    upwards = np.flatnonzero((height[:-1] < -1e-9) & (height[1:] >= -1e-9))
    share = -height[upwards] / (height[upwards + 1] - height[upwards])
    crossing = times[upwards] + 1e-4 * share
    frequency, middle = 1.0 / np.diff(crossing), (crossing[1:] + crossing[:-1]) / 2.0
    # Over a whole turn the mean frequency of a linear sweep is that at the middle of the turn's time.
    np.testing.assert_allclose(frequency, np.minimum(3.0, 0.05 * middle), rtol=2e-4)
    assert np.max(np.abs(height)) == pytest.approx(0.01375, rel=1e-6)


def test_a_road_without_motion_is_flat() -> None:
    assert not over(flat_road().height, TIMES).any()
    assert not over(flat_road().velocity, TIMES).any()


def test_a_fine_table_of_a_wave_is_the_wave() -> None:
    """As fine as a recording: 500 samples a second, of 3 Hz, at uneven times."""
    times = np.arange(0.0, 3.0, 0.002) + np.random.default_rng(3).normal(0.0, 4e-5, 1500)
    wave = 6.0 * np.pi
    road = RoadMotion(tabulated(times, 0.01375 * np.sin(wave * times)))
    between = np.linspace(0.01, 2.98, 5001)
    height, velocity = over(road.height, between), over(road.velocity, between)
    assert np.max(np.abs(height - 0.01375 * np.sin(wave * between))) < 1e-4 * 0.01375
    assert np.max(np.abs(velocity - 0.01375 * wave * np.cos(wave * between))) < 1e-2 * 0.01375 * wave


gaps = st.lists(st.floats(1e-4, 10.0), min_size=12, max_size=12)
values_of = jax.jit(lambda profile, times: jax.vmap(profile.value)(times))


@given(gaps=gaps, seed=st.integers(0, 2**31))
def test_a_table_passes_through_its_points_and_holds_its_ends(gaps: list[float], seed: int) -> None:
    times = np.cumsum([-1.0, *gaps])
    values = np.random.default_rng(seed).normal(size=times.size)
    profile = tabulated(times, values)
    np.testing.assert_allclose(values_of(profile, jnp.asarray(times)), values, rtol=1e-9, atol=1e-9)
    outside = values_of(profile, jnp.asarray([times[0] - 5.0, times[-1] + 5.0]))
    np.testing.assert_allclose(outside, values[[0, -1]], rtol=1e-9, atol=1e-9)


def test_a_table_has_no_kinks() -> None:
    times = np.array([0.0, 0.1, 0.15, 0.4, 0.41, 1.0])
    profile = tabulated(times, [0.0, 1.0, -1.0, 0.5, 0.6, 0.0])
    inner, step = times[1:-1], 1e-9
    before, after = over(profile.rate, inner - step), over(profile.rate, inner + step)
    np.testing.assert_allclose(before, after, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ("time", "height", "says"),
    [
        ([0.0], [1.0], "no table"),
        ([0.0, 1.0], [1.0], "no table"),
        ([0.0, 1.0], [1.0, np.nan], "not finite"),
        ([0.0, 1.0, 1.0], [0.0, 1.0, 2.0], "does not increase"),
    ],
)
def test_a_bad_table_is_refused(time: list[float], height: list[float], says: str) -> None:
    with pytest.raises(InputError, match=says):
        tabulated(time, height, "bump.csv")


def test_a_road_is_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "bump.csv"
    path.write_text("time [s],height [m]\n0,0\n0.5,0.05\n1,0\n")
    road: RoadMotion = read_road(path)
    assert float(road.height(jnp.asarray(0.5))) == pytest.approx(0.05)
    path.write_text("time [s],height [m],velocity\n0,0,0\n1,0,0\n")
    with pytest.raises(InputError, match="3 columns"):
        read_road(path)
    path.write_text("time [s],height [m]\n0,up\n")
    with pytest.raises(InputError, match="not a readable road"):
        read_road(path)
    with pytest.raises(InputError, match="not a readable road"):
        read_road(tmp_path / "absent.csv")


def test_links_are_held_swung_and_tabulated() -> None:
    none, t = jnp.zeros(0), jnp.asarray(0.25)
    held = held_link(1.2).link(t, none)
    assert (float(held.angle), float(held.velocity)) == (1.2, 0.0)
    swung = ImposedLink(Sine(0.1, 1.0, 1.5, 0.0, 0.0)).link(t, none)
    assert float(swung.angle) == pytest.approx(1.5, abs=1e-12)
    assert float(swung.velocity) == pytest.approx(-0.2 * np.pi)
    table = ImposedLink(tabulated([0.0, 1.0], [1.0, 2.0])).link(t, none)
    assert float(table.angle) == pytest.approx(1.25)
    assert float(table.velocity) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,height\n", "is not a readable road"),
        ("", "is not a readable road"),
        ("time,height\n0,0\n1,1e308\n2,-1e308\n3,1e308\n4,0\n", "too steep"),
    ],
)
def test_a_road_without_rows_or_beyond_all_numbers_is_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "road.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said) as caught:
        read_road(path)
    assert caught.value.source == str(path)
