"""The road and the link of recorded dwells, as what drives the model."""

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Excitation

SIGNIFICANT = 4.0
"""Harmonics below this many standard deviations are taken as noise and not imposed."""

MODELLED_CHANNELS = ("road_height", "link_angle", *RESPONSE_CHANNELS)
"""The channels that the model takes or gives."""

LINK_ORDERS = 9
"""Highest order of the link's motion that is imposed; what lies above is below the encoder's resolution."""


def measured_excitation(measured: HarmonicResponse, link_angle: float) -> Excitation:
    """Road and link of the dwells as they were recorded, harmonics that stand out of their noise.

    The means of the road are left out (a plate has no absolute height here); a link that was not recorded is
    rigid at ``link_angle`` [rad]. Raises :class:`InputError` if the road was not recorded.
    """
    if "road_height" not in measured.channels:
        raise InputError(
            "the road was not recorded", channel="road_height", remedy="map the road channel in channels.toml"
        )
    road = _significant(measured, "road_height")
    road[:, 0] = 0.0
    if "link_angle" in measured.channels:
        link = _significant(measured, "link_angle")[:, : LINK_ORDERS + 1]
        at_rest = ~measured.valid[:, measured.channel("link_angle"), 0]
        link[at_rest, 0] = link_angle
    else:
        link = np.full((road.shape[0], 1), link_angle, dtype=np.complex128)
    return Excitation(jnp.asarray(measured.frequency), jnp.asarray(road), jnp.asarray(link))


def _significant(measured: HarmonicResponse, channel: str) -> NDArray[np.complex128]:
    place = measured.channel(channel)
    harmonics = measured.harmonics[:, place].copy()
    variance = np.trace(measured.covariance[:, place], axis1=-2, axis2=-1)
    stands_out = np.abs(harmonics) ** 2 > SIGNIFICANT**2 * variance
    stands_out[:, 0] = True
    harmonics[~(stands_out & measured.valid[:, place])] = 0.0
    return harmonics
