"""What drives the rig at an instant."""

from typing import NamedTuple

from jaxtyping import Array, Float

from savgs_ident.model.effect import Cam
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road


class Imposed(NamedTuple):
    """Forces [N] imposed from outside at the ports, signs as in :class:`savgs_ident.model.effect.PortSignals`."""

    rail: Float[Array, ""]
    strut: Float[Array, ""]
    suspension: Float[Array, ""]
    tyre_radial: Float[Array, ""]
    tyre_lateral: Float[Array, ""]


class Inputs(NamedTuple):
    """What drives the rig: road and link; the cam behind the road, and forces from outside, where there are any."""

    road: Road
    link: Link
    cam: Cam | None = None
    imposed: Imposed | None = None
