"""Gravity in the accelerometer: sensors feel it, the canonical channel does not contain it.

An accelerometer at rest reads +9.8 m/s^2 along an axis that points up (so does ``sensor_msgs/Imu``). Where
the mean of the channel says that gravity is still in it, the mean of the standstill is taken off, which
removes the sensor's bias along with it; without a standstill, standard gravity, which leaves the bias in.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Recording
from savgs_ident.recordings.units import STANDARD_GRAVITY

_CHANNEL = "sprung_accel"
_LEAST = 5.0
"""A mean [m/s^2] beyond this is gravity: no rig accelerates upwards for good, no bias is half a g."""


def remove_gravity(
    recordings: Sequence[Recording], source: str
) -> tuple[tuple[Recording, ...], tuple[DataWarning, ...]]:
    """The recordings with gravity taken off ``sprung_accel`` where it was in.

    Raises :class:`InputError` where the sensor reads gravity downwards: its sign is the other one.
    """
    means = {
        r.name: float(np.mean(r.channels[_CHANNEL].values)) for r in recordings if _CHANNEL in r.channels
    }
    level = float(np.median(list(means.values()))) if means else 0.0
    place = Place(source, channel=_CHANNEL)
    if abs(level) < _LEAST:
        return tuple(recordings), ()
    if level < 0.0:
        raise place.error(
            f"its mean is {level:.3f} m/s^2: it contains gravity and points downwards",
            "map it with sign = -1 in channels.toml",
        )
    still = [means[r.name] for r in recordings if r.kind == "standstill" and r.name in means]
    offset = float(np.mean(still)) if still else STANDARD_GRAVITY
    basis = "the mean at standstill" if still else "standard gravity, there is no standstill"
    note = place.warning(
        "gravity_removed",
        f"contained gravity, {offset:.5f} m/s^2 ({basis}) is taken off",
        "none needed" if still else "record a standstill, so that the sensor's bias is known too",
    )
    return tuple(_less(recording, offset) for recording in recordings), (note,)


def _less(recording: Recording, offset: float) -> Recording:
    channel = recording.channels.get(_CHANNEL)
    if channel is None:
        return recording
    lowered = replace(channel, values=channel.values - offset)
    return replace(recording, channels={**recording.channels, _CHANNEL: lowered})
