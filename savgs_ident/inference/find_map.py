"""The maximum a posteriori of a hypothesis on the true, nonlinear plant.

One search (:func:`find_map`) serves the hypotheses of a diagnosis and the mode and the profiles of a posterior. A
step goes to the best point of the linearisation (:func:`savgs_ident.inference.laplace.linearised_optimum`), so that a
hypothesis that misses weighs its rows by what it can explain from the first step on; it is halved until the density
rises. At the end stands the evidence by Laplace's method.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress
from savgs_ident.core.status import Status
from savgs_ident.core.threads import in_parallel, side_by_side
from savgs_ident.inference.laplace import (
    LinearisedOptimum,
    attainable_evidence,
    is_hopeless,
    linearised_optimum,
    log_evidence,
    precision_of,
)
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likelihood import noise_scales
from savgs_ident.inference.observations import Prediction, Term
from savgs_ident.inference.prior import bounds_of, slopes_at, values_at

Array = NDArray[np.float64]

STEPS = 15
"""Most steps to a mode."""

LAST_STEPS = 40
"""The same where the mode is one of the best: as many as a fit by least squares may take."""

HALVINGS = 8
"""Most halvings of a step that does not rise: what shapes a law may curve the density a hundred times as much as the
slopes say."""

LEVEL = 0.1
"""Rise of the log density below which the mode is found: that which a step promises, or which it finds."""

SEARCH_LEVEL = 0.5
"""The same where one of many hypotheses is looked for: those that are compared are refined (:func:`refine`)."""

ROUGH = 2.0
"""Rise that is promised, but not found, up to which a mode is as good: friction makes the density rough."""


class _Point(NamedTuple):
    """A point of a search.

    Attributes:
        x: its coordinates [1], (n,).
        prediction: the plant there.
        value: log density of rows and prior there.
        status: how the search ended there; None where it goes on.
    """

    x: Array
    prediction: Prediction
    value: float
    status: Status | None = None


class _Ascent:
    """Steps to the mode of a hypothesis."""

    def __init__(
        self,
        search: Search,
        terms: tuple[Term, ...],
        held: Mapping[str, float],
        level: float = LEVEL,
        least: float = -np.inf,
        free: Collection[str] = (),
    ):
        self._search, self._held, self._level = search, held, level
        self._least, self._free = least, frozenset(free)
        self._names = tuple(term.name for term in terms)
        self._coordinates = search.plant.nuisances + tuple(c for term in terms for c in term.coordinates)

    def start(self, values: Mapping[str, float], warm_start: Any) -> _Point:
        """The point at ``values`` [SI], at the centre of what is not given, within the bounds."""
        return self._at(self._coordinates_at(values), warm_start)

    def again(self, fit: LaplaceFit) -> _Point:
        """The point of a fit of the same plant with the same terms, which is not solved again."""
        return self._valued(fit.x, fit.prediction)

    def density(self, values: Mapping[str, float], warm_start: Any) -> float:
        """Log density of rows and prior at ``values`` [SI], within the bounds; minus infinity without a solution."""
        return self.start(values, warm_start).value

    def step(self, point: _Point) -> _Point:
        """The point one step on; the same, with the status, where there is no step that rises."""
        point = self._sloped(point)
        if not point.prediction.solved or point.status is not None:
            return point
        bounds = tuple(np.where(self._fixed, point.x, each) for each in bounds_of(self._coordinates))
        search, here = self._search, point.prediction
        slopes = search.turned(here.slopes * slopes_at(self._coordinates, point.x))
        accuracy = min(1e-3, 0.1 * self._level)
        top = linearised_optimum(
            search.rows, search.missed(here), slopes, point.x, (bounds[0], bounds[1]), accuracy
        )
        promised = top.value - point.value
        if promised < self._level:
            return point._replace(status=Status.CONVERGED if top.converged else Status.STALLED)
        if is_hopeless(self._attainable(top) - promised, promised, self._least):
            return point._replace(status=Status.HOPELESS)
        there = self._at(top.x, here.warm_start)
        if there.value > point.value:
            done = there.value < point.value + self._level and promised < ROUGH
            return there._replace(status=Status.CONVERGED) if done else there
        for share in self._shares(promised):
            there = self._at(point.x + share * (top.x - point.x), here.warm_start)
            if there.value > point.value:
                little = there.value < point.value + self._level
                return there._replace(status=Status.CONVERGED) if little else there
        return point._replace(status=Status.CONVERGED if promised < ROUGH else Status.STALLED)

    def _attainable(self, top: LinearisedOptimum) -> float:
        free = np.array([each.name in self._free for each in self._coordinates], bool)
        return attainable_evidence(top.value, top.x, top.precision, self._coordinates, free)

    def _shares(self, promised: float) -> list[float]:
        """Shares of a step to try in its place: those that to first order rise by as much as counts."""
        every = (0.5**halving for halving in range(1, HALVINGS))
        return [share for share in every if share * (2.0 - share) * promised > self._level]

    def mode(self, point: _Point, steps: int, progress: Progress | None = None) -> LaplaceFit:
        """The fit where at most so many further steps lead to."""
        for count in range(1, steps + 1):
            if point.status is not None or not point.prediction.solved:
                break
            if progress:
                progress(f"looking for the mode, step {count}: log density {point.value:.2f}")
            point = self.step(point)
        return self._fit(point)

    def _coordinates_at(self, values: Mapping[str, float]) -> Array:
        given = {**values, **self._held}
        x = [c.at(given[c.name]) if c.name in given else 0.0 for c in self._coordinates]
        return np.clip(x, *bounds_of(self._coordinates))

    @property
    def _fixed(self) -> NDArray[np.bool_]:
        return np.array([each.name in self._held for each in self._coordinates], bool)

    def _at(self, x: Array, warm_start: Any) -> _Point:
        wanted = [each.name for each in self._coordinates]
        found = self._search.plant.predict(self._names, values_at(self._coordinates, x), wanted, warm_start)
        if found.solved and not np.isfinite(found.rows).all():
            found = replace(found, status=Status.NOT_FINITE)
        return self._valued(x, found)

    def _sloped(self, point: _Point) -> _Point:
        """The point, which is not solved where its slopes are not finite."""
        if not point.prediction.solved or np.isfinite(point.prediction.slopes).all():
            return point
        return point._replace(prediction=replace(point.prediction, status=Status.NOT_FINITE), value=-np.inf)

    def _valued(self, x: Array, found: Prediction) -> _Point:
        if not found.solved:
            return _Point(x, found, -np.inf)
        scales = noise_scales(self._search.rows, self._search.missed(found))
        return _Point(x, found, scales.value - 0.5 * float(x @ x))

    def _fit(self, point: _Point) -> LaplaceFit:
        point = self._sloped(point)
        search, coordinates, here = self._search, self._coordinates, point.prediction
        slopes = here.slopes * slopes_at(coordinates, point.x)
        scales = noise_scales(search.rows, search.missed(here))
        precision = precision_of(search.turned(slopes), scales.spread)
        evidence = log_evidence(point.value, precision, coordinates) if here.solved else -np.inf
        return LaplaceFit(
            self._names,
            coordinates,
            point.x,
            here,
            slopes,
            scales,
            point.value,
            precision,
            evidence,
            point.status or Status.MAX_ITERATIONS if here.solved else here.status,
        )


def find_map(
    search: Search,
    terms: tuple[Term, ...],
    start: Mapping[str, float],
    warm_start: Any,
    steps: int = STEPS,
    level: float = LEVEL,
    held: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> LaplaceFit:
    """The mode of the baseline with ``terms`` from ``start`` (SI, centres where not given).

    The parameters ``held`` (SI, by name) stay where they are said to be. The mode is found where a step promises, or
    a halved one finds, a rise of less than ``level``. ``progress`` is called with the density at every step.
    """
    ascent = _Ascent(search, terms, held or {}, level)
    return ascent.mode(ascent.start(start, warm_start), steps, progress)


def find_map_again(
    search: Search,
    terms: tuple[Term, ...],
    fit: LaplaceFit,
    steps: int = STEPS,
    least: float = -np.inf,
    free: Collection[str] = (),
    level: float = LEVEL,
) -> LaplaceFit:
    """The mode from a ``fit`` of the same plant with the same terms: to other data, to other rows, or not at its end.

    What the plant does there is known. The search ends where neither it nor one with fewer of the ``free``
    coordinates can come to a log evidence of ``least``.
    """
    ascent = _Ascent(search, terms, {}, level, least, free)
    return ascent.mode(ascent.again(fit), steps)


def find_map_from_both(
    search: Search,
    terms: tuple[Term, ...],
    start: Mapping[str, float],
    warm_start: Any,
    steps: int = STEPS,
    least: float = -np.inf,
    free: Collection[str] = (),
) -> LaplaceFit:
    """The mode of the baseline with ``terms``, from ``start`` or from the plant as it was given.

    What calibration makes of a plant that lacks something may be so far from it that no step leads back. The search
    goes on from where one step leads higher, and ends where neither it nor one with fewer of the ``free`` coordinates
    can come to a log evidence of ``least``. What ``start`` says of the terms holds for both.
    """
    ascent, given = _Ascent(search, terms, {}, SEARCH_LEVEL, least, free), search.given
    # The first alone: two at a time would compile the same program twice.
    begun = ascent.start(start, warm_start)
    if given is None:
        return ascent.mode(ascent.step(begun), steps - 1)
    one, other = side_by_side(
        lambda: ascent.step(begun),
        lambda: ascent.step(ascent.start({**start, **given.values}, given.warm_start)),
    )
    return ascent.mode(one if one.value >= other.value else other, steps - 1)


def densest(
    search: Search,
    terms: tuple[Term, ...],
    starts: Sequence[Mapping[str, float]],
    warm_start: Any,
) -> Mapping[str, float]:
    """The one of some points (SI) of the baseline with ``terms`` at which the log density is greatest.

    A mode of its own may stand at each, as about every natural frequency of what swings.
    """
    ascent = _Ascent(search, terms, {})

    def density(start: Mapping[str, float]) -> float:
        return ascent.density(start, warm_start)

    # The first alone: two at a time would compile the same program twice.
    densities = [*map(density, starts[:1]), *in_parallel(density, starts[1:])]
    return starts[int(np.argmax(densities))]


def find_map_from_several(
    search: Search,
    terms: tuple[Term, ...],
    starts: Sequence[Mapping[str, float]],
    warm_start: Any,
    first: int,
    going_on: int,
) -> LaplaceFit:
    """The best mode of the baseline with ``terms`` from many starts [SI].

    After the ``first`` steps from each, so many as are ``going_on`` are followed to their end: the highest ones.
    """
    ascent = _Ascent(search, terms, {}, SEARCH_LEVEL)

    def begun(start: Mapping[str, float]) -> _Point:
        point = ascent.start(start, warm_start)
        for _ in range(first):
            point = ascent.step(point)
        return point

    highest = sorted(in_parallel(begun, starts), key=lambda each: -each.value)[:going_on]
    modes = in_parallel(lambda point: ascent.mode(point, STEPS - first), highest)
    return max(modes, key=lambda mode: mode.evidence)


def refine(search: Search, mode: LaplaceFit, terms: tuple[Term, ...]) -> LaplaceFit:
    """The mode again, with the plant made as precise there as it can be."""
    warm_start = search.plant.refined(mode.terms, mode.values, mode.prediction.warm_start)
    return replace(find_map(search, terms, mode.values, warm_start, LAST_STEPS), precise=True)
