"""Something that hangs on a body by a spring and a damper and swings: a cable, a ballast, a bracket.

    F = m (omega^2 (y - x) + 2 zeta omega (yd - xd)),    m ydd = -F,    omega = 2 pi f

with the displacement x [m] of the body from its nominal state, that of what hangs on it, y [m], its mass m [kg], the
natural frequency f [Hz] and the damping ratio zeta [1] of what swings. It hangs at rest in the nominal state: its
weight is in the body's.

Source: Den Hartog 1956, Mechanical Vibrations, ch. 3, the dynamic vibration absorber.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, InternalState, Port, PortSignals, Role

_INERTIA = {("N", "m"): "kg", ("N m", "rad"): "kg m^2"}
"""Unit of what swings by those of force and displacement."""


class AttachedOscillator(AbstractForceLaw):
    """What swings on a body."""

    name: ClassVar[str] = "oscillator"
    words: ClassVar[str] = "something that hangs there and swings"
    family: ClassVar[Family] = Family.OSCILLATOR
    roles: ClassVar[tuple[Role, ...]] = (Role("mass", 0.0), Role("frequency"), Role("damping_ratio"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force at the acceleration of the typical motion, at 5 Hz on a time scale of 1."""
        mass = port.force * port.displacement / port.velocity**2
        units = port.force_unit, port.displacement_unit
        unit = _INERTIA.get(units, f"{units[0]} s^2/{units[1]}")
        return {
            "mass": Parameter("mass", mass, unit, lower=0.0, upper=100.0 * mass, about="swinging mass"),
            "frequency": Parameter(
                "frequency",
                5.0 / port.time_scale,
                "Hz",
                lower=0.5 / port.time_scale,
                upper=80.0 / port.time_scale,
                about="natural frequency of what swings",
            ),
            "damping_ratio": Parameter(
                "damping_ratio", 0.05, "1", lower=0.005, upper=1.0, about="damping ratio of what swings"
            ),
        }

    def tried(self, port: Port) -> tuple[tuple[str, float], ...]:
        """Natural frequencies [Hz], a half-power bandwidth apart: between two further apart it would look useless."""
        return tuple(
            ("frequency", frequency / port.time_scale) for frequency in np.geomspace(0.8, 40.0, 43).tolist()
        )

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """Displacement and velocity of what swings."""
        unit = port.displacement_unit
        return (
            InternalState("displacement", unit, port.displacement),
            InternalState("velocity", f"{unit}/s", port.velocity),
        )

    def _pull(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """Force on the body for each unit of mass [m/s^2]."""
        omega = 2.0 * jnp.pi * v["frequency"]
        stretch, slip = state[0] - (signals.displacement - signals.rest), state[1] - signals.velocity
        return omega**2 * stretch + 2.0 * v["damping_ratio"] * omega * slip

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """What it pulls with [N]."""
        return v["mass"] * self._pull(v, signals, state)

    def rate(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """Its velocity and acceleration [m/s], [m/s^2]."""
        return jnp.stack([state[1], -self._pull(v, signals, state)])
