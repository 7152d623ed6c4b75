"""A mode of what carries a load: a frame, a bracket.

    xdd + 2 zeta w xd + w^2 x = beta (F - F_0),        w = 2 pi f

with the displacement x [m], the load F [N], F_0 at rest in the nominal state, the natural frequency f [Hz], the
damping ratio zeta [1] and the mobility beta [1/kg]: one over the mass that moves.

Source: Ewins 2000, Modal Testing, ch. 2, single degree of freedom.
"""

from collections.abc import Mapping
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSeriesLaw, Family, InternalState, Load, Port, Role, per


class Resonance(AbstractSeriesLaw):
    """Something that swings under the load."""

    name: ClassVar[str] = "resonance"
    words: ClassVar[str] = "something that swings under the load"
    family: ClassVar[Family] = Family.OSCILLATOR
    roles: ClassVar[tuple[Role, ...]] = (Role("mobility", 0.0), Role("frequency"), Role("damping_ratio"))

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        """The typical displacement under the typical load at rest; a mode at 12 Hz on a time scale of 1."""
        frequency = 12.0 / port.time_scale
        mobility = port.displacement * (2.0 * np.pi * frequency) ** 2 / port.force
        unit = per(f"{port.displacement_unit}/s^2", port.force_unit)
        return {
            "mobility": Parameter(
                "mobility", mobility, unit, lower=0.0, upper=100.0 * mobility, about="mobility of the mode"
            ),
            "frequency": Parameter(
                "frequency",
                frequency,
                "Hz",
                lower=2.0 / port.time_scale,
                upper=80.0 / port.time_scale,
                about="natural frequency",
            ),
            "damping_ratio": Parameter(
                "damping_ratio", 0.05, "1", lower=0.005, upper=1.0, about="damping ratio"
            ),
        }

    def tried(self, port: Port) -> tuple[tuple[str, float], ...]:
        """Natural frequencies [Hz] from below to far above those of the plant."""
        return tuple(
            ("frequency", frequency / port.time_scale) for frequency in np.geomspace(4.0, 60.0, 16).tolist()
        )

    def states(self, port: Port) -> tuple[InternalState, ...]:
        """The displacement and its velocity."""
        unit = port.displacement_unit
        return (
            InternalState("displacement", unit, port.displacement),
            InternalState("velocity", f"{unit}/s", port.velocity),
        )

    def balance(
        self, v: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """Velocity and acceleration out of balance [m/s], [m/s^2]."""
        omega = 2.0 * jnp.pi * v["frequency"]
        held = restoring_acceleration(state[0], state[1], omega, v["damping_ratio"])
        acceleration = v["mobility"] * load.beyond_rest - held
        return rate - jnp.stack([state[1], acceleration])


def restoring_acceleration(displacement: Any, velocity: Any, natural: Any, damping_ratio: Any) -> Any:
    """What holds a mode back [m/s^2]: 2 zeta w xd + w^2 x, with the natural angular frequency w [rad/s]."""
    return 2.0 * damping_ratio * natural * velocity + natural**2 * displacement


def relative_response(
    omega: NDArray[np.float64], natural: float, damping_ratio: float
) -> NDArray[np.complex128]:
    """Displacement under a load of angular frequencies ``omega`` [rad/s], (n,), over that under a load at rest [1].

    ``natural`` is the angular frequency of the mode [rad/s].
    """
    moved = restoring_acceleration(1.0, 1j * omega, natural, damping_ratio) - omega**2
    return np.asarray(natural**2 / moved)
