"""Errors of sensors and inputs by other formulas than the catalogue's.

They are the truth of foreign trials (:mod:`savgs_ident.validation.foreign_laws`): no diagnosis knows them.
"""

from collections.abc import Mapping
from math import pi
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractInputLaw,
    AbstractSensorLaw,
    Family,
    Fundamental,
    InputSignal,
    Port,
    Role,
)


class SecondOrderFilter(AbstractSensorLaw):
    """A sensor with a low-pass of second order.

        reading / truth = 1 / (1 + 2 zeta i w T - (w T)^2),        w = 2 pi f

    with the frequency f [Hz], the time constant T [s] and the damping ratio zeta [1].

    Source: Doebelin 2004, Measurement Systems, ch. 3, second-order instruments.
    """

    name: ClassVar[str] = "second_order_filter"
    family: ClassVar[Family] = Family.DYNAMICS
    roles: ClassVar[tuple[Role, ...]] = (Role("time", 0.0), Role("damping_ratio"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Two milliseconds, a corner at 80 Hz, damped to seven tenths."""
        about = "time constant of the sensor"
        return {
            "time": Parameter("time", 2e-3, "s", lower=0.0, upper=0.1, about=about),
            "damping_ratio": Parameter(
                "damping_ratio", 0.7, "1", lower=0.3, upper=1.5, about="its damping ratio"
            ),
        }

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]."""
        ratio = 2.0 * pi * frequency * v["time"]
        return jnp.reciprocal(lax.complex(1.0 - ratio**2, 2.0 * v["damping_ratio"] * ratio))


class HighPass(AbstractSensorLaw):
    """A sensor that loses what is slow: an amplifier of charge.

        reading / truth = i f / (i f + f_c)

    with the frequency f [Hz] and the corner f_c [Hz].

    Source: Doebelin 2004, Measurement Systems, ch. 4, piezoelectric transducers.
    """

    name: ClassVar[str] = "high_pass"
    family: ClassVar[Family] = Family.DYNAMICS
    roles: ClassVar[tuple[Role, ...]] = (Role("corner", 0.0),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A corner at a fiftieth of a hertz."""
        about = "corner frequency of the sensor"
        return {"corner": Parameter("corner", 0.02, "Hz", lower=0.0, upper=5.0, about=about)}

    def transfer(self, v: Values, frequency: Float[Array, "*f"]) -> Complex[Array, "*f"]:
        """Reading over truth at frequencies [Hz]; at zero, one without a corner and else nothing."""
        still = frequency == 0.0
        ratio = v["corner"] / jnp.where(still, 1.0, frequency)
        passed = jnp.reciprocal(lax.complex(jnp.ones_like(ratio), -ratio))
        return jnp.where(still, jnp.where(v["corner"] > 0.0, 0.0, 1.0), passed)


ORDERS = (4, 5, 6, 7, 8, 9)
"""Orders of the waves that a cam has."""


class CamWaves(AbstractInputLaw):
    """Waves on a cam, as many around it as their order says.

        du = sum over k of a_k cos k phi + b_k sin k phi,        k = 4 .. 9

    with the angle phi [rad] of the cam, 0 where it is highest, and amplitudes a_k, b_k in the unit of the input.

    Source: Norton 2009, Cam Design and Manufacturing Handbook, on chatter marks of grinding.
    """

    name: ClassVar[str] = "cam_waves"
    family: ClassVar[Family] = Family.SHAPE
    roles: ClassVar[tuple[Role, ...]] = tuple(
        Role(f"{wave}_{order}", 0.0) for order in ORDERS for wave in ("cos", "sin")
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A hundredth of the typical displacement in the fourth order, less with the square of the others."""
        found: dict[str, Parameter | float] = {}
        for order in ORDERS:
            size = 0.01 * port.displacement * (ORDERS[0] / order) ** 2
            for wave in ("cos", "sin"):
                role, about = f"{wave}_{order}", f"amplitude of order {order}, {wave}"
                unit = port.displacement_unit
                found[role] = Parameter(role, size, unit, lower=-1e3 * size, upper=1e3 * size, about=about)
        return found

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What the waves add."""
        value, slope = jnp.zeros_like(fundamental.angle), jnp.zeros_like(fundamental.angle)
        for order in ORDERS:
            along, across = v[f"cos_{order}"], v[f"sin_{order}"]
            cosine, sine = jnp.cos(order * fundamental.angle), jnp.sin(order * fundamental.angle)
            value = value + along * cosine + across * sine
            slope = slope + order * (across * cosine - along * sine)
        return InputSignal(value, slope * fundamental.speed)
