"""The shape of a drawn effect, and the size at which it changes the response by what was drawn.

Newtons of friction and seconds of lag have no common size; what they do to the response has. The amplitude is
searched for at which the clean response changes by what was drawn
(:func:`savgs_ident.validation.virtual_rig.change_of`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from savgs_ident.core.parameter import Parameter
from savgs_ident.effects.effect import Effect

SHAPE_SPREAD = 0.35
"""Width of the logarithm of what shapes an effect: nearly always within a factor of two of its typical value."""

SHAPE_LIMIT = 2.0
"""It is never further off."""

CLOSE = 0.02
"""The change is met to this share of it."""

TRIES = 14
"""Amplitudes that are tried."""

FURTHER = 8.0
"""Most by which an amplitude grows from one try to the next."""

UNSEEN = 1e-9
"""A change that is none."""

Change = Callable[[float], float | None]
"""Change of the response at an amplitude in typical sizes; None where there is no motion."""


@dataclass(frozen=True)
class Form:
    """An effect whose size is still open.

    ``shapes`` are the parameters that shape it and ``direction`` those of its size, at one typical size; SI.
    ``null`` are the values at which it vanishes and ``most`` the typical sizes that its bounds allow.
    """

    shapes: Mapping[str, float]
    direction: Mapping[str, float]
    null: Mapping[str, float]
    most: float

    def at(self, size: float) -> dict[str, float]:
        """All parameters [SI] at so many typical sizes."""
        return {name: self.null[name] + size * step for name, step in self.direction.items()} | dict(
            self.shapes
        )


def draw_form(effect: Effect, random: np.random.Generator) -> Form:
    """Shapes and the direction of the amplitudes of an effect.

    An effect with one amplitude grows to either side that its bounds allow, one with several in any direction.
    """
    amplitudes = [each for each in effect.parameters if each.name in effect.null]
    shapes = {each.name: _shape(each, random) for each in effect.parameters if each.name not in effect.null}
    typical = np.array([abs(each.value - effect.null[each.name]) for each in amplitudes])
    toward = random.standard_normal(len(amplitudes))
    toward *= typical / np.linalg.norm(toward)
    signed = [
        float(step if _room(each, effect.null[each.name], step) > 0.0 else -step)
        for each, step in zip(amplitudes, toward, strict=True)
    ]
    most = min(
        _room(each, effect.null[each.name], step) for each, step in zip(amplitudes, signed, strict=True)
    )
    direction = {each.name: step for each, step in zip(amplitudes, signed, strict=True)}
    return Form(shapes, direction, effect.null, most)


def _shape(each: Parameter, random: np.random.Generator) -> float:
    factor = np.exp(SHAPE_SPREAD * random.standard_normal())
    return float(
        np.clip(each.value * np.clip(factor, 1.0 / SHAPE_LIMIT, SHAPE_LIMIT), each.lower, each.upper)
    )


def _room(each: Parameter, null: float, step: float) -> float:
    """Steps that fit between the null and the bound."""
    bound = each.upper if step > 0.0 else each.lower
    return abs((bound - null) / step)


def find_size(change: Change, target: float, most: float) -> float | None:
    """The size [1] at which the response changes by ``target`` [1]; None if it does nowhere up to ``most``.

    Steps along the logarithms of size and change, held between what was too small and what was too large.
    """
    size, below, above = min(1.0, most), 0.0, most
    known: list[tuple[float, float]] = []
    for _ in range(TRIES):
        found = change(size)
        if found is not None and abs(found / target - 1.0) < CLOSE:
            return size
        if found is not None and found < target:
            if size >= most:
                return None
            below = size
        else:
            above = min(above, size)
        if found is not None and found > UNSEEN:
            known.append((float(np.log(size)), float(np.log(found))))
        size = _next(known, target, size, below, above, found is None)
    return None


def _next(
    known: list[tuple[float, float]], target: float, size: float, below: float, above: float, lost: bool
) -> float:
    """The next size to try."""
    if lost:
        return float(np.sqrt(below * size)) if below > 0.0 else size / FURTHER
    if not known:
        return min(size * FURTHER, above)
    slope = 1.0
    if len(known) > 1:
        (x0, y0), (x1, y1) = known[-2:]
        slope = float(np.clip((y1 - y0) / (x1 - x0), 0.3, 5.0)) if x1 != x0 else 1.0
    x, y = known[-1]
    wanted = float(np.exp(x + np.clip((np.log(target) - y) / slope, -np.log(FURTHER), np.log(FURTHER))))
    if below < wanted < above:
        return wanted
    if wanted >= above and above > size:
        return above
    return float(np.sqrt(max(below, 1e-3 * above) * above))
