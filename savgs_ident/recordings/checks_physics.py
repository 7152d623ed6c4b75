"""What any quarter car must do, whatever its parameters: catches units and signs that bounds cannot.

* Far below resonance the body follows the road: sprung acceleration = -(2 pi f)^2 road height. A ratio far
  from one is a unit (g for m/s^2 is a factor 9.8), the other sign is a sign.
* The strut pushes the body up when it is compressed, so acceleration and deflection are in phase.
"""

from collections.abc import Sequence
from math import pi

import numpy as np

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.place import Place
from savgs_ident.recordings.recording import Channel, Recording

_LOW_HZ = 1.25
"""Half of the lowest resonance that a rig of this kind has, about."""
_LOWEST, _HIGHEST = 0.3, 3.5
_OPPOSED = -0.3
_SMALLEST_DEFLECTION = 0.005
"""Peak-to-peak of the deflection over that of the road, largest over the dwells."""


def check_physics(recordings: Sequence[Recording], source: str) -> tuple[DataWarning, ...]:
    """Warnings ``implausible_unit`` and ``sign_suspect``, at most one a pair of channels."""
    dwells = [recording for recording in recordings if recording.kind == "dwell"]
    return (*_body_follows_road(dwells, source), *_strut_pushes(dwells, source), *_deflects(dwells, source))


def _body_follows_road(dwells: list[Recording], source: str) -> tuple[DataWarning, ...]:
    slow = [
        d for d in dwells if d.frequency_hz and d.frequency_hz <= _LOW_HZ and "sprung_accel" in d.channels
    ]
    if not slow:
        return ()
    dwell = min(slow, key=lambda d: d.frequency_hz or 0.0)
    road, accel = dwell.channels["road_height"], dwell.channels["sprung_accel"]
    expected = (2 * pi * (dwell.frequency_hz or 0.0)) ** 2 * float(np.std(road.values))
    place = Place(source, dwell.name, "sprung_accel")
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
        Place(source, channel="susp_deflection").warning(
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
        Place(source, channel="susp_deflection").warning(
            "implausible_unit",
            f"moves at most {max(ratios):.2g} times as much as the road",
            "check the units of susp_deflection and road_height (mm or m)",
        ),
    )


def _correlation(one: Channel, other: Channel) -> float:
    """Correlation of two channels with clocks of their own, on the clock of the first."""
    there = np.interp(one.time, other.time, other.values)
    spread = float(np.std(one.values) * np.std(there))
    return (
        float(np.mean((one.values - one.values.mean()) * (there - there.mean()))) / spread if spread else 0.0
    )
