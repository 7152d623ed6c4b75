"""A plant of one's own: a pendulum on a moving pivot, whose model has no dry friction.

    m L (L phidd + a cos phi + g sin phi) + c phid = torques of effects at the pivot

with the angle phi of the rod, the horizontal acceleration a of the pivot, the mass m of the bob, the length L of the
rod and the damping c of the bearing. ``python pendulum.py`` simulates it with the friction, fits the model, samples
its posterior and diagnoses what is missing.
"""

from typing import ClassVar, NamedTuple

import jax.numpy as jnp

import savgs_ident as si


class Angle(NamedTuple):
    """Angle of the rod [rad], or a time derivative of it; also what the encoder reads."""

    phi: jnp.ndarray


PIVOT = si.Port("pivot", si.PortKind.FORCE, "pivot", "angle; torque", "rad", "N m", 0.1, 0.5, force=0.02)
SHAKER = si.Port("shaker", si.PortKind.INPUT, "shaker", displacement_unit="m/s^2", displacement=0.05)
ENCODER = si.Port("encoder", si.PortKind.SENSOR, "sensor.angle", displacement_unit="rad", displacement=1e-3)
M = si.Parameter("m", 0.5, "kg", tolerance=0.005, lower=0.0, about="mass of the bob")
L = si.Parameter("L", 0.4, "m", tolerance=0.004, lower=0.0, about="length of the rod")
C = si.Parameter("c", 0.02, "N m s/rad", lower=0.0, upper=1.0, about="damping of the bearing")


class Pendulum(si.AbstractPlant):
    """The pendulum, plus the effects that were added to it."""

    coordinates: ClassVar = (si.Coordinate("phi", "rad", "angle of the rod", 0.1, 0.5, 3.0),)
    coordinate_type: ClassVar = Angle
    inputs: ClassVar = (si.Input("pivot_accel", "m/s^2", "pivot", moves=(0.1,)),)
    channels: ClassVar = (si.Channel("angle", "rad", "angle of the rod"),)
    ports: ClassVar = (PIVOT, SHAKER, ENCODER)
    parameters: ClassVar = si.ParameterTable((M, L, C, si.Parameter("g", 9.81, "m/s^2", about="gravity")))

    def evaluate(self, p, motion, u, acting, prepared=None):
        """Torque out of balance [N m], and the torque at the pivot [N m]."""
        phi, rate, none = motion.q.phi, motion.qd.phi, jnp.zeros_like(motion.q.phi)
        accel = acting.input(SHAKER, u.signals[0], u.fundamental).value
        torque = acting.force(PIVOT, si.PortSignals(phi, rate, none, none)) - p["c"] * rate
        force = p["m"] * (p["L"] * motion.qdd.phi + accel * jnp.cos(phi) + p["g"] * jnp.sin(phi))
        return jnp.stack([torque - p["L"] * force]), torque

    def read(self, p, motion, s, sd, u, prepared=None):
        """The angle."""
        return motion.q


if __name__ == "__main__":
    model, tests = si.PlantModel(Pendulum(), Pendulum.parameters), [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.5]
    measured = si.simulate_dwells(model + "pivot_friction", tests, {"pivot_accel": 0.3}, {"angle": 1e-3})
    print(si.diagnose(model, measured).verdict)
    print(si.sample(si.fit(model + "pivot_friction", measured)))
