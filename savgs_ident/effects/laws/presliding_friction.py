"""Coulomb friction that gives before it slides, of joints, seals and guides, whatever they carry.

    F = -F_c (x + T v) / x_s held within -F_c .. F_c

with x [m] the stretch of a bristle (:func:`savgs_ident.effects.base.bristle`) along the port's displacement, which
counts from the nominal state, the friction F_c [N], x_s [m] how far it gives before it slides, and T [s] its damping
over its stiffness.

Source: Dupont, Hayward, Armstrong, Altpeter 2002, IEEE Transactions on Automatic Control 47(5).
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    Bristle,
    Family,
    FrictionLimit,
    InternalState,
    Port,
    PortSignals,
    Presliding,
    Role,
    bristle,
)


class PreslidingFriction(AbstractForceLaw):
    """Friction with a bristle of its own."""

    name: ClassVar[str] = "friction"
    words: ClassVar[str] = "friction that gives like a spring before it slides"
    family: ClassVar[Family] = Family.FRICTION
    drags_anchors: ClassVar[bool] = True
    roles: ClassVar[tuple[Role, ...]] = (Role("force", 0.0), Role("stretch"), Role("lag"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical force, which slides after a hundredth of the typical displacement."""
        return {
            "force": Parameter(
                "force", port.force, port.force_unit, lower=0.0, upper=100.0 * port.force, about="friction"
            ),
            "stretch": 1e-2 * port.displacement,
            "lag": 1e-3 * port.time_scale,
        }

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """Where the bristle is anchored."""
        return (InternalState("anchor", port.displacement_unit, port.displacement, slips=True),)

    def suits(self, port: Port) -> bool:
        """Where nothing sticks already: a contact has its own bristle."""
        return port.kind is self.kind and port.contact is None

    def _bristle(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Bristle:
        """Bristle of unit friction: so it is one and the same at the null."""
        one = jnp.ones_like(signals.displacement)
        moved = signals._replace(displacement=signals.displacement - signals.rest)
        stick = Presliding(one / v["stretch"], one * (v["lag"] / v["stretch"]))
        return bristle(stick, moved, FrictionLimit(one, one), state[0])

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction [N]."""
        return v["force"] * self._bristle(v, signals, state).force

    def rate(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """The anchor's velocity [m/s]."""
        return self._bristle(v, signals, state).rate[None]
