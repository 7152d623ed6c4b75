"""A spring in series at any port, without parameters of its own."""

from typing import ClassVar

import equinox as eqx
from jaxtyping import Array

from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port
from savgs_ident.model.values import Values

SERIES_PORTS = (
    ("mount_way", Port.STRUT, False),
    ("damper_way", Port.STRUT, True),
    ("link_way", Port.LINK, False),
    ("plate_way", Port.ROAD, False),
    ("carcass_way", Port.TYRE_LATERAL, False),
    ("frame_way", Port.FRAME, False),
)
"""Where something may give way: its name among what is imposed, its port, and whether at the damper's end."""


class Yielding(AbstractSeries):
    """A spring of a compliance [m/N or rad/(N m)], with nothing beside it."""

    port: Port = eqx.field(static=True)
    in_damper: bool = eqx.field(static=True)
    compliance: float = 0.0
    name: str = eqx.field(static=True, default="yielding")
    parameters = ()
    null: ClassVar[dict[str, float]] = {}
    states = (InternalState("way", "m", 1e-3),)
    symptom = "none"
    reference = "none"

    def balance(self, p: Values, load: Load, state: Array, rate: Array) -> Array:
        return state - self.compliance * load.beyond_rest
