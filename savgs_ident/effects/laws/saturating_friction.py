"""Friction that grows with the velocity and saturates.

    F = -sign(v) min(1, |v| / v_s) mu |N|

with the velocity v [m/s], the velocity v_s [m/s] at which it saturates, the coefficient mu [1] and the load N [N].
Below v_s only the ratio mu / v_s matters.

Source: Yu et al. 2017, eq. (3).
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractForceLaw, Family, Port, PortSignals, Role


class SaturatingFriction(AbstractForceLaw):
    """Friction in proportion to a load, with a shaping velocity."""

    name: ClassVar[str] = "saturating_friction"
    words: ClassVar[str] = "friction that sets in smoothly with the velocity"
    family: ClassVar[Family] = Family.FRICTION
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient", 0.0), Role("velocity"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """Saturated at a sixth of the typical velocity."""
        speed, unit = port.velocity / 6.0, f"{port.displacement_unit}/s"
        return {
            "coefficient": Parameter(
                "coefficient", 0.1, "1", lower=0.0, upper=2.0, about="friction coefficient"
            ),
            "velocity": Parameter(
                "velocity", speed, unit, lower=speed / 50.0, upper=20.0 * speed, about="shaping velocity"
            ),
        }

    def suits(self, port: Port) -> bool:
        """Only where the port carries a load that is not a damper's."""
        return port.kind is self.kind and port.loaded and port.damped_at is None

    def force(self, v: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction [N]."""
        share = jnp.clip(signals.velocity / v["velocity"], -1.0, 1.0)
        return -share * v["coefficient"] * jnp.abs(signals.load)
