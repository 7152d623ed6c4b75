"""The secret draw: which rig stands there in a trial.

Its parameters are off the sheet by their tolerances, those that are to be identified by a tenth. Then comes nothing,
an effect, two at once, or one that is removed from the catalogue. An effect is made so large that the response
changes by 3 to 25 % (:class:`Present`). How far it stands out of what calibration and tolerances can do, and which
others of the catalogue do the same (:class:`Drawing`, by :mod:`savgs_ident.validation.lookalikes`), is noted for the
marks; nothing is drawn again because it is hard to see or easily imitated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnosis.problem import term_of
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.validation.blind_answer import STANDS_OUT, Answer, Drawn
from savgs_ident.validation.effect_size import draw_form, find_size
from savgs_ident.validation.lookalikes import (
    Hiding,
    Sensitivities,
    hiding_at,
    moved,
    rows_of,
    sensitivities_of,
    sigma_of,
    similar,
)
from savgs_ident.validation.virtual_rig import Bench, change_of, draw_rig

SMALLEST, LARGEST = 0.03, 0.25
"""Change of the response by a drawn effect, relative; drawn evenly in its logarithm."""

TOLD_APART = 5.0
"""Standard deviations from which on two effects can be distinguished."""

NUDGE = 0.02
"""Share of an effect's size by which it is changed for a slope."""


TINY = 1e-300
"""A shape's parameter is at least so much: its logarithm is a number."""


@dataclass(frozen=True)
class Present:
    """An effect of a size: its parameters [SI], its change of the response, the response with it alone.

    ``response`` is (D, 2, K) [unit of the reading].
    """

    name: str
    parameters: Mapping[str, float]
    change: float
    response: NDArray[np.complex128]

    @property
    def sizes(self) -> int:
        """How many numbers say how large it is and of which shape."""
        return 1 + len(term_of(CATALOGUE[self.name]).shapes)

    def at(self, sizes: NDArray[np.float64]) -> dict[str, float]:
        """Its parameters with the amplitudes multiplied by the first of the sizes, shapes by exp of the others.

        Within their bounds. Sizes are (k,) [1], parameters SI.
        """
        effect = CATALOGUE[self.name]
        shapes = [each.name for each in term_of(effect).shapes]
        factors = dict(zip(shapes, np.exp(sizes[1:]).tolist(), strict=True))
        found = {}
        for each in effect.parameters:
            value, null = self.parameters[each.name], effect.null.get(each.name, 0.0)
            factor = float(sizes[0]) if each.name in effect.null else factors.get(each.name, 1.0)
            found[each.name] = float(np.clip(null + factor * (value - null), each.lower, each.upper))
        return found

    @cached_property
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The sizes (k,) [1] between which no parameter leaves its bounds."""
        effect = CATALOGUE[self.name]
        shapes = [each.name for each in term_of(effect).shapes]
        lower, upper = np.full(self.sizes, -np.inf), np.full(self.sizes, np.inf)
        for each in effect.parameters:
            value, ends = self.parameters[each.name], np.array([each.lower, each.upper])
            null = effect.null.get(each.name)
            # A size of nothing remains nothing, whatever it is multiplied by.
            if null is not None and value != null:
                k, (low, high) = 0, np.sort((ends - null) / (value - null))
            elif each.name in shapes:
                k, (low, high) = 1 + shapes.index(each.name), np.log(np.maximum(ends, TINY) / value)
            else:
                continue
            lower[k], upper[k] = max(lower[k], low), min(upper[k], high)
        return lower, upper


@dataclass(frozen=True)
class Drawing:
    """A rig without the effects that are drawn for it.

    Attributes:
        bench: what it is put through.
        rig: its parameters off the sheet, SI.
        response: its response [unit of the reading], (D, 2, K).
        hiding: what can hide an effect.
        starts: its motions, by the effects with states that the model has.
    """

    bench: Bench
    rig: Mapping[str, float]
    response: NDArray[np.complex128]
    hiding: Hiding
    starts: dict[tuple[str, ...], PeriodicSolution | None] = field(default_factory=dict)

    def solve(self, names: Sequence[str], given: Mapping[str, float]) -> NDArray[np.complex128] | None:
        """The response [unit of the reading], (D, 2, K), with effects; None where a dwell has no motion."""
        solution = self._motions(names, given)
        return None if solution is None else self.bench.response(names, given, solution)

    def _motions(self, names: Sequence[str], given: Mapping[str, float]) -> PeriodicSolution | None:
        model = tuple(sorted(name for name in names if self.bench.catalogue[name].states))
        if model not in self.starts:
            self.starts[model] = self.bench.solve(model, self.rig)
        return self.bench.solve(names, given, self.starts[model])

    def present(self, name: str, random: np.random.Generator) -> Present | None:
        """An effect of a size drawn; None where no size within its bounds does that much."""
        form = draw_form(self.bench.catalogue[name], random)
        target = float(np.exp(random.uniform(np.log(SMALLEST), np.log(LARGEST))))
        found: dict[float, NDArray[np.complex128]] = {}

        def change(size: float) -> float | None:
            response = self.solve((name,), dict(self.rig) | form.at(size))
            if response is None:
                return None
            found[size] = response
            return change_of(response, self.response)

        size = find_size(change, target, form.most)
        if size is None:
            return None
        return Present(name, form.at(size), change_of(found[size], self.response), found[size])

    def sigma(self, target: NDArray[np.complex128], beside: Present | None = None) -> float:
        """How far a response stands out of what the rig can do, with the effect ``beside`` of any size and shape.

        No tolerance is broken by more than :data:`STANDS_OUT`: what does not hide within it stands out
        anyway. In standard deviations; ``target`` (D, 2, K) is in the units of the readings.
        """
        names = () if beside is None else (beside.name,)
        noise, known = self.hiding.noise, len(self.hiding.names)
        further = np.zeros(0) if beside is None else np.eye(beside.sizes)[0]

        def given_at(x: NDArray[np.float64]) -> dict[str, float]:
            return self._moved(x) | ({} if beside is None else beside.at(x[known:]))

        def miss_at(x: NDArray[np.float64]) -> NDArray[np.float64] | None:
            response = self.solve(names, given_at(x))
            return None if response is None else (rows_of(target) - rows_of(response)) / noise

        def columns_at(x: NDArray[np.float64], miss: NDArray[np.float64]) -> NDArray[np.float64]:
            columns = self._hiding_at(names, given_at(x)).columns
            for unit in np.eye(x.size)[known:]:
                nudge = NUDGE if np.all(x + NUDGE * unit <= upper) else -NUDGE
                nudged = miss_at(x + nudge * unit)
                last = np.zeros(noise.size) if nudged is None else (miss - nudged) / nudge
                columns = np.column_stack([columns, last])
            return columns

        start = np.concatenate([np.zeros(known), further])
        limit = np.array([np.inf if name in self.bench.unknown else STANDS_OUT for name in self.hiding.names])
        lower, upper = (-limit, limit) if beside is None else map(np.append, (-limit, limit), beside.bounds)
        return sigma_of(miss_at, columns_at, start, known, (lower, upper))

    def _hiding_at(self, names: Sequence[str], given: Mapping[str, float]) -> Hiding:
        """What can hide an effect elsewhere."""
        if given == self.rig:
            return self.hiding
        solution = self._motions(names, given)
        return self.hiding if solution is None else hiding_at(self.bench, names, given, solution)

    def _moved(self, x: NDArray[np.float64]) -> dict[str, float]:
        if not x[: len(self.hiding.names)].any():
            return dict(self.rig)
        table = self.bench.table
        return dict(self.rig) | {
            name: moved(table[name], self.rig.get(name, table[name].value), value)
            for name, value in zip(self.hiding.names, x.tolist(), strict=False)
        }

    def imitators(self, present: Present) -> tuple[str, ...]:
        """Effects that, of some size and shape, do the same: beside them it cannot be told apart."""
        change = rows_of(present.response) - rows_of(self.response)
        found = []
        for name, parameters in similar(self.hiding, change, self.sensitivities, present.name).items():
            effect = CATALOGUE[name]
            within = {
                each.name: float(np.clip(parameters[each.name], each.lower, each.upper))
                for each in effect.parameters
            }
            if self.sigma(present.response, Present(name, within, 0.0, self.response)) < TOLD_APART:
                found.append(name)
        return tuple(found)

    @cached_property
    def sensitivities(self) -> Sensitivities:
        """What all effects would do to the rig."""
        solution = self.starts[()]
        assert solution is not None
        return sensitivities_of(self.bench, self.rig, solution)


def drawing_of(bench: Bench, rig: Mapping[str, float]) -> Drawing | None:
    """The rig with these parameters [SI], without effects; None where a dwell has no motion."""
    solution = bench.solve((), rig)
    if solution is None:
        return None
    response = bench.response((), rig, solution)
    return Drawing(bench, rig, response, hiding_at(bench, (), rig, solution), {(): solution})


INDISTINGUISHABLE = (frozenset({"accel_gain", "accel_tilt"}),)
"""Effects that do exactly the same: if one is removed from the catalogue, so are the others."""

ATTEMPTS = 60
"""So often it is drawn again where no size of an effect gives the change that was drawn, or a dwell has no motion."""


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


def draw_answer(bench: Bench, shares: Shares, number: int, random: np.random.Generator) -> Answer:
    """The truth of a trial; the same for the same state of ``random``.

    Raises :class:`InputError` if no effect that was drawn in :data:`ATTEMPTS` attempts gives the change drawn.
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
        f"nothing of kind '{kind}' reaches the change that was drawn",
        source=f"trial {number}",
        remedy="name another --seed",
    )


def _draw(kind: Drawn, drawing: Drawing, number: int, random: np.random.Generator) -> Answer | None:
    """An answer of a kind; None if no size of what was drawn gives its change, or a dwell has no motion."""
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
    if sigmas is None:
        return None
    alike = {each for pair in INDISTINGUISHABLE for each in pair if kind == "unknown" and chosen[0] in pair}
    without = tuple(sorted({*chosen, *alike})) if kind == "unknown" else ()
    imitators = {other for each in present for other in drawing.imitators(each)}
    return Answer(
        number=number,
        kind=kind,
        effects=tuple(chosen),
        ports=tuple(CATALOGUE[name].port.location for name in chosen),
        changes={each.name: each.change for each in present},
        sigmas=dict(zip(chosen, sigmas, strict=True)),
        imitators=tuple(sorted(imitators - {*chosen, *without})),
        parameters={name: value for each in present for name, value in each.parameters.items()},
        rig=drawing.rig,
        without=without,
    )


def _sigmas(drawing: Drawing, present: Sequence[Present]) -> list[float] | None:
    """How far each effect stands out, beside the other one if there are two; None where there is no motion."""
    if len(present) < 2:
        return [drawing.sigma(each.response) for each in present]
    one, other = present
    given = {**drawing.rig, **one.parameters, **other.parameters}
    together = drawing.solve((one.name, other.name), given)
    if together is None:
        return None
    return [drawing.sigma(together, other), drawing.sigma(together, one)]
