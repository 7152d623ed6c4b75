"""Geometry of the double wishbone: rigid, continuous, as drawn, differentiable."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from numpy.typing import ArrayLike, NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import (
    Linkage,
    crank_pin,
    installation_ratio,
    linkage,
    linkage_slope,
    point,
    strut_length,
)

from .instants import as_values, shifted

TRAVEL = 0.35
"""Angle of the lower wishbone that is tested [rad]: 130 mm of the wheel, five times the cam's lift."""

POINTS = tuple(f"{name}_{axis}" for name in (*"ABCDEGW", "cg_L", "cg_U", "cg_K") for axis in "yz")
LAST_ASSEMBLED, FIRST_ASSEMBLED = -1.31, -1.89
"""Between these angles [rad] of the lower wishbone no upright of the drawing fits (to 0.01)."""

angles = st.floats(-TRAVEL, TRAVEL)
seeds = st.integers(0, 2**32 - 1)


class Joints(NamedTuple):
    """Where the pins C and D [m] are, as points of the upright and as points of the wishbones."""

    C_upright: ArrayLike
    D_upright: ArrayLike
    C_lower: ArrayLike
    D_upper: ArrayLike


def _carried(pivot: Array, turn: Array, vector: Array) -> Array:
    cosine, sine = jnp.cos(turn), jnp.sin(turn)
    return pivot + jnp.stack([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]])


@jax.jit
def _joints(p: Values, pose: Linkage) -> Joints:
    a, b, c, d, w = (point(p, name) for name in "ABCDW")
    return Joints(
        _carried(pose.W, pose.roll_K, c - w),
        _carried(pose.W, pose.roll_K, d - w),
        _carried(a, pose.roll_L, c - a),
        _carried(b, pose.roll_U, d - b),
    )


_pose = jax.jit(linkage)
_poses = jax.jit(jax.vmap(linkage, in_axes=(None, 0)))


@given(angle=angles, seed=seeds)
def test_links_keep_their_lengths_and_the_upright_its_shape(
    numbers: dict[str, float], angle: float, seed: int
) -> None:
    p = as_values(shifted(numbers, seed))
    pose = _pose(p, np.float64(angle))
    joints = Joints(*(np.asarray(place) for place in _joints(p, pose)))
    assert joints.C_upright == pytest.approx(joints.C_lower, abs=1e-14)
    assert joints.D_upright == pytest.approx(joints.D_upper, abs=1e-14)

    def distance(one: ArrayLike, two: ArrayLike) -> float:
        return float(np.hypot(*(np.asarray(one) - np.asarray(two))))

    drawn = {name: np.array([p[f"{name}_y"], p[f"{name}_z"]]) for name in (*"ABCDEW", "cg_L", "cg_U", "cg_K")}
    now = {"A": drawn["A"], "B": drawn["B"], "C": joints.C_upright, "D": joints.D_upright}
    now |= {name: getattr(pose, name) for name in ("W", "E", "cg_L", "cg_U", "cg_K")}
    rigid = ("AC", "BD", "CD", "CW", "DW", "AE", "CE")
    pairs = [tuple(pair) for pair in rigid] + [("cg_L", "A"), ("cg_L", "E"), ("cg_U", "B"), ("cg_U", "D")]
    pairs += [("cg_K", "C"), ("cg_K", "W")]
    for one, two in pairs:
        assert distance(now[one], now[two]) == pytest.approx(distance(drawn[one], drawn[two]), abs=1e-14)


@given(seed=seeds)
def test_the_branch_of_the_assembly_never_changes(numbers: dict[str, float], seed: int) -> None:
    p = as_values(shifted(numbers, seed))
    pose = _poses(p, np.linspace(-TRAVEL, TRAVEL, 141))
    assert float(_pose(p, np.float64(0.0)).roll_K) == pytest.approx(0.0, abs=1e-15)
    steps = np.diff(np.asarray(pose.W), axis=0)
    assert np.all(steps[:, 1] > 0.0)
    assert np.max(np.hypot(*steps.T)) < 2.0 * 0.44 * TRAVEL / 140 * 1.5
    assert np.max(np.abs(np.diff(np.asarray(pose.roll_K)))) < 0.005


def test_beyond_the_travel_there_is_no_number_instead_of_a_wrong_one(numbers: dict[str, float]) -> None:
    angle = np.linspace(FIRST_ASSEMBLED + 0.01, LAST_ASSEMBLED - 0.01, 57)
    pose = _poses(as_values(numbers), angle)
    for name in ("W", "cg_U", "cg_K", "roll_U", "roll_K"):
        assert np.all(np.isnan(np.asarray(getattr(pose, name)))), name
    inside = _poses(as_values(numbers), np.linspace(LAST_ASSEMBLED + 0.01, 1.0, 232))
    assert all(np.all(np.isfinite(np.asarray(part))) for part in inside)


def _figures(p: Values) -> Array:
    """Wheel, centres of gravity, rolls, strut length, installation ratio; angles are among the numbers."""
    pose = linkage(p, p["angle"])
    length = strut_length(p, p["angle"], p["link"])
    ratio = installation_ratio(p, p["angle"], p["link"])
    return jnp.concatenate(
        [pose.W, pose.cg_K, pose.cg_U, jnp.stack([pose.roll_K, pose.roll_U, length, ratio])]
    )


@jax.jit
def _slope(p: Values, direction: Values) -> Array:
    return jax.jvp(_figures, (p,), (direction,))[1]


_figures_now = jax.jit(_figures)


def _central(p: dict[str, float], name: str, step: float) -> NDArray[np.float64]:
    """Derivative of the figures in one number by central differences of fourth order."""

    def at(offset: float) -> NDArray[np.float64]:
        return np.asarray(_figures_now(as_values(p | {name: p[name] + offset})))

    near, far = at(step) - at(-step), at(2.0 * step) - at(-2.0 * step)
    return (8.0 * near - far) / (12.0 * step)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_in_angles_and_hardpoints_are_those_of_differences(
    numbers: dict[str, float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    moved = shifted(numbers, seed) | {"angle": rng.uniform(-0.3, 0.3), "link": rng.uniform(0.0, np.pi)}
    still = as_values(dict.fromkeys(moved, 0.0))
    for name in (*POINTS, "l_SL", "theta_0", "angle", "link"):
        expected = _central(moved, name, 1e-4)
        found = np.asarray(_slope(as_values(moved), still | {name: np.asarray(1.0)}))
        assert found == pytest.approx(expected, abs=2e-9, rel=1e-8), name


@jax.jit
def _both_slopes(p: Values, angle: Array) -> tuple[Linkage, Linkage]:
    moved = jax.jvp(lambda theta: linkage(p, theta), (angle,), (jnp.ones_like(angle),))[1]
    return linkage_slope(p, angle), moved


@given(angle=angles, seed=seeds)
def test_slopes_of_the_pose_are_its_derivatives(numbers: dict[str, float], angle: float, seed: int) -> None:
    """The bodies' turning by how their joints move is what the pose in closed form changes by."""
    turning, moved = _both_slopes(as_values(shifted(numbers, seed)), np.asarray(angle))
    for name, found, expected in zip(Linkage._fields, turning, moved, strict=True):
        assert np.asarray(found) == pytest.approx(np.asarray(expected), rel=1e-11, abs=1e-12), name


@jax.jit
def _installation(p: Values, zero: Array, link: Array) -> dict[str, Array]:
    """The figures of the sheet at the nominal state, by the definitions in its note."""
    pose, slope = jax.jvp(lambda angle: linkage(p, angle), (zero,), (jnp.ones_like(zero),))
    camber, lateral = slope.roll_K / slope.W[1], slope.W[0] / slope.W[1]
    # The plate follows the wheel centre: the tyre stays as it is pressed.
    height = pose.W[1]
    return {
        "R": installation_ratio(p, zero, link),
        "dR": jax.grad(installation_ratio, argnums=1)(p, zero, link) / slope.W[1],
        "camber": camber,
        "dl_dth": jax.grad(strut_length, argnums=2)(p, zero, link),
        "scrub": lateral + camber * height / jnp.cos(p["tilt"]) ** 2,
        "scrub of the material point": lateral + camber * height,
        "length": strut_length(p, zero, link),
    }


def test_the_numbers_of_the_sheet(numbers: dict[str, float], rig_sheet: dict[str, Any]) -> None:
    at = _installation(as_values(numbers), np.float64(0.0), np.float64(numbers["psi_nominal"]))
    found = {name: float(value) for name, value in at.items()}
    expected = {name: rig_sheet["installation"][name] for name in ("R", "dR", "camber", "dl_dth", "scrub")}
    assert {name: found[name] for name in expected} == pytest.approx(expected, rel=1e-7)
    assert found["scrub of the material point"] == pytest.approx(0.1304, abs=5e-5)
    assert found["length"] == pytest.approx(rig_sheet["strut"]["length_nominal"], rel=1e-14)
    force = numbers["k_sd"] * (numbers["l_free"] - found["length"])
    assert force == pytest.approx(rig_sheet["strut"]["force_nominal"], rel=1e-12)


@given(link=st.floats(-np.pi, np.pi))
def test_the_crank_pin_circles_about_the_link_pivot(numbers: dict[str, float], link: float) -> None:
    p = as_values(numbers)
    arm = np.asarray(crank_pin(p, np.float64(link))) - [numbers["G_y"], numbers["G_z"]]
    assert np.hypot(*arm) == pytest.approx(numbers["l_SL"], abs=1e-16)
    turned = np.arctan2(arm[1], arm[0]) - numbers["theta_0"] - link
    assert np.cos(turned) == pytest.approx(1.0, abs=1e-14)
