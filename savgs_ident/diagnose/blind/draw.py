"""The secret draw: which rig stands there in a trial.

Its parameters are off the sheet by their tolerances, those that are to be identified by a tenth. Then comes
nothing, an effect, two at once, or one that is removed from the catalogue; each so large that the response
changes by 3 to 25 %, and such that it stands out of what calibration and tolerances can do
(:mod:`savgs_ident.diagnose.blind.hiding`). What does not is drawn again. An effect that is removed must stand
out of what is left in the catalogue, too, and each of two out of all others: nobody could name them else.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from savgs_ident.core.errors import InputError
from savgs_ident.diagnose.blind.answer import Answer, Drawn
from savgs_ident.diagnose.blind.bench import Bench
from savgs_ident.diagnose.blind.drawing import STANDS_OUT, TOLD_APART, Drawing, Present, drawing_of
from savgs_ident.effects.registry import CATALOGUE

OFF = 0.1
"""Relative standard deviation of parameters that are to be identified and have no tolerance."""

TWINS = (frozenset({"accel_gain", "accel_tilt"}),)
"""Effects that do exactly the same: if one is removed from the catalogue, so are the others."""

ATTEMPTS = 60
"""So often it is drawn again."""


@dataclass(frozen=True)
class Shares:
    """How often what is drawn, in any unit."""

    none: float = 20.0
    effect: float = 50.0
    two: float = 15.0
    unknown: float = 15.0

    def __post_init__(self) -> None:
        weights = (self.none, self.effect, self.two, self.unknown)
        if not (np.isfinite(weights).all() and min(weights) >= 0.0 and sum(weights) > 0.0):
            raise InputError(
                f"the shares are {', '.join(f'{each:g}' for each in weights)}",
                source="--shares",
                remedy="give four numbers, none below 0, not all 0",
            )

    def draw(self, random: np.random.Generator) -> Drawn:
        """What a trial's rig has beyond its model."""
        weights = np.array([self.none, self.effect, self.two, self.unknown])
        kinds: tuple[Drawn, ...] = ("none", "effect", "two", "unknown")
        return kinds[int(random.choice(4, p=weights / weights.sum()))]


def draw_rig(bench: Bench, random: np.random.Generator) -> dict[str, float]:
    """Parameters of the rig [SI] that are not those of the sheet: normal about them, within their bounds."""
    drawn = {}
    for each in bench.rig.parameters.entries:
        spread = each.tolerance or (OFF * abs(each.value) if each.name in bench.free else 0.0)
        if spread == 0.0:
            continue
        value = each.value + spread * random.standard_normal()
        while not each.lower <= value <= each.upper:
            value = each.value + spread * random.standard_normal()
        drawn[each.name] = float(value)
    return drawn


def draw_answer(bench: Bench, shares: Shares, number: int, random: np.random.Generator) -> Answer:
    """The truth of a trial; the same for the same state of ``random``.

    Raises :class:`InputError` if nothing that can be judged was drawn in :data:`ATTEMPTS` attempts.
    """
    kind = shares.draw(random)
    drawing = drawing_of(bench, draw_rig(bench, random))
    while drawing is None:
        drawing = drawing_of(bench, draw_rig(bench, random))
    for _ in range(ATTEMPTS):
        answer = _draw(kind, drawing, number, random)
        if answer is not None:
            return answer
    raise InputError(
        f"nothing of kind '{kind}' that can be judged was drawn",
        source=f"trial {number}",
        remedy="name another --seed",
    )


def _draw(kind: Drawn, drawing: Drawing, number: int, random: np.random.Generator) -> Answer | None:
    """An answer of a kind; None if what was drawn cannot be judged."""
    names = [name for name in CATALOGUE if name not in drawing.bench.baseline]
    many = {"none": 0, "effect": 1, "two": 2, "unknown": 1}[kind]
    chosen = [str(name) for name in random.choice(names, many, replace=False)]
    present = []
    for name in chosen:
        found = drawing.present(name, random)
        if found is None:
            return None
        present.append(found)
    sigmas = _sigmas(drawing, present)
    if any(sigma < STANDS_OUT for sigma in sigmas):
        return None
    twins = {twin for pair in TWINS for twin in pair if kind == "unknown" and chosen[0] in pair}
    without = tuple(sorted({*chosen, *twins})) if kind == "unknown" else ()
    # What is unknown must stand out of the catalogue as an effect must of what calibration does.
    limit = STANDS_OUT if kind == "unknown" else TOLD_APART
    imitators = {each.name: drawing.imitators(each, limit) for each in present}
    if kind != "effect" and any(set(each) - set(without) for each in imitators.values()):
        return None
    return Answer(
        number=number,
        kind=kind,
        effects=tuple(chosen),
        ports=tuple(CATALOGUE[name].port.value for name in chosen),
        changes={each.name: each.change for each in present},
        sigmas=dict(zip(chosen, sigmas, strict=True)),
        imitators=imitators[chosen[0]] if kind == "effect" else (),
        parameters={name: value for each in present for name, value in each.parameters.items()},
        rig=drawing.rig,
        without=without,
    )


def _sigmas(drawing: Drawing, present: Sequence[Present]) -> list[float]:
    """How far each effect stands out, beside the other one if there are two; 0 where there is no motion."""
    if len(present) < 2:
        return [drawing.sigma(each.response) for each in present]
    one, other = present
    given = {**drawing.rig, **one.parameters, **other.parameters}
    together = drawing.solve((one.name, other.name), given)
    if together is None:
        return [0.0, 0.0]
    return [drawing.sigma(together, other), drawing.sigma(together, one)]
