"""A tyre that damps more or less than its sheet says, beyond its tolerance.

    c_t -> c_t (1 + e)

A sheet knows little about it: e [1] may be large.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractChange, InternalState, Port
from savgs_ident.model.values import Values


class TyreDamping(AbstractChange):
    """Another radial damping of the tyre."""

    name: ClassVar[str] = "tyre_damping"
    port: ClassVar[Port] = Port.TYRE_RADIAL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "tyre_damping_change",
            5.0,
            "1",
            lower=-0.95,
            upper=20.0,
            about="relative change of the tyre's damping",
        ),
    )
    null: ClassVar[Mapping[str, float]] = {"tyre_damping_change": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = "the phase of both channels lags or leads in the fast tests, the amplitude fits"
    reference: ClassVar[str] = "Wong 2008, Theory of Ground Vehicles, ch. 1, ride properties of tyres"

    def changes(self, p: Values) -> Mapping[str, Float[Array, ""]]:
        """The tyre's radial damping [N s/m]."""
        return {"c_t": p["c_t"] * (1.0 + p["tyre_damping_change"])}
