"""Foreign laws: effects that follow formulas which the diagnosis does not have.

    drawn = FOREIGN["tyre_cubic"]
    drawn.effect            # the law at its port, as in the catalogue
    drawn.ports             # where an engineer would rightly put it
    drawn.families          # what kind of thing an engineer would rightly call it

They are the truth of foreign trials. Truth and diagnosis share neither formula nor typical sizes. The laws of sensors
and inputs are in this file, those of forces in :mod:`savgs_ident.validation.foreign_frictions` (friction) and
:mod:`savgs_ident.validation.foreign_forces` (springs, dampers, contacts, attached masses).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractInputLaw,
    AbstractLaw,
    AbstractSensorLaw,
    Family,
    Fundamental,
    InputSignal,
    Port,
    Role,
)
from savgs_ident.effects.effect import Effect, typical_effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.ports import (
    ACCEL,
    DAMPER,
    DEFLECTION,
    RAIL,
    ROAD,
    STRUT,
    SUSPENSION,
    TYRE_RADIAL,
)
from savgs_ident.validation.foreign_forces import (
    Clearance,
    CubicStiffness,
    DigressiveDamping,
    EndPlay,
    ExponentialStiffness,
    ExponentialStop,
    HardeningOscillator,
    QuadraticDrag,
)
from savgs_ident.validation.foreign_frictions import (
    BoucWen,
    Dahl,
    DirectionalFriction,
    ExponentialStribeck,
    LuGre,
    SmoothFriction,
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


WAVE_ORDERS = (4, 5, 6, 7, 8, 9)
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
        Role(f"{wave}_{order}", 0.0) for order in WAVE_ORDERS for wave in ("cos", "sin")
    )

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """A hundredth of the typical displacement in the fourth order, less with the square of the others."""
        found: dict[str, Parameter | float] = {}
        for order in WAVE_ORDERS:
            size = 0.01 * port.displacement * (WAVE_ORDERS[0] / order) ** 2
            for wave in ("cos", "sin"):
                role, about = f"{wave}_{order}", f"amplitude of order {order}, {wave}"
                unit = port.displacement_unit
                found[role] = Parameter(role, size, unit, lower=-1e3 * size, upper=1e3 * size, about=about)
        return found

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        """What the waves add."""
        value, slope = jnp.zeros_like(fundamental.angle), jnp.zeros_like(fundamental.angle)
        for order in WAVE_ORDERS:
            along, across = v[f"cos_{order}"], v[f"sin_{order}"]
            cosine, sine = jnp.cos(order * fundamental.angle), jnp.sin(order * fundamental.angle)
            value = value + along * cosine + across * sine
            slope = slope + order * (across * cosine - along * sine)
        return InputSignal(value, slope * fundamental.speed)


@dataclass(frozen=True)
class ForeignEffect:
    """An effect that no catalogue has, and what counts as the right answer.

    Attributes:
        effect: the law at its port.
        ports: locations that are right.
        families: families that are right.
    """

    effect: Effect
    ports: tuple[str, ...]
    families: tuple[str, ...]


def _foreign(
    name: str,
    law: AbstractLaw,
    port: Port,
    *families: Family,
    ports: tuple[str, ...] = (),
    named: Mapping[str, str] | None = None,
) -> ForeignEffect:
    """A law at a port with its typical sizes there; ``named`` are roles that are parameters of the plant.

    Right are the port's location and the law's family, or those given.
    """
    effect = typical_effect(name, port, law, named, symptom=law.name, reference="the law's own")
    accepted = families or (law.family,)
    return ForeignEffect(effect, ports or (port.location,), tuple(family.value for family in accepted))


_BODY = ("rail", "inertia", "frame")
"""Where something that swings on the sprung mass may rightly be put: its force acts on the body along the rail."""

_PROGRESSIVE = (Family.STIFFNESS, Family.STOP)
"""A spring that is soft and then steep is rightly called either."""

_ENTRIES = (
    _foreign("rail_exponential_stribeck", ExponentialStribeck(), RAIL, named={"coefficient": "mu_r"}),
    _foreign("rail_dahl", Dahl(), RAIL),
    _foreign("rail_lugre", LuGre(), RAIL),
    _foreign("rail_smooth", SmoothFriction(), RAIL),
    _foreign("rail_directional", DirectionalFriction(), RAIL),
    _foreign("rail_drag", QuadraticDrag(), RAIL),
    _foreign("body_hardening_oscillator", HardeningOscillator(), RAIL, ports=_BODY),
    _foreign("joint_dahl", Dahl(), SUSPENSION),
    _foreign("joint_lugre", LuGre(), SUSPENSION),
    _foreign("joint_bouc_wen", BoucWen(), SUSPENSION),
    _foreign("joint_smooth", SmoothFriction(), SUSPENSION),
    _foreign("joint_directional", DirectionalFriction(), SUSPENSION),
    _foreign("joint_cubic", CubicStiffness(), SUSPENSION),
    _foreign("joint_exponential", ExponentialStiffness(), SUSPENSION, *_PROGRESSIVE),
    _foreign("joint_digressive", DigressiveDamping(), SUSPENSION),
    _foreign("joint_clearance", Clearance(), SUSPENSION, Family.STOP, Family.PLAY),
    _foreign("strut_bouc_wen", BoucWen(), STRUT),
    _foreign("strut_smooth", SmoothFriction(), STRUT),
    _foreign("strut_cubic", CubicStiffness(), STRUT),
    _foreign("strut_buffer", ExponentialStop(), STRUT, Family.STOP, Family.STIFFNESS),
    _foreign("strut_drag", QuadraticDrag(), STRUT),
    _foreign("strut_digressive", DigressiveDamping(), STRUT),
    _foreign("strut_clearance", Clearance(), STRUT, Family.STOP, Family.PLAY),
    _foreign("damper_end_play", EndPlay(), DAMPER),
    _foreign("tyre_cubic", CubicStiffness(from_rest=False), TYRE_RADIAL),
    _foreign("tyre_exponential", ExponentialStiffness(from_rest=False), TYRE_RADIAL),
    _foreign("accel_second_order", SecondOrderFilter(), ACCEL),
    _foreign("accel_high_pass", HighPass(), ACCEL),
    _foreign("deflection_second_order", SecondOrderFilter(), DEFLECTION),
    _foreign("deflection_high_pass", HighPass(), DEFLECTION),
    _foreign("cam_waves", CamWaves(), ROAD),
)

FOREIGN: Mapping[str, ForeignEffect] = MappingProxyType({each.effect.name: each for each in _ENTRIES})
"""All foreign effects by name."""

TRIAL_EFFECTS = (*CATALOGUE, *FOREIGN)
"""Names of the effects that a rig of a trial may have: those of the catalogue, then the foreign ones."""


def foreign_laws() -> Mapping[str, tuple[str, ...]]:
    """The names of the foreign effects by the name of their law."""
    found: dict[str, tuple[str, ...]] = {}
    for name, each in FOREIGN.items():
        law = each.effect.law.name
        found[law] = (*found.get(law, ()), name)
    return found
