"""A mode of the frame that carries rail and plate.

    zdd_f + 2 zeta w zd_f + w^2 z_f = beta F,        w = 2 pi f

with z_f [m] the height of rail and plate, F [N] the force of the rig on them beyond its weight, upwards, and the
mobility beta [1/kg]: one over the mass that moves.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port
from savgs_ident.model.values import Values


class FrameMode(AbstractSeries):
    """A frame that moves with rail and plate."""

    name: ClassVar[str] = "frame_mode"
    port: ClassVar[Port] = Port.FRAME
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "frame_mobility",
            2e-3,
            "1/kg",
            lower=0.0,
            upper=1.0,
            about="one over the moving mass of the frame",
        ),
        Parameter(
            "frame_frequency", 12.0, "Hz", lower=2.0, upper=80.0, about="natural frequency of the frame"
        ),
        Parameter(
            "frame_damping_ratio", 0.05, "1", lower=0.005, upper=1.0, about="damping ratio of the frame"
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"frame_mobility": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (
        InternalState("frame_height", "m", 1e-3),
        InternalState("frame_velocity", "m/s", 1e-1),
    )
    symptom: ClassVar[str] = "orders near one frequency are too large whichever dwell they belong to"
    reference: ClassVar[str] = "Ewins 2000, Modal Testing, ch. 2, single degree of freedom"
    tried: ClassVar[tuple[Mapping[str, float], ...]] = tuple(
        {"frame_frequency": frequency} for frequency in np.geomspace(4.0, 60.0, 16).tolist()
    )
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """Velocity and acceleration of the frame out of balance [m/s], [m/s^2]."""
        omega = 2.0 * jnp.pi * p["frame_frequency"]
        damping = 2.0 * p["frame_damping_ratio"] * omega * state[1]
        acceleration = p["frame_mobility"] * load.beyond_rest - damping - omega**2 * state[0]
        return rate - jnp.stack([state[1], acceleration])
