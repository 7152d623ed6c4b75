"""Energy: what the rig stores changes by what road, link, drives and losses bring and take."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.model.dynamics import Coordinates, Motion, upright_mass
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.kinematics import linkage, strut_length
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

from .instants import draw_instants, inputs_of, motion_of, shifted

COUNT = 200


class Powers(NamedTuple):
    """Power into the rig [W] along a motion; ``stored`` is the rate of kinetic and potential energy."""

    stored: Array
    road: Array
    link: Array
    damper: Array
    tyre_damper: Array
    tyre_friction: Array
    rail_friction: Array
    drives: Array


def _energy(p: Values, q: Coordinates, qd: Coordinates, road: Array, link: Array) -> Array:
    """Kinetic and potential energy [J], from the places of the bodies alone."""
    pose, rate = jax.jvp(lambda angle: linkage(p, angle), (q.theta_LW,), (qd.theta_LW,))
    energy = p["m_s"] * (qd.z_s**2 / 2.0 + p["g"] * q.z_s)
    masses = {"L": p["m_L"], "U": p["m_U"], "K": upright_mass(p)}
    for body, mass in masses.items():
        velocity = getattr(rate, f"cg_{body}") + jnp.stack([jnp.zeros_like(qd.z_s), qd.z_s])
        height = getattr(pose, f"cg_{body}")[1] + q.z_s
        spin = getattr(rate, f"roll_{body}")
        energy += mass * (velocity @ velocity / 2.0 + p["g"] * height) + p[f"J_{body}"] * spin**2 / 2.0
    squeeze = p["l_free"] - strut_length(p, q.theta_LW, link)
    radius = (q.z_s + pose.W[1] - road) / jnp.cos(pose.roll_K + p["tilt"])
    pressed = jnp.maximum(p["r_free"] - radius, 0.0)
    return energy + p["k_sd"] * squeeze**2 / 2.0 + p["k_t"] * pressed**2 / 2.0


def _powers(
    model: QuarterCar, p: Values, motion: Motion, anchor: Array, inputs: Inputs
) -> tuple[Powers, Array]:
    road, link = inputs
    _, stored = jax.jvp(
        lambda q, qd, height, angle: _energy(p, q, qd, height, angle),
        (motion.q, motion.qd, road.height, link.angle),
        (motion.qd, motion.qdd, road.velocity, link.velocity),
    )
    loads = model.loads(p, motion, anchor, jnp.zeros_like(anchor), inputs)
    residual = model.residual(p, motion, anchor, jnp.zeros(1), inputs)
    touch, length = loads.touch, strut_length(p, motion.q.theta_LW, link.angle)
    per_link = jax.grad(strut_length, argnums=2)(p, motion.q.theta_LW, link.angle)
    spring = p["k_sd"] * (p["l_free"] - length)
    damping = loads.vertical * touch.cos_tilt - p["k_t"] * jnp.maximum(touch.compression, 0.0)
    powers = Powers(
        stored=stored,
        road=loads.vertical * road.velocity,
        link=-loads.strut * per_link * link.velocity,
        damper=(loads.strut - spring) * loads.strut_rate,
        tyre_damper=-damping * touch.compression_rate,
        tyre_friction=loads.lateral * touch.lateral_velocity,
        rail_friction=loads.rail * motion.qd.z_s,
        drives=-residual[:2] @ jnp.stack([motion.qd.z_s, motion.qd.theta_LW]),
    )
    return powers, loads.rail


@pytest.fixture(scope="module")
def powers(simtr: QuarterCar, numbers: dict[str, float]) -> Powers:
    """Powers at random instants of random rigs; drives add what is out of balance."""
    rigs = [shifted(numbers, seed) for seed in range(COUNT)]
    p = {name: np.array([rig[name] for rig in rigs]) for name in numbers}
    limit = np.random.default_rng(5).uniform(-4e-5, 4e-5, COUNT)

    @jax.jit
    @jax.vmap
    def at(values: Values, instant: Array, stretch: Array) -> tuple[Powers, Array]:
        motion, inputs = motion_of(instant), inputs_of(instant)
        return _powers(simtr, values, motion, (instant[0] - stretch)[None], inputs)

    return Powers(*(np.asarray(part) for part in at(p, draw_instants(11, COUNT), limit)[0]))


def test_what_is_stored_changes_by_what_comes_in(powers: Powers) -> None:
    sources = np.stack(powers[1:])
    size = np.sum(np.abs(sources), axis=0)
    assert np.max(np.abs(powers.stored - np.sum(sources, axis=0)) / size) < 1e-11


def test_every_source_counts(powers: Powers) -> None:
    """The balance would not hold without any one of them."""
    for name, power in powers._asdict().items():
        assert np.sum(np.abs(power) > 0.01) > COUNT // 4, name


def test_damper_and_tyre_only_take_energy(powers: Powers) -> None:
    for power in (powers.damper, powers.tyre_damper, powers.tyre_friction):
        assert np.max(power) <= 1e-9
