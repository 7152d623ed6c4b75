"""What may go wrong on the way: a part of the loop fails at an instant and stays so."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

NOTHING = "none"


class Failure(eqx.Module):
    """From ``time`` [s] on, the drive has ``drive`` of its torque and power [1], sensors show ``alive`` of the truth.

    ``alive`` (3,) [1]: accelerometer, potentiometer, link angle.
    """

    time: Float[Array, ""]
    drive: Float[Array, ""]
    alive: Float[Array, "3"]

    def drive_at(self, t: Float[Array, ""]) -> Float[Array, ""]:
        """Share of its torque and power that the drive has at ``t`` [s]."""
        return jnp.where(t >= self.time, self.drive, 1.0)

    def shown(self, t: Float[Array, ""], readings: Float[Array, "3"]) -> Float[Array, "3"]:
        """The readings that arrive at ``t`` [s]."""
        return jnp.where(t >= self.time, self.alive * readings, readings)


class Kind(NamedTuple):
    """A kind of failure: what it is in words, the drive that is left, the sensors that are left.

    ``drive`` is the share that is left of its torque, ``alive`` those of the three readings [1].
    """

    about: str
    drive: float
    alive: tuple[float, float, float]


KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        NOTHING: Kind("nothing fails", 1.0, (1.0, 1.0, 1.0)),
        "actuator-off": Kind(
            "the drive loses its torque and the strut turns the link", 1e-4, (1.0, 1.0, 1.0)
        ),
        "actuator-weak": Kind("the drive keeps half of its torque and power", 0.5, (1.0, 1.0, 1.0)),
        "accelerometer": Kind("the accelerometer shows zero", 1.0, (0.0, 1.0, 1.0)),
        "potentiometer": Kind("the potentiometer shows zero", 1.0, (1.0, 0.0, 1.0)),
        "encoder": Kind("the link angle shows zero", 1.0, (1.0, 1.0, 0.0)),
    }
)
"""The kinds by name."""


def failing(kind: str, time: float) -> Failure:
    """The failure of a ``kind`` at ``time`` [s]; a kind that is not in :data:`KINDS` is a KeyError."""
    found = KINDS[kind]
    return Failure(jnp.asarray(time), jnp.asarray(found.drive), jnp.asarray(found.alive))
