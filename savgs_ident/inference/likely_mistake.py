"""Whether recordings are what a model says but for a unit, a sign, or two channels that were exchanged.

A model that lacks an effect, or has a wrong number, is off by more in one test than in another. A wrong unit is the
same factor in all of them, and a wrong sign half a turn. So each reading is held against the model as it was given,
by the logarithm of their complex ratio: where its median over all tests is large and its scatter is small, it is the
recording. Where all readings are off alike, it is the input.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.plants.base import AbstractPlant

LARGE = float(np.log(2.5))
"""Median logarithm of a ratio above which a factor is looked for: damping that is unknown does less."""

ALIKE = 0.35
"""Median deviation of the logarithms from their median up to which tests agree on one factor."""

OPPOSED = 2.2
"""Median angle of the ratio beyond which a sign is wrong [rad]; a resonance that is off turns half of the tests."""

STRONG = 0.3
"""Least amplitude that is looked at, in rms amplitudes of its reading: what is weak is turned by little."""

EXCHANGED = 0.5
"""Scatter of two exchanged channels over that as recorded, below which they were exchanged."""

_NEARLY = 0.2
_TENS = ((10.0, "a tenth"), (100.0, "a hundredth"), (1000.0, "a thousandth"))
_OF_ANY = tuple((factor, "a unit", f"another one {share} as large") for factor, share in _TENS)
_UNITS: dict[str, tuple[tuple[float, str, str], ...]] = {
    "m/s^2": ((9.80665, "g", "m/s^2"), *_OF_ANY[1:]),
    "m": (
        (25.4, "inches", "millimetres"),
        (39.37, "metres", "inches"),
        (10.0, "centimetres", "millimetres"),
        (100.0, "metres", "centimetres"),
        (1000.0, "metres", "millimetres"),
    ),
    "rad": ((180.0 / np.pi, "radians", "degrees"), *_OF_ANY),
}


class _Recorded(NamedTuple):
    """Name of a channel, and its unit in SI."""

    name: str
    unit: str


class _Ratio(NamedTuple):
    """Measured over predicted: median logarithm of the magnitude, its median deviation, and median angle [rad]."""

    channel: _Recorded
    factor: float
    scatter: float
    angle: float

    @property
    def off(self) -> bool:
        return abs(self.factor) > LARGE and self.scatter < ALIKE

    @property
    def opposed(self) -> bool:
        return self.angle > OPPOSED


def likely_mistake(
    measured: NDArray[np.complex128],
    predicted: NDArray[np.complex128],
    used: NDArray[np.bool_],
    plant: AbstractPlant | type[AbstractPlant],
) -> str:
    """What was recorded otherwise than it is said to be, in words; empty where nothing tells.

    ``measured`` and ``predicted`` [unit of the reading] are of the C channels of ``plant``, (D, C, K), and compared
    where ``used``.
    """
    channels = [_Recorded(each.name, each.unit) for each in plant.channels]
    driven = _Recorded(plant.inputs[0].name, plant.inputs[0].unit)

    def over(c: int, other: int) -> _Ratio | None:
        both = used[:, c] & used[:, other]
        return _ratio(channels[c], measured[:, c][both], predicted[:, other][both])

    known = {c: found for c in range(len(channels)) if (found := over(c, c)) is not None}
    ratios = list(known.values())
    if not ratios:
        return ""
    alone = len(ratios) == 1
    all_alike = driven if not alone else ratios[0].channel
    or_else = driven.name if alone else ""
    if all(each.opposed for each in ratios):
        return _sign(all_alike, or_else)
    factors = np.array([each.factor for each in ratios])
    if all(each.off for each in ratios) and np.ptp(factors) < 2.0 * ALIKE:
        return _unit(all_alike, float(np.median(factors)) * (1.0 if alone else -1.0), or_else)
    for one, other in combinations(known, 2):
        crossed = over(one, other), over(other, one)
        straight = known[one], known[other]
        if any(abs(each.factor) > LARGE for each in straight) and _scatter(crossed) < EXCHANGED * _scatter(
            straight
        ):
            return (
                f"{channels[one].name} follows what the model says of {channels[other].name}, and that the other, as "
                "if the two had been exchanged: look at their columns"
            )
    off = [each for each in ratios if each.off]
    others = f"{driven.name} and all other channels" if len(off) == 1 < len(ratios) else ""
    units = [_unit(each.channel, each.factor, others=others) for each in off]
    signs = [_sign(each.channel) for each in ratios if each.opposed]
    return "; ".join((*units, *signs))


AGAINST = -0.3
"""Correlation of a drive's force with that which is needed below which its sign is wrong; a friction that the model
lacks turns round with the motion, too."""


def mistaken_drive(
    measured: NDArray[np.float64], needed: NDArray[np.float64], plant: AbstractPlant | type[AbstractPlant]
) -> str:
    """Whether the force of a drive along a motion (m,) goes the other way than ``needed`` by the model, (m,).

    Its unit tells nothing: where masses and frictions are to be identified, any unit of force will do.
    """
    one, other = measured - np.mean(measured), needed - np.mean(needed)
    sizes = float(np.linalg.norm(one)), float(np.linalg.norm(other))
    if not (np.isfinite(sizes).all() and min(sizes) > 0.0):
        return ""
    opposed = float(one @ other) < AGAINST * sizes[0] * sizes[1]
    return (
        _sign(_Recorded(plant.inputs[0].name, plant.inputs[0].unit), "the measured motion") if opposed else ""
    )


def _scatter(ratios: Sequence[_Ratio | None]) -> float:
    return float(sum(np.inf if each is None else each.scatter for each in ratios))


def _ratio(
    channel: _Recorded, measured: NDArray[np.complex128], predicted: NDArray[np.complex128]
) -> _Ratio | None:
    if not measured.size or not np.isfinite(predicted).all():
        return None
    sizes = np.abs(measured), np.abs(predicted)
    strong = np.all([each > STRONG * np.sqrt(np.mean(each**2)) for each in sizes], axis=0)
    if not np.any(strong):
        return None
    ratio = np.log(measured[strong] / predicted[strong])
    factor = float(np.median(ratio.real))
    scatter = float(np.median(np.abs(ratio.real - factor)))
    return _Ratio(channel, factor, scatter, float(np.median(np.abs(ratio.imag))))


def _unit(channel: _Recorded, factor: float, or_else: str = "", others: str = "") -> str:
    """What a channel is that is so many times too large (the logarithm of that), alone or beside another.

    If there are ``others`` which agree, it may be they that are not as they are said to be.
    """
    which = channel.name if not or_else else f"{channel.name}, or {or_else} the other way round,"
    said = f"{which} is {np.exp(factor):.3g} times what the model says, in all tests alike"
    units = _UNITS.get(channel.unit, _OF_ANY)
    size, large, small = min(units, key=lambda each: abs(abs(factor) - np.log(each[0])))
    if abs(abs(factor) - np.log(size)) > _NEARLY:
        return f"{said}: look at its unit and its scale" + (f", or at those of {others}" if others else "")
    read, wrote = (small, large) if factor > 0.0 else (large, small)
    return f"{said}, as if {read} had been taken for {wrote}: look at its unit"


def _sign(channel: _Recorded, or_else: str = "") -> str:
    which = channel.name if not or_else else f"{channel.name}, or {or_else},"
    return f"{which} goes the other way than the model says, in all tests: look at its sign"
