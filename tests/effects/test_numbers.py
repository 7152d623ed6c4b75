"""Numbers of the rig that are others than the sheet's."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import linkage
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from ..plants.quarter_car.instants import as_values, draw_instants
from .laws import in_the_rig, instant

# spring_rate: a stiffer spring about the same free length.


@pytest.mark.parametrize("change", [-0.2, 0.05])
def test_the_push_grows_in_proportion_and_vanishes_at_the_same_length(
    rig: Rig, numbers: dict[str, float], change: float
) -> None:
    """With nothing else that pushes: at rest."""
    p = numbers | {"spring_rate_change": change}
    for theta in (-0.1, 0.1):
        at = instant(theta=theta)
        changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("spring_rate",), ()))
        length = float(plain.ports["strut"].displacement)
        assert float(plain.strut) == pytest.approx(p["k_sd"] * (p["l_free"] - length), rel=1e-12)
        assert float(changed.strut) == pytest.approx((1.0 + change) * float(plain.strut), rel=1e-12)
    free = numbers | {"l_free": length, "spring_rate_change": change}
    assert abs(float(in_the_rig(rig, free, ("spring_rate",), at)[1].strut)) < 1e-6


# damper_scale: a harder damper: its whole table in proportion, both ways.


@pytest.mark.parametrize("velocity", [-2.0, -0.1, 0.3, 3.0])
def test_the_table_scales_as_one(rig: Rig, numbers: dict[str, float], velocity: float) -> None:
    change, at = 0.3, instant(thetad=velocity)
    p = numbers | {"damper_scale_change": change}
    changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("damper_scale",), ()))
    damping = float(plain.ports["strut"].load)
    assert damping * float(plain.strut_rate) < 0.0
    assert float(changed.strut) - float(plain.strut) == pytest.approx(change * damping, rel=1e-9)


# tyre_stiffness: a stiffer tyre about the same free radius.


@pytest.mark.parametrize("change", [-0.3, 0.1])
def test_the_load_grows_in_proportion_to_the_compression(
    rig: Rig, numbers: dict[str, float], change: float
) -> None:
    """By the same share at any compression, with the same compression at the same place; none in the air."""
    p = numbers | {"tyre_stiffness_change": change}
    for road in (0.0, 0.01):
        at = instant(road=road)
        changed, plain = (in_the_rig(rig, p, names, at)[1] for names in (("tyre_stiffness",), ()))
        assert float(plain.vertical) > 1000.0
        assert float(changed.vertical) == pytest.approx((1.0 + change) * float(plain.vertical), rel=1e-12)
        assert float(changed.touch.compression) == float(plain.touch.compression)
    assert float(in_the_rig(rig, p, ("tyre_stiffness",), instant(road=-0.02))[1].vertical) == 0.0


# tyre_damping: a tyre that damps more: only while it is being pressed or let go.


@pytest.mark.parametrize("velocity", [-0.3, 0.0, 0.2])
def test_the_load_grows_with_the_rate_of_compression(
    rig: Rig, numbers: dict[str, float], velocity: float
) -> None:
    at = instant(roadd=velocity)
    changed, plain = (in_the_rig(rig, numbers, names, at)[1] for names in (("tyre_damping",), ()))
    rate = float(plain.touch.compression_rate)
    assert (rate > 0.0) == (velocity > 0.0)
    more = numbers["tyre_damping_change"] * numbers["c_t"] * rate / float(plain.touch.cos_tilt)
    assert float(changed.vertical) - float(plain.vertical) == pytest.approx(more, rel=1e-9, abs=1e-9)


# sprung_mass: a payload: its inertia and its weight on the body, nothing else.


@over("seed", range(3))
@over("change", [-60.0, 15.0])
def test_it_adds_its_inertia_and_its_weight_to_the_body(
    rig: Rig, numbers: dict[str, float], seed: int, change: float
) -> None:
    at = draw_instants(seed, 1)[0]
    loaded, loads = in_the_rig(rig, numbers | {"sprung_mass_change": change}, ("sprung_mass",), at)
    plain, before = in_the_rig(rig, numbers, (), at)
    assert loaded[0] - plain[0] == pytest.approx(-change * (at[4] + numbers["g"]), rel=1e-9)
    assert loaded[1] == plain[1]
    assert float(loads.carriage) == float(before.carriage)


# unsprung_mass: a heavier wheel: a point mass at the upright's centre of gravity.


@jax.jit
def _slope_and_bend(p: Values, theta: jax.Array) -> tuple[jax.Array, jax.Array]:
    """First and second derivative of the place of the upright's cg in the wishbone's angle."""
    slope = jax.jacfwd(lambda angle: linkage(p, angle).cg_K)
    return slope(theta), jax.jacfwd(slope)(theta)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_a_point_mass_that_the_upright_carries(rig: Rig, numbers: dict[str, float], seed: int) -> None:
    """-dm a . dr/dq with a and r of that point, the weight included."""
    at, change = draw_instants(seed, 1)[0], 8.0
    p = as_values(numbers)

    slope, bend = (np.asarray(each) for each in _slope_and_bend(p, jnp.asarray(at[1])))
    acceleration = slope * at[5] + bend * at[3] ** 2 + np.array([0.0, at[4] + numbers["g"]])
    heavy = in_the_rig(rig, numbers | {"unsprung_mass_change": change}, ("unsprung_mass",), at)[0]
    plain = in_the_rig(rig, numbers, (), at)[0]
    expected = -change * np.array([acceleration[1], acceleration @ slope])
    assert heavy - plain == pytest.approx(expected, rel=1e-8)


# link_offset: an encoder that reads too little: the link stands where it would at a greater reading.


@over("reading", [0.3, np.pi / 2.0, 2.5])
@over("offset", [-0.3, 0.2])
def test_it_is_the_rig_at_the_true_angle(
    rig: Rig, numbers: dict[str, float], reading: float, offset: float
) -> None:
    p = numbers | {"link_offset": offset}
    read = instant(theta=0.03, thetad=0.4, link=reading, linkd=2.0)
    true = instant(theta=0.03, thetad=0.4, link=reading + offset, linkd=2.0)
    found, expected = in_the_rig(rig, p, ("link_offset",), read)[0], in_the_rig(rig, p, (), true)[0]
    assert found == pytest.approx(expected, rel=1e-11)
    assert found != pytest.approx(in_the_rig(rig, p, (), read)[0], rel=1e-4)
