"""Energy: what the rig stores changes by what road, link, drives, losses and what gives way bring and take."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.base import PortKind
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates, upright_mass
from savgs_ident.plants.quarter_car.forces import Inputs
from savgs_ident.plants.quarter_car.kinematics import linkage, strut_length
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.ports import PORTS

from .instants import draw_instants, inputs_of, motion_of, shifted

COUNT = 200
FORCES = 5
LARGEST_WAY = np.array([[1e-3, 1e-3, 0.02, 1e-3, 1e-3, 1e-3], [0.05, 0.05, 0.5, 0.05, 0.05, 0.05]]).T
"""How far and how fast it gives way at mount, damper's end, link, plate, carcass and frame."""


class Powers(NamedTuple):
    """Power into the rig [W] along a motion; ``stored`` is the rate of kinetic and potential energy.

    Those from ``force_rail`` on are of what is imposed from outside. What presses the tyre counts as damping.
    """

    stored: Array
    road: Array
    link: Array
    damper: Array
    tyre_damper: Array
    tyre_friction: Array
    rail_friction: Array
    drives: Array
    force_rail: Array
    force_strut: Array
    force_suspension: Array
    force_tyre_lateral: Array
    mount: Array
    damper_end: Array
    link_way: Array
    plate: Array
    carcass: Array
    frame: Array


def _energy(p: Values, q: Coordinates, qd: Coordinates, road: Array, link: Array, way: Array) -> Array:
    """Kinetic and potential energy [J], from the places of the bodies alone; ``way`` as in ``LARGEST_WAY``."""
    pose, rate = jax.jvp(lambda angle: linkage(p, angle), (q.theta_LW,), (qd.theta_LW,))
    energy = p["m_s"] * (qd.z_s**2 / 2.0 + p["g"] * q.z_s)
    masses = {"L": p["m_L"], "U": p["m_U"], "K": upright_mass(p)}
    for body, mass in masses.items():
        velocity = getattr(rate, f"cg_{body}") + jnp.stack([jnp.zeros_like(qd.z_s), qd.z_s])
        height = getattr(pose, f"cg_{body}")[1] + q.z_s
        spin = getattr(rate, f"roll_{body}")
        energy += mass * (velocity @ velocity / 2.0 + p["g"] * height) + p[f"J_{body}"] * spin**2 / 2.0
    mount, _, turned, plate, _, frame = jnp.unstack(way)
    squeeze = p["l_free"] - strut_length(p, q.theta_LW, link + turned) - mount
    radius = (q.z_s + pose.W[1] - (road - plate + frame)) / jnp.cos(pose.roll_K + p["tilt"])
    pressed = jnp.maximum(p["r_free"] - radius, 0.0)
    return energy + p["k_sd"] * squeeze**2 / 2.0 + p["k_t"] * pressed**2 / 2.0


def _powers(model: QuarterCar, p: Values, motion: Motion, anchor: Array, inputs: Inputs) -> Powers:
    road, link, _, given = inputs
    assert given is not None
    ways = jnp.stack([given[port.name] for port in PORTS if port.kind is PortKind.SERIES])
    _, stored = jax.jvp(
        lambda q, qd, height, angle, way: _energy(p, q, qd, height, angle, way),
        (motion.q, motion.qd, road.height, link.angle, ways[:, 0]),
        (motion.qd, motion.qdd, road.velocity, link.velocity, ways[:, 1]),
    )
    still = jnp.zeros_like(anchor)
    loads = model.loads(p, motion, anchor, still, inputs)
    residual = model.residual(p, motion, anchor, still, inputs)
    strut, scrub, rail = (loads.ports[port] for port in ("strut", "tyre_lateral", "rail"))
    per_link = jax.grad(strut_length, argnums=2)(p, motion.q.theta_LW, link.angle + ways[2, 0])
    pressing = loads.vertical * loads.touch.cos_tilt - p["k_t"] * jnp.maximum(loads.touch.compression, 0.0)
    held = ("mount", "damper", "link", "plate", "carcass", "frame")
    carried = [loads.carried[port].total for port in held]
    return Powers(
        stored,
        loads.vertical * road.velocity,
        -loads.strut * per_link * link.velocity,
        strut.load * (strut.velocity + given["damper"][1]),
        -pressing * loads.touch.compression_rate,
        (loads.lateral - given["tyre_lateral"]) * scrub.velocity,
        (loads.rail - given["rail"]) * rail.velocity,
        -residual[:2] @ jnp.stack([motion.qd.z_s, motion.qd.theta_LW]),
        given["rail"] * rail.velocity,
        given["strut"] * strut.velocity,
        given["suspension"] * loads.ports["suspension"].velocity,
        given["tyre_lateral"] * scrub.velocity,
        *(-jnp.stack(carried) * ways[:, 1]),
    )


def _imposed(seed: int) -> dict[str, NDArray[np.float64]]:
    """Forces and ways, and nothing at all at every fourth instant."""
    rng = np.random.default_rng(seed)
    some = (np.arange(COUNT) % 4 > 0).astype(float)
    forces = [300.0 * rng.standard_normal(COUNT) * some for _ in range(FORCES)]
    ways = [size * rng.standard_normal((COUNT, 2)) * some[:, None] for size in LARGEST_WAY]
    names = [port.name for kind in (PortKind.FORCE, PortKind.SERIES) for port in PORTS if port.kind is kind]
    return dict(zip(names, (*forces, *ways), strict=True))


@pytest.fixture(scope="module")
def powers(simtr: QuarterCar, numbers: dict[str, float]) -> Powers:
    """Powers at random instants of random rigs; drives add what is out of balance."""
    rigs = [shifted(numbers, seed) for seed in range(COUNT)]
    p = {name: np.array([rig[name] for rig in rigs]) for name in numbers}
    limit = np.random.default_rng(5).uniform(-4e-5, 4e-5, COUNT)

    @jax.jit
    @jax.vmap
    def at(values: Values, instant: Array, stretch: Array, given: dict[str, Array]) -> Powers:
        inputs = inputs_of(instant)._replace(imposed=given)
        return _powers(simtr, values, motion_of(instant), (instant[0] - stretch)[None], inputs)

    return Powers(*(np.asarray(part) for part in at(p, draw_instants(11, COUNT), limit, _imposed(6))))


def test_what_is_stored_changes_by_what_comes_in(powers: Powers) -> None:
    sources = np.stack(powers[1:])
    size = np.sum(np.abs(sources), axis=0)
    assert np.max(np.abs(powers.stored - np.sum(sources, axis=0)) / size) < 1e-11


def test_every_source_counts(powers: Powers) -> None:
    """The balance would not hold without any one of them."""
    for name, power in powers._asdict().items():
        assert np.sum(np.abs(power) > 0.01) > COUNT // 4, name


def test_damper_and_tyre_only_take_energy(powers: Powers) -> None:
    """The tyre where nothing else presses it."""
    alone: NDArray[np.float64] = np.asarray(powers.tyre_damper)[::4]
    for power in (powers.damper, powers.tyre_friction, alone):
        assert np.max(power) <= 1e-9
