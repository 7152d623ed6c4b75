"""What recordings of the rig hold: its channels, and what is true of any quarter car, whatever its parameters.

The checks find wrong units and signs:

* Far below resonance the body follows the road: sprung acceleration = -(2 pi f)^2 road height. A ratio far from
  one indicates a unit (g for m/s^2 is a factor 9.8), the opposite sign indicates a sign.
* A compressed strut pushes the body up, so acceleration and deflection are in phase.
* An accelerometer at rest reads +9.8 m/s^2 along an axis that points up (so does ``sensor_msgs/Imu``); the
  canonical channel does not contain gravity. Where the mean of the channel shows that it does, the mean of the
  standstill is subtracted, which removes the sensor's bias too; without a standstill, standard gravity is
  subtracted and the bias remains.

A campaign is read and looked into so::

    campaign = load_campaign("campaign.csv.gz")
    for dwell in campaign.of_kind("dwell"):
        accel = dwell.channels["sprung_accel"]
        print(dwell.frequency_hz, accel.time, accel.values)
"""

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.channels import ChannelMap, Progress
from savgs_ident.recordings.checks_signal import DataLocation, ordinary_samples
from savgs_ident.recordings.read import read_campaign
from savgs_ident.recordings.recording import (
    Campaign,
    ChannelSpec,
    JointChannels,
    RecordedChannel,
    Recording,
    RecordingLayout,
)
from savgs_ident.recordings.units import STANDARD_GRAVITY

_LOW_HZ = 1.25
"""Half of the lowest resonance that a rig of this kind has, about."""
_LOWEST, _HIGHEST = 0.3, 3.5
_OPPOSED = -0.3
_SMALLEST_DEFLECTION = 0.005
"""Peak-to-peak of the deflection over that of the road, largest over the dwells."""


def check_physics(recordings: Sequence[Recording], source: str) -> tuple[DataWarning, ...]:
    """Warnings ``implausible_unit`` and ``sign_suspect``, at most one a pair of channels."""
    dwells = [_without_spikes(recording) for recording in recordings if recording.kind == "dwell"]
    return (*_body_follows_road(dwells, source), *_strut_pushes(dwells, source), *_deflects(dwells, source))


def _without_spikes(recording: Recording) -> Recording:
    return replace(
        recording, channels={name: ordinary_samples(each) for name, each in recording.channels.items()}
    )


def _body_follows_road(dwells: list[Recording], source: str) -> tuple[DataWarning, ...]:
    slow = [
        d for d in dwells if d.frequency_hz and d.frequency_hz <= _LOW_HZ and "sprung_accel" in d.channels
    ]
    if not slow:
        return ()
    dwell = min(slow, key=lambda d: d.frequency_hz or 0.0)
    road, accel = dwell.channels["road_height"], dwell.channels["sprung_accel"]
    expected = (2 * pi * (dwell.frequency_hz or 0.0)) ** 2 * float(np.std(road.values))
    place = DataLocation(source, dwell.name, "sprung_accel")
    ratio = float(np.std(accel.values)) / expected if expected else 1.0
    if not _LOWEST <= ratio <= _HIGHEST:
        return (
            place.warning(
                "implausible_unit",
                f"is {ratio:.3g} times what the road asks for at {dwell.frequency_hz:.3g} Hz, not near 1",
                "check the units of sprung_accel (g or m/s^2) and road_height (mm or m)",
            ),
        )
    if _correlation(accel, road) > -_OPPOSED:
        return (
            place.warning(
                "sign_suspect",
                f"has the sign of the road at {dwell.frequency_hz:.3g} Hz, it should be opposed",
                "check the signs of sprung_accel and road_height (both up positive)",
            ),
        )
    return ()


def _strut_pushes(dwells: list[Recording], source: str) -> tuple[DataWarning, ...]:
    pairs = [
        (d.channels["sprung_accel"], d.channels["susp_deflection"])
        for d in dwells
        if "sprung_accel" in d.channels and "susp_deflection" in d.channels
    ]
    if not pairs or np.median([_correlation(accel, deflection) for accel, deflection in pairs]) > _OPPOSED:
        return ()
    return (
        DataLocation(source, channel="susp_deflection").warning(
            "sign_suspect",
            "is opposed to the sprung acceleration in most dwells: a compressed strut pushes up",
            "check the signs of susp_deflection (positive in bump) and sprung_accel (up positive)",
        ),
    )


def _deflects(dwells: list[Recording], source: str) -> tuple[DataWarning, ...]:
    ratios = [
        float(np.ptp(d.channels["susp_deflection"].values) / np.ptp(d.channels["road_height"].values))
        for d in dwells
        if "susp_deflection" in d.channels and np.ptp(d.channels["road_height"].values) > 0
    ]
    if not ratios or max(ratios) >= _SMALLEST_DEFLECTION:
        return ()
    return (
        DataLocation(source, channel="susp_deflection").warning(
            "implausible_unit",
            f"moves at most {max(ratios):.2g} times as much as the road",
            "check the units of susp_deflection and road_height (mm or m)",
        ),
    )


def _correlation(one: RecordedChannel, other: RecordedChannel) -> float:
    """Correlation of two channels with clocks of their own, on the clock of the first."""
    there = np.interp(one.time, other.time, other.values)
    spread = float(np.std(one.values) * np.std(there))
    return (
        float(np.mean((one.values - one.values.mean()) * (there - there.mean()))) / spread if spread else 0.0
    )


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
        r.name: float(np.mean(ordinary_samples(r.channels[_CHANNEL]).values))
        for r in recordings
        if _CHANNEL in r.channels
    }
    level = float(np.median(list(means.values()))) if means else 0.0
    place = DataLocation(source, channel=_CHANNEL)
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
    return tuple(_subtract(recording, offset) for recording in recordings), (note,)


def _subtract(recording: Recording, offset: float) -> Recording:
    channel = recording.channels.get(_CHANNEL)
    if channel is None:
        return recording
    lowered = replace(channel, values=channel.values - offset)
    return replace(recording, channels={**recording.channels, _CHANNEL: lowered})


RIG_LAYOUT = RecordingLayout(
    channels=(
        ChannelSpec(
            "road_height", "m", "road",
            ("road", "road_z", "road_displacement", "road_profile", "cam_height", "plate_height", "z_r", "zr"),
            largest=0.5, suspect="mm or cm", short="road",
        ),
        ChannelSpec(
            "sprung_accel", "m/s^2", "sprung-mass acceleration",
            (
                "sprung_acceleration", "sprung_mass_accel", "sprung_mass_acceleration", "body_accel",
                "body_acceleration", "accel_z", "acc_z", "acceleration_z", "az", "z_s_ddot",
            ),
            largest=300.0, suspect="mm/s^2, or a sensor in another unit than its header says", short="accel",
        ),
        ChannelSpec(
            "susp_deflection", "m", "suspension deflection",
            ("suspension_deflection", "susp_defl", "deflection", "l_s"),
            largest=0.5, suspect="mm or cm", short="defl.",
        ),
        ChannelSpec(
            "link_angle", "rad", "link angle", ("single_link_angle", "sl_angle", "theta_sl", "dtheta_sl"),
            largest=20.0, suspect="deg",
        ),
        ChannelSpec(
            "link_velocity", "rad/s", "link velocity", ("link_speed", "single_link_velocity", "sl_velocity"),
            largest=60.0, suspect="rpm or deg/s",
        ),
        ChannelSpec(
            "motor_current", "A", "motor current", ("current", "i_q", "iq", "motor_current_q"),
            largest=500.0, suspect="mA",
        ),
    ),
    driven="road_height",
    responses=("sprung_accel", "susp_deflection"),
    still=1e-3,
    joint=JointChannels("link", "link_angle", "link_velocity"),
    corrections=(remove_gravity,),
    checks=(check_physics,),
)  # fmt: skip
"""The channels of the rig, up and bump positive: one that differs is mapped with ``sign = -1``."""


def load_campaign(
    path: Path | str,
    channel_map: ChannelMap | Path | str | None = None,
    *,
    layout: RecordingLayout = RIG_LAYOUT,
    progress: Progress | None = None,
) -> Campaign:
    """Read and check everything at ``path``.

    ``path`` is a CSV (plain or gzipped) or MCAP file, or a folder of such files, each with a test or several.
    ``channel_map`` is a map, or the path of one; without it, a ``channels.toml`` beside the file (or in the
    folder) is used if there is one. ``layout`` says which channels there are, by default those of the rig.
    ``progress`` is called with the fraction read, 0 to 1.

    Channels are in SI, time in [s] from the start of each test. Raises :class:`InputError`, which names file, test,
    channel and time, and what to do.
    """
    return read_campaign(path, layout, channel_map, progress=progress)
