"""The tyre: it presses and never pulls, on the plate, with the power that goes through it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates, section
from savgs_ident.plants.quarter_car.forces import Contact, Road, contact, radial_force

from .instants import as_values, draw_instants, inputs_of, motion_of

COUNT = 200


def _touch(compression: float, rate: float) -> Contact:
    zero, one = np.float64(0.0), np.float64(1.0)
    return Contact((zero, zero), (zero, zero), zero, np.float64(compression), np.float64(rate), one)


_radial = jax.jit(radial_force)


def _contact_of(p: Values, instant: Array) -> Contact:
    motion = motion_of(instant)
    return contact(p, section(p, motion.q.theta_LW), motion, inputs_of(instant).road)


_contacts = jax.jit(jax.vmap(_contact_of, in_axes=(None, 0)))


@pytest.fixture(scope="module")
def touches(numbers: dict[str, float]) -> Contact:
    """Contacts at random instants."""
    return jax.tree.map(np.asarray, _contacts(as_values(numbers), draw_instants(3, COUNT)))


def _normal(size: float) -> st.SearchStrategy[float]:
    """Numbers up to a size; XLA takes subnormal ones for zero, and so may it."""
    return st.floats(-size, size, allow_subnormal=False)


@given(compression=_normal(0.2), rate=_normal(50.0), extra=_normal(1e5))
def test_it_never_pulls(numbers: dict[str, float], compression: float, rate: float, extra: float) -> None:
    force = float(_radial(as_values(numbers), _touch(compression, rate), np.float64(extra)))
    pressed = numbers["k_t"] * compression + numbers["c_t"] * rate + extra
    assert force >= 0.0
    if compression <= 0.0 or pressed <= 0.0:
        assert force == 0.0
    else:
        assert force == pytest.approx(pressed, rel=1e-12)


def test_the_contact_lies_on_the_plate(touches: Contact) -> None:
    instants = draw_instants(3, COUNT)
    assert touches.place[1] + instants[:, 0] == pytest.approx(instants[:, 6], abs=1e-14)


def test_the_load_on_the_plate_carries_the_power_of_the_radial_force(touches: Contact) -> None:
    """F_tz = radial / cos a, times how fast the upright's point at H nears the plate."""
    _, _, z_s_rate, theta_rate, _, _, _, road_rate, _, _ = draw_instants(3, COUNT).T
    nearing = road_rate - (z_s_rate + touches.place_slope[1] * theta_rate)
    assert nearing / touches.cos_tilt == pytest.approx(touches.compression_rate, abs=1e-14)


def test_rates_are_those_of_the_motion(numbers: dict[str, float], touches: Contact) -> None:
    """Compression by differences in time; the upright's material point by a rigid turn about the wheel."""
    p, instants, step = as_values(numbers), draw_instants(3, COUNT), 1e-5
    moved = np.zeros_like(instants)
    moved[:, :2], moved[:, 6] = instants[:, 2:4], instants[:, 7]
    before, after = (np.asarray(_contacts(p, instants + sign * step * moved).compression) for sign in (-1, 1))
    assert (after - before) / (2.0 * step) == pytest.approx(touches.compression_rate, abs=1e-8)
    assert touches.lateral_velocity == pytest.approx(touches.place_slope[0] * instants[:, 3], abs=1e-15)


def test_the_material_point_is_not_the_moving_contact_point(numbers: dict[str, float]) -> None:
    """With the plate held under the wheel the two differ by what the tilted tyre turns about its own axis.

    Per suspension deflection: 0.13048 (the sheet's scrub) against 0.13036 at the nominal state.
    """
    p, zero = as_values(numbers), jnp.zeros(())
    still = Coordinates(zero, zero)

    def lateral_place(angle: Array) -> Array:
        at = section(p, angle)
        motion = Motion(Coordinates(p["W_z"] - at.W_z, angle), still, still)
        return contact(p, at, motion, Road(zero, zero)).place[0]

    @jax.jit
    def per_travel() -> tuple[Array, Array]:
        at = section(p, zero)
        here = contact(p, at, Motion(still, still, still), Road(zero, zero))
        return jax.grad(lateral_place)(zero) / at.W_z_slope, here.place_slope[0] / at.W_z_slope

    moving, material = (float(x) for x in per_travel())
    assert moving == pytest.approx(0.130478, abs=1e-6)
    assert material == pytest.approx(0.130362, abs=1e-6)
