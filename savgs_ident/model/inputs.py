"""What drives the rig at an instant."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.effect import Cam
from savgs_ident.model.strut import Link
from savgs_ident.model.tyre import Road


class Imposed(NamedTuple):
    """What is imposed from outside at the ports.

    Forces [N], signs as in :class:`savgs_ident.model.effect.PortSignals`, and what gives way in the path of a load
    with its rate [m, m/s; the link: rad, rad/s], signs as in :class:`savgs_ident.model.effect.AbstractSeries`.
    """

    rail: Float[Array, ""]
    strut: Float[Array, ""]
    suspension: Float[Array, ""]
    tyre_radial: Float[Array, ""]
    tyre_lateral: Float[Array, ""]
    mount_way: Float[Array, "2"]
    damper_way: Float[Array, "2"]
    link_way: Float[Array, "2"]
    plate_way: Float[Array, "2"]
    carcass_way: Float[Array, "2"]
    frame_way: Float[Array, "2"]


def nothing_imposed(like: Float[Array, "*n"]) -> Imposed:
    """Zeros [SI], one for each element of ``like``."""
    zero = jnp.zeros_like(like)
    pair = jnp.zeros((*like.shape, 2), like.dtype)
    return Imposed(zero, zero, zero, zero, zero, pair, pair, pair, pair, pair, pair)


class Inputs(NamedTuple):
    """What drives the rig: road and link; the cam behind the road, and what is imposed, where there is any."""

    road: Road
    link: Link
    cam: Cam | None = None
    imposed: Imposed | None = None
