"""Forces learned at a port: what is there, without a name for it.

    F = sum over k of c_k f_k(x, v, n)

with x = (displacement - middle)/stroke, v = velocity/speed and n = load/carried of the port, each held at the edge of
what was seen when the law was learned: it says nothing about what lies beyond. The f_k are those with which a
diagnosis looks for an unknown force: frictions that turn round within a hundredth and a tenth of the largest
velocity, a friction that falls with velocity, dampings, stiffnesses, and products of them. With all c_k at zero the
force vanishes.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractForce, InternalState, Port, PortSignals
from savgs_ident.model.values import Values

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

LOADED = (Port.RAIL, Port.STRUT, Port.TYRE_LATERAL)
"""Ports with a load."""


def functions(x: Float[Array, ""], v: Float[Array, ""], n: Float[Array, ""]) -> list[Float[Array, ""]]:
    """The values of all f_k [1], those of the motion first, then those of the load."""
    sharp, blunt = (jnp.tanh(v / width) for width in SHARP)
    falling = [sharp * jnp.exp(-((v / width) ** 2)) for width in FALLING]
    smooth = [v, v * jnp.abs(v), v**2, x, x**2, x**3, x * sharp, x * v, x**2 * v]
    return [sharp, blunt, *smooth, *falling, n * sharp, n * v, n]


def coefficients_at(port: Port) -> tuple[str, ...]:
    """Names of the c_k at a port, one for each of its functions."""
    return tuple(f"learned_{port.value}_{number}" for number in range(1, len(words_at(port)) + 1))


def words_at(port: Port) -> tuple[str, ...]:
    """The functions at a port, in words."""
    return (*OF_THE_MOTION, *OF_THE_LOAD) if port in LOADED else OF_THE_MOTION


def frictions_at(port: Port) -> tuple[str, ...]:
    """Names of the c_k of the frictions at a port; with all of them at zero, what remains is smooth at rest."""
    told = zip(coefficients_at(port), words_at(port), strict=True)
    return tuple(name for name, words in told if words in FRICTIONS)


def _parameters(port: Port) -> tuple[Parameter, ...]:
    spans = (
        Parameter(
            f"learned_{port.value}_middle", 0.0, "m", about="displacement in the middle of what was seen"
        ),
        Parameter(
            f"learned_{port.value}_stroke", 1.0, "m", lower=SMALLEST, about="largest displacement from there"
        ),
        Parameter(f"learned_{port.value}_speed", 1.0, "m/s", lower=SMALLEST, about="largest velocity seen"),
    )
    carried = Parameter(f"learned_{port.value}_carried", 1.0, "N", lower=SMALLEST, about="largest load seen")
    coefficients = [
        Parameter(name, 0.0, "N", about=f"learned force in proportion to {words}")
        for name, words in zip(coefficients_at(port), words_at(port), strict=True)
    ]
    return (*spans, *([carried] if port in LOADED else []), *coefficients)


class AbstractLearned(AbstractForce):
    """A learned force; a final one only says where it acts."""

    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "no effect of the catalogue explains what is measured"
    reference: ClassVar[str] = "this project: linear regression on functions of the port's motion"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The learned force along the port's coordinate [N]."""
        own = f"learned_{self.port.value}"
        x = jnp.clip((signals.displacement - p[f"{own}_middle"]) / p[f"{own}_stroke"], -1.0, 1.0)
        v = jnp.clip(signals.velocity / p[f"{own}_speed"], -1.0, 1.0)
        loaded = self.port in LOADED
        n = jnp.clip(signals.load / p[f"{own}_carried"], -1.0, 1.0) if loaded else jnp.zeros_like(x)
        terms = zip(coefficients_at(self.port), functions(x, v, n), strict=False)
        return sum((p[name] * value for name, value in terms), start=jnp.zeros_like(x))

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """None: it follows the motion at once."""
        return jnp.zeros(0)


def _null(port: Port) -> Mapping[str, float]:
    return MappingProxyType(dict.fromkeys(coefficients_at(port), 0.0))


class LearnedRail(AbstractLearned):
    """On the sprung mass along the rail."""

    name: ClassVar[str] = "learned_rail"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = _parameters(Port.RAIL)
    null: ClassVar[Mapping[str, float]] = _null(Port.RAIL)


class LearnedStrut(AbstractLearned):
    """Along the strut, pushing it apart."""

    name: ClassVar[str] = "learned_strut"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = _parameters(Port.STRUT)
    null: ClassVar[Mapping[str, float]] = _null(Port.STRUT)


class LearnedSuspension(AbstractLearned):
    """Between wheel and body, at the wishbone's joints."""

    name: ClassVar[str] = "learned_suspension"
    port: ClassVar[Port] = Port.SUSPENSION
    parameters: ClassVar[tuple[Parameter, ...]] = _parameters(Port.SUSPENSION)
    null: ClassVar[Mapping[str, float]] = _null(Port.SUSPENSION)


class LearnedTyreRadial(AbstractLearned):
    """Between wheel and plate, along the tyre's radius."""

    name: ClassVar[str] = "learned_tyre_radial"
    port: ClassVar[Port] = Port.TYRE_RADIAL
    parameters: ClassVar[tuple[Parameter, ...]] = _parameters(Port.TYRE_RADIAL)
    null: ClassVar[Mapping[str, float]] = _null(Port.TYRE_RADIAL)


class LearnedTyreLateral(AbstractLearned):
    """Between wheel and plate, across."""

    name: ClassVar[str] = "learned_tyre_lateral"
    port: ClassVar[Port] = Port.TYRE_LATERAL
    parameters: ClassVar[tuple[Parameter, ...]] = _parameters(Port.TYRE_LATERAL)
    null: ClassVar[Mapping[str, float]] = _null(Port.TYRE_LATERAL)
