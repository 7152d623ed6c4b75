"""Forces learned at a port: what is there, without a name for it.

    F = sum over k of c_k f_k(x, v, n)

with x = (displacement - middle)/stroke, v = velocity/speed and n = load/carried of the port, each held at the edge of
what was seen when the law was learned: it says nothing about what lies beyond. The f_k are those with which a
diagnosis looks for an unknown force: frictions that turn round within a hundredth and a tenth of the largest
velocity, a friction that falls with velocity, dampings, stiffnesses, and products of them. With all c_k at zero the
force vanishes.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role
from savgs_ident.effects.effect import Effect, effect_at

SHARP = (0.01, 0.1)
"""Velocities over which friction-like functions turn round, as shares of the largest [1]."""

FALLING = (0.05, 0.2)
"""Velocities over which a friction falls, as shares of the largest [1]."""

OF_THE_MOTION = (
    "tanh(v/0.01)", "tanh(v/0.1)", "v", "v|v|", "v^2", "x", "x^2", "x^3", "x tanh(v/0.01)", "x v", "x^2 v",
    "tanh(v/0.01) exp(-(v/0.05)^2)", "tanh(v/0.01) exp(-(v/0.2)^2)",
)  # fmt: skip
"""The functions f_k of displacement and velocity, in words."""

OF_THE_LOAD = ("n tanh(v/0.01)", "n v", "n")
"""Those that come on top at a port with a load."""

FRICTIONS = (
    "tanh(v/0.01)", "tanh(v/0.1)", "x tanh(v/0.01)", "tanh(v/0.01) exp(-(v/0.05)^2)", "tanh(v/0.01) exp(-(v/0.2)^2)",
    "n tanh(v/0.01)",
)  # fmt: skip
"""Those of both that turn round with the velocity: how steep they are at rest is a width, not a damping."""

SMALLEST = 1e-9
"""Least stroke [m], speed [m/s] and load [N] by which is divided."""


def functions(x: Float[Array, ""], v: Float[Array, ""], n: Float[Array, ""]) -> list[Float[Array, ""]]:
    """The values of all f_k [1], those of the motion first, then those of the load."""
    sharp, blunt = (jnp.tanh(v / width) for width in SHARP)
    falling = [sharp * jnp.exp(-((v / width) ** 2)) for width in FALLING]
    smooth = [v, v * jnp.abs(v), v**2, x, x**2, x**3, x * sharp, x * v, x**2 * v]
    return [sharp, blunt, *smooth, *falling, n * sharp, n * v, n]


def functions_at(port: Port) -> tuple[str, ...]:
    """The functions at a port, in words."""
    return (*OF_THE_MOTION, *OF_THE_LOAD) if port.loaded else OF_THE_MOTION


def coefficients_at(port: Port) -> tuple[str, ...]:
    """Names of the c_k at a port, one for each of its functions."""
    return tuple(f"learned_{port.name}_{number}" for number in range(1, len(functions_at(port)) + 1))


def frictions_at(port: Port) -> tuple[str, ...]:
    """Names of the c_k of the frictions at a port; with all of them at zero, what remains is smooth at rest."""
    both = zip(coefficients_at(port), functions_at(port), strict=True)
    return tuple(name for name, words in both if words in FRICTIONS)


class LearnedForce(AbstractForceLaw):
    """A learned force at a ``port``, in the port's own sense."""

    name: ClassVar[str] = "learned"
    family: ClassVar[Family] = Family.LEARNED
    roles: ClassVar[tuple[Role, ...]] = (
        *(Role(span) for span in ("middle", "stroke", "speed", "carried")),
        *(Role(str(number), 0.0) for number in range(1, len((*OF_THE_MOTION, *OF_THE_LOAD)) + 1)),
    )
    port: Port = eqx.field(static=True)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Nothing learned yet."""
        unit, force = port.displacement_unit, port.force_unit
        carried = Parameter("carried", 1.0, force, lower=SMALLEST, about="largest load seen")
        spans = {
            "middle": Parameter("middle", 0.0, unit, about="displacement in the middle of what was seen"),
            "stroke": Parameter("stroke", 1.0, unit, lower=SMALLEST, about="largest displacement from there"),
            "speed": Parameter("speed", 1.0, f"{unit}/s", lower=SMALLEST, about="largest velocity seen"),
            "carried": carried if port.loaded else 1.0,
        }
        coefficients = {
            str(number): Parameter(str(number), 0.0, force, about=f"learned force in proportion to {words}")
            for number, words in enumerate(functions_at(port), start=1)
        }
        return {role.name: 0.0 for role in self.roles} | spans | coefficients

    def suits(self, port: Port) -> bool:
        """Only where it was made for."""
        return port == self.port

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The learned force [N]."""
        x = jnp.clip((signals.displacement - v["middle"]) / v["stroke"], -1.0, 1.0)
        speed = jnp.clip(signals.velocity / v["speed"], -1.0, 1.0)
        n = jnp.clip(signals.load / v["carried"], -1.0, 1.0) if self.port.loaded else jnp.zeros_like(x)
        terms = zip(functions_at(self.port), functions(x, speed, n), strict=False)
        total = sum((v[str(k)] * value for k, (_, value) in enumerate(terms, start=1)), jnp.zeros_like(x))
        return self.port.sense * total


def learned_effect(port: Port) -> Effect:
    """The learned force of a port, with nothing learned yet: ``learned_rail`` at the port ``rail``."""
    law, name = LearnedForce(port), f"learned_{port.name}"
    numbers = {
        role: replace(given, name=f"{name}_{role}") if isinstance(given, Parameter) else given
        for role, given in law.typical(port).items()
    }
    return effect_at(
        name,
        port,
        law,
        numbers,
        symptom="no effect of the catalogue explains what is measured",
        reference="this project: linear regression on functions of the port's motion",
    )
