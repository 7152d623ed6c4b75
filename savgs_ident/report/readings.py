"""The two channels whose response to the road is identified, as reports call and scale them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class Shown:
    """How a channel is shown: its ``title``, and ``scale`` from SI to ``unit``."""

    title: str
    unit: str
    scale: float
    per_road: str


READINGS: Mapping[str, Shown] = MappingProxyType(
    {
        "sprung_accel": Shown("sprung-mass acceleration", "m/s²", 1.0, "m/s² per m"),
        "susp_deflection": Shown("suspension deflection", "mm", 1e3, "m per m"),
    }
)
"""By name, in the order of :data:`savgs_ident.model.sensors.RESPONSE_CHANNELS` (which would load JAX)."""
