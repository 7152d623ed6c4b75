"""Top mount of the strut: a spring with a damper beside it, in series with the whole strut.

    push beyond that at rest = x / C + c xd

with the compliance C [m/N] and the damping c [N s/m]. The strut's length was measured with the rig standing on
it.
"""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractSeries, InternalState, Load, Port, linear_series
from savgs_ident.model.values import Values


class MountCompliance(AbstractSeries):
    """A mount that gives way under the strut."""

    name: ClassVar[str] = "mount_compliance"
    port: ClassVar[Port] = Port.STRUT
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "mount_compliance", 5e-7, "m/N", lower=0.0, upper=2e-5, about="compliance of the top mount"
        ),
        Parameter("mount_damping", 500.0, "N s/m", lower=0.0, upper=5e4, about="damping of the top mount"),
    )
    null: ClassVar[Mapping[str, float]] = {"mount_compliance": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("mount_deflection", "m", 1e-3),)
    symptom: ClassVar[str] = (
        "the suspension is softer and the damper acts less, the more so the faster it moves"
    )
    reference: ClassVar[str] = "Dixon 2007, The Shock Absorber Handbook, on mount bushes in series"
    in_damper: ClassVar[bool] = False

    def balance(
        self, p: Values, load: Load, state: Float[Array, " s"], rate: Float[Array, " s"]
    ) -> Float[Array, " s"]:
        """The mount's deflection [m] under the strut's push."""
        return linear_series(p["mount_compliance"], p["mount_damping"], load, state, rate)
