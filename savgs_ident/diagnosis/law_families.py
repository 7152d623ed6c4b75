"""Which families a learned law is of: to first order about its fit, and the likely ones fitted by themselves.

The functions of all families but one are taken away from the fit of all functions of a port
(:mod:`savgs_ident.diagnosis.learning`), and one by one those of the family that are not needed; what is left is
fitted on the nonlinear plant, and what that fit does not need is taken away again. The functions of each family are
taken away from all, too, which says how well it can be spared.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.status import Status
from savgs_ident.core.threads import in_parallel
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.effects.base import Family, Port
from savgs_ident.effects.learned_functions import (
    coefficients_at,
    coefficients_of,
    functions_at,
    interactions_at,
)
from savgs_ident.inference.find_map import SEARCH_LEVEL, find_map, find_map_again
from savgs_ident.inference.laplace import (
    LinearisedOptimum,
    attainable_evidence,
    linearised_optimum,
    log_evidence,
)
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.likelihood import NoiseScales
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import bounds_of


class FittedFunctions(NamedTuple):
    """Functions fitted on the nonlinear plant: all of a port, or some of one family alone.

    Attributes:
        term: their coefficients as a search takes them.
        mode: the best point.
        log_prior: log prior probability that these of the family are needed; 0 for all functions.
        only: the family; None for all functions.
    """

    term: Term
    mode: LaplaceFit
    log_prior: float = 0.0
    only: Family | None = None

    @property
    def functions(self) -> tuple[str, ...]:
        """Names of their coefficients."""
        return tuple(each.name for each in self.term.amplitudes)

    @property
    def weight(self) -> float:
        """Their log evidence, with the prior probability of the functions."""
        return self.mode.evidence + self.log_prior

    def attainable(self, search: Search, constants: DecisionConstants) -> float:
        """The log evidence that some of them can hardly exceed: that of all at their best, if that was found."""
        if self.mode.status is Status.HOPELESS:
            return -np.inf
        if not self.mode.status.ok:
            return np.inf
        return _FirstOrder(search, self.mode).attainable(self.functions, max(constants.family_widths))

    def gone_on(self, search: Search, least: float, constants: DecisionConstants) -> "FittedFunctions":
        """The fit to its end, or until neither all of them nor some can come to a log evidence of ``least``."""
        if self.mode.status is not Status.MAX_ITERATIONS:
            return self
        steps = constants.learned_steps - constants.first_learned_steps
        free, bound = self.functions if self.only is None else (), least - self.log_prior
        mode = find_map_again(search, (self.term,), self.mode, steps, bound, free, SEARCH_LEVEL)
        return self._replace(mode=mode) if mode.solved else self


class FamilyAlone(NamedTuple):
    """Functions of one family without those of the others, and without those that are not needed.

    Attributes:
        functions: names of their coefficients.
        width: of their prior, over that of all functions.
        weight: log evidence, with the log prior probability that these functions of the family are needed.
        log_prior: that.
        start: the best point [SI], by name.
    """

    functions: tuple[str, ...]
    width: float
    weight: float
    log_prior: float
    start: Mapping[str, float]


class _Without(NamedTuple):
    """The log evidence of a fit without some coordinates, and its noise scales."""

    log_evidence: float
    scales: NoiseScales


@dataclass(frozen=True)
class _FirstOrder:
    """Fits without some coordinates, to first order about a fit: its slopes serve them all."""

    search: Search
    mode: LaplaceFit

    @cached_property
    def _missed(self) -> NDArray[np.float64]:
        return self.search.missed(self.mode.prediction)

    @cached_property
    def _slopes(self) -> NDArray[np.float64]:
        return self.search.turned(self.mode.slopes)

    def _kept(self, gone: Collection[str]) -> NDArray[np.bool_]:
        return np.array([each.name not in gone for each in self.mode.coordinates])

    def _wider(self, functions: Collection[str], width: float) -> NDArray[np.float64]:
        return np.array([width if each.name in functions else 1.0 for each in self.mode.coordinates])

    def _optimum(
        self, kept: NDArray[np.bool_], wider: NDArray[np.float64], near: NoiseScales | None = None
    ) -> LinearisedOptimum:
        without = self._missed + self._slopes[:, ~kept] @ self.mode.x[~kept]
        lower, upper = (each[kept] / wider[kept] for each in bounds_of(self.mode.coordinates))
        slopes, here = self._slopes[:, kept] * wider[kept], self.mode.x[kept] / wider[kept]
        near, rows = near or self.mode.noise_scales, self.search.rows
        return linearised_optimum(rows, without, slopes, here, (lower, upper), scales=near)

    def without(
        self,
        gone: Collection[str],
        functions: Collection[str] = (),
        width: float = 1.0,
        near: NoiseScales | None = None,
    ) -> "_Without":
        """The best point with the coordinates that are ``gone`` at zero, looked for from the scales ``near`` it.

        The coefficients of the ``functions`` have a prior that is ``width`` times as wide as in the fit.
        """
        kept = self._kept(gone)
        top = self._optimum(kept, self._wider(functions, width), near)
        coordinates = (each for each, keep in zip(self.mode.coordinates, kept, strict=True) if keep)
        return _Without(log_evidence(top.value, top.precision, tuple(coordinates)), top.noise_scales)

    def attainable(self, functions: Collection[str], width: float) -> float:
        """The log evidence that fewer of the ``functions`` cannot exceed, if each may be ``width`` times as large."""
        everything = self._kept(())
        top = self._optimum(everything, self._wider(functions, width))
        free = ~self._kept(functions)
        return attainable_evidence(top.value, top.x, top.precision, self.mode.coordinates, free)

    def best(self, gone: Collection[str], functions: Collection[str], width: float) -> dict[str, float]:
        """The best point [SI] there, by name."""
        kept, wider = self._kept(gone), self._wider(functions, width)
        x = np.zeros(kept.size)
        x[kept] = self._optimum(kept, wider).x * wider[kept]
        there = zip(self.mode.coordinates, x, kept, strict=True)
        return {each.name: each.value(float(x)) for each, x, keep in there if keep}


def families_alone(
    search: Search, mode: LaplaceFit, port: Port, constants: DecisionConstants
) -> dict[Family, FamilyAlone]:
    """Each family's functions without those of the others, to first order about the fit."""
    about, seen = _FirstOrder(search, mode), {each.name for each in mode.coordinates}
    families = dict.fromkeys(each.family for each in functions_at(port))
    mine = {
        family: tuple(name for name in coefficients_of(port, family) if name in seen) for family in families
    }
    some = [family for family in families if mine[family]]
    needed = in_parallel(lambda each: _needed(about, port, mine[each], mine[each], constants), some)
    return dict(zip(some, needed, strict=True))


def families_fitted(
    search: Search,
    every: FittedFunctions,
    port: Port,
    alone: Mapping[tuple[str, ...], float],
    start: Mapping[str, float],
    least: float,
    constants: DecisionConstants,
) -> tuple[dict[Family, float], list[FittedFunctions]]:
    """The log weight of each family alone, and the likely ones fitted by themselves.

    More than one: to first order about all functions together the families are not known well enough to take the
    first. Those functions that could be all of a law are looked for ``alone``, too, with priors so many times as
    wide, from ``start`` [SI]. What cannot come to a log weight of ``least``, or near to all functions, is given up.
    """
    found = families_alone(search, every.mode, port, constants)
    near = max(least, every.weight - constants.alarm_log_odds)

    def among(family: Family, starts: Sequence[FamilyAlone]) -> list[FittedFunctions]:
        solved = list[FittedFunctions]()
        for each in starts:
            if {*each.functions} in ({*fit.functions} for fit in solved):
                continue
            bound = max([near, *(fit.weight - constants.alarm_log_odds for fit in solved)])
            one = _fitted(search, every, port, family, each, bound, constants)
            solved += [] if one is None else [one]
        return solved

    def fitted(family: Family) -> list[FittedFunctions]:
        first = found[family]
        groups = _by_themselves(every.term, port, family, alone, start, constants)
        # From elsewhere only if nothing came of the first.
        same = [each for some in groups for each in some if {*each.functions} == {*first.functions}]
        others = [some for some in groups if {*some[0].functions} != {*first.functions}]
        return [
            fit for some in in_parallel(partial(among, family), [[first, *same], *others]) for fit in some
        ]

    weights = {family: each.weight for family, each in found.items()}
    likely = sorted(found, key=lambda family: -weights[family])[: constants.likely_families]
    fits = dict(zip(likely, in_parallel(fitted, likely), strict=True))
    weights |= {family: max(each.weight for each in some) for family, some in fits.items() if some}
    return weights, [each for some in fits.values() for each in some]


def _seen_of(term: Term, port: Port, family: Family) -> tuple[str, ...]:
    """The functions of a family that the data see."""
    seen = {each.name for each in term.amplitudes}
    return tuple(name for name in coefficients_of(port, family) if name in seen)


def _by_themselves(
    term: Term,
    port: Port,
    family: Family,
    alone: Mapping[tuple[str, ...], float],
    start: Mapping[str, float],
    constants: DecisionConstants,
) -> list[list[FamilyAlone]]:
    """Those functions of a family that could be all of it, each with its starts; first the most, which take longest.

    Where their prior is wider or narrower than beside all others, each is a start: the first step from the wider one
    may leave the range in which the plant is solved, and the narrower one may promise too little.
    """
    mine = _seen_of(term, port, family)
    return [
        [
            FamilyAlone(group, each, -np.inf, _log_prior(group, mine, port, constants), start)
            for each in dict.fromkeys((1.0, alone[group]))
        ]
        for group in sorted(alone, key=len, reverse=True)
        if {*group} <= {*mine}
    ]


def _fitted(
    search: Search,
    every: FittedFunctions,
    port: Port,
    family: Family,
    found: FamilyAlone,
    least: float,
    constants: DecisionConstants,
) -> FittedFunctions | None:
    """The functions of a family by themselves at their best; None where that has no solution.

    What is needed to first order about all functions together may be more than what is needed about their own fit,
    and their prior another one. What cannot come to a log weight of ``least`` is given up.
    """
    term, mine, best = every.term, _seen_of(every.term, port, family), None
    near = every.mode.prediction.warm_start
    while True:
        term = _some_of(term, found)
        mode = find_map(search, (term,), found.start, near, 1)
        steps, bound = constants.learned_steps - 1, least - found.log_prior
        if mode.solved:
            mode = find_map_again(search, (term,), mode, steps, bound, level=SEARCH_LEVEL)
        fitted = FittedFunctions(term, mode, found.log_prior, family)
        if (
            mode.status is Status.HOPELESS
            or not mode.solved
            or (best is not None and fitted.weight <= best.weight)
        ):
            return best
        best, near = fitted, mode.prediction.warm_start
        found = _needed(_FirstOrder(search, mode), port, mine, fitted.functions, constants)
        if len(found.functions) == len(fitted.functions) and found.width == 1.0:
            return best


def _some_of(term: Term, found: FamilyAlone) -> Term:
    """The term of all functions with those of a family alone."""
    kept = [each for each in term.amplitudes if each.name in found.functions]
    return replace(term, amplitudes=tuple(replace(each, scale=found.width * each.scale) for each in kept))


def families_spared(search: Search, mode: LaplaceFit, port: Port) -> dict[Family, float]:
    """Minus the log evidence of the law without the functions of each family."""
    about = _FirstOrder(search, mode)
    gone = {each.family: coefficients_of(port, each.family) for each in functions_at(port)}
    return {family: -about.without(names).log_evidence for family, names in gone.items()}


def _log_prior(
    functions: Collection[str], family: tuple[str, ...], port: Port, constants: DecisionConstants
) -> float:
    """Log prior probability that of a ``family`` at a port these ``functions`` are needed and no others."""
    interactions = interactions_at(port)
    priors = {
        name: constants.interaction_prior if name in interactions else constants.function_prior
        for name in family
    }
    return sum(log(each if name in functions else 1.0 - each) for name, each in priors.items())


def _needed(
    about: _FirstOrder,
    port: Port,
    family: tuple[str, ...],
    first: tuple[str, ...],
    constants: DecisionConstants,
) -> FamilyAlone:
    """Those of a family's functions, among the ``first``, without which the law is less probable; one at least."""
    of_all = set(coefficients_at(port))

    def alone(functions: tuple[str, ...], width: float, near: NoiseScales | None) -> _Weighed:
        log_prior = _log_prior(functions, family, port, constants)
        found = about.without(of_all.difference(functions), functions, width, near)
        return _Weighed(found.log_evidence + log_prior, functions, width, log_prior, found.scales)

    def at_its_width(functions: tuple[str, ...], near: NoiseScales | None = None) -> _Weighed:
        return _heaviest(alone(functions, width, near) for width in constants.family_widths)

    # Of functions that do nearly the same, one alone is needed: the best may lie beyond worse ones.
    found = [at_its_width(first)]
    while len(found[-1].functions) > 1:
        _, left, width, _, near = found[-1]
        fewer = (tuple(each for each in left if each != gone) for gone in left)
        found.append(_heaviest(alone(each, width, near) for each in fewer))
    # One alone that calibration nearly takes up is far larger than all of them together seem to be.
    found += [at_its_width((name,), found[-1].scales) for name in first]
    weight, functions, width, log_prior, _ = at_its_width(_heaviest(found).functions)
    start = about.best(of_all.difference(functions), functions, width)
    return FamilyAlone(functions, width, weight, log_prior, start)


class _Weighed(NamedTuple):
    """Functions of one family alone, by their weight; see :class:`FamilyAlone`."""

    weight: float
    functions: tuple[str, ...]
    width: float
    log_prior: float
    scales: NoiseScales


def _heaviest(some: Iterable[_Weighed]) -> _Weighed:
    return max(some, key=lambda each: each.weight)
