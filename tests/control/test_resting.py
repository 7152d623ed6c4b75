"""Where the rig rests: the energy of all bodies, the spring and the tyre is stationary there, and least."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.control.linear_equivalent import resting_angles
from savgs_ident.control.linearisation import resting
from savgs_ident.model.dynamics import upright_mass
from savgs_ident.model.kinematics import linkage, strut_length
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

LINKS = np.radians([0.0, 40.0, 90.0, 140.0, 180.0])


def _energy(p: Values, q: Array, link: Array) -> Array:
    """Potential energy [J] at (z_s, theta_LW), road at zero, from the places of the bodies alone."""
    pose = linkage(p, q[1])
    heights = {"L": p["m_L"], "U": p["m_U"], "K": upright_mass(p)}
    weight = p["m_s"] * q[0] + sum(
        mass * (q[0] + getattr(pose, f"cg_{body}")[1]) for body, mass in heights.items()
    )
    squeeze = p["l_free"] - strut_length(p, q[1], link)
    pressed = jnp.maximum(p["r_free"] - (q[0] + pose.W[1]) / jnp.cos(pose.roll_K + p["tilt"]), 0.0)
    return p["g"] * weight + p["k_sd"] * squeeze**2 / 2.0 + p["k_t"] * pressed**2 / 2.0


_force = jax.jit(jax.grad(_energy, argnums=1))
_stiffness = jax.jit(jax.hessian(_energy, argnums=1))


@pytest.mark.parametrize("link", LINKS)
def test_the_energy_is_least_at_rest(frictionless: QuarterCar, numbers: Values, link: float) -> None:
    at = resting(frictionless, numbers, link)
    q = np.array([float(part) for part in at.q])
    stiffness = np.asarray(_stiffness(numbers, q, np.float64(link)))
    off = np.linalg.solve(stiffness, np.asarray(_force(numbers, q, np.float64(link))))
    assert np.max(np.abs(off)) < 1e-9
    assert np.min(np.linalg.eigvalsh(stiffness)) > 0.0
    assert [float(part) for part in (*at.qd, *at.road, at.link.velocity)] == [0.0] * 5


def test_both_ways_to_the_rest_agree_along_the_link_angle(frictionless: QuarterCar, numbers: Values) -> None:
    along = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS)))
    single = [float(resting(frictionless, numbers, link).q.theta_LW) for link in LINKS]
    assert along == pytest.approx(single, abs=1e-12)


def test_the_drawing_is_the_rest_at_the_nominal_link_angle(frictionless: QuarterCar, numbers: Values) -> None:
    at = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS)))
    assert float(numbers["psi_nominal"]) == pytest.approx(LINKS[2])
    assert at[2] == pytest.approx(0.0, abs=1e-9)


def test_a_link_that_turns_upward_lifts_the_chassis_off_the_wheel(
    frictionless: QuarterCar, numbers: Values
) -> None:
    """It presses the strut: at the same load the strut's upper end, and the chassis, have to give way upward."""
    at = np.asarray(resting_angles(frictionless, numbers, jnp.asarray(LINKS)))
    assert np.all(np.diff(at) < 0.0)
