"""Flexible members as hypotheses: a learned law at a port, fitted on the true, nonlinear plant.

Localisation learns a law to first order about the baseline. Here the same functions of what the port sees become part
of the model (:mod:`savgs_ident.effects.learned`), and their coefficients are fitted beside the baseline's own
parameters, as those of any effect: with a prior, a null and an evidence. So the law can be weighed against the
catalogue's formulas, solved, simulated and exported.

Which family the law is of follows from the fit: its functions of all other families are taken away, to first order
about the fit, and one by one those of the family that are not needed; what remains is weighed. The likely families
are fitted again by themselves; where the functions of one are more probable than all, the law is made of them.

How large coefficients may be is unknown before the data: their prior is one of several widths, first the one that is
the most probable to first order about the baseline, for each family then the one that is so about the fit.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import log
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.diagnosis.held_out import HeldOut, hold_out
from savgs_ident.diagnosis.localisation import widths_of
from savgs_ident.diagnosis.problem import AbstractProblem, term_of
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family, Port, PortKind
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import learned_effect
from savgs_ident.effects.learned_functions import (
    coefficients_at,
    coefficients_of,
    functions_at,
    interactions_at,
    what_gives,
)
from savgs_ident.inference.find_map import LaplaceFit, Search, Start, find_map, find_map_from_both, search_of
from savgs_ident.inference.laplace import linearised_optimum, log_evidence
from savgs_ident.inference.observations import Data, Term
from savgs_ident.inference.prior import Linear, bounds_of


@dataclass(frozen=True)
class LearnedLaw:
    """A law at its best, beside the baseline.

    Attributes:
        name: of the effect.
        port: where it acts.
        term: its coefficients as a search takes them.
        problem: the baseline with the law as its only candidate.
        search: that, and the data.
        mode: the best point of both.
        spans: the range of the port's signals that it knows, by name, SI.
        families: log weight of the functions of each family alone; of a law that needs several families, minus the
            log evidence without them, to first order about the best point.
        log_prior: log prior probability of its functions, if they are some of a family; 0 for all functions.
        only: the family of all its functions; None where it has several.
    """

    name: str
    port: Port
    term: Term
    problem: AbstractProblem
    search: Search
    mode: LaplaceFit
    spans: Mapping[str, float]
    families: Mapping[Family, float]
    log_prior: float
    only: Family | None

    @property
    def effect(self) -> Effect:
        """The law as an effect of a model."""
        return self.problem.catalogue[self.name]

    @property
    def units(self) -> dict[str, str]:
        """The coefficients of all its functions, those that it does not have among them, with their units."""
        coefficients = coefficients_at(self.port)
        return {each.name: each.unit for each in self.effect.parameters if each.name in coefficients}

    @property
    def values(self) -> dict[str, float]:
        """All its numbers, and those of the plant that were fitted beside it, SI."""
        return dict.fromkeys(self.units, 0.0) | self.mode.values | dict(self.spans)

    @property
    def identified(self) -> float:
        """How many coefficients the data identify: the share of each one's prior variance that they took away."""
        coefficients = {each.name for each in self.term.amplitudes}
        mine = np.array([each.name in coefficients for each in self.mode.coordinates])
        return float(np.sum(1.0 - np.diag(self.mode.covariance())[mine]))

    @property
    def family(self) -> Family:
        """The family that explains most, or can be spared least."""
        return self.only or max(self.families, key=lambda family: self.families[family])

    def held_out(self, constants: DecisionConstants = DEFAULTS) -> HeldOut:
        """What it predicts of tests left out."""
        return hold_out(self.search, self.mode, (self.term,), constants)


def learn(
    problem: AbstractProblem,
    data: Data,
    base: LaplaceFit,
    port: Port,
    constants: DecisionConstants = DEFAULTS,
    given: Start | None = None,
) -> LearnedLaw | None:
    """The law at a port; ``base`` is the recalibrated baseline. None where nothing can be learned.

    It is looked for from there and from the plant as ``given``. Nothing can be learned at a port without learned law,
    where the plant with one has no solution, or where the law is impossible.
    """
    spans = problem.learned_spans(port, base.values, base.prediction.warm_start)
    if spans is None:
        return None
    effect = learned_effect(port)
    there = {name: each for name, each in problem.catalogue.items() if name in problem.baseline}
    table = ParameterTable(effect.parameters).with_values(spans)
    mine = replace(
        problem,
        parameters=merge_parameters(problem.parameters, table),
        catalogue={**there, effect.name: effect},
    ).uncorrected()
    search, names = search_of(mine, data, given), coefficients_at(port)
    start = base.prediction.warm_start
    there_now = mine.predict((effect.name,), base.values, names, start)
    if not there_now.solved:
        return None
    shapes = tuple(each for each in term_of(effect, constants).shapes if each.name not in spans)
    blank = Term(effect.name, port.location, (), shapes)
    columns = dict(zip(names, there_now.slopes.T, strict=True))
    term = _with_amplitudes(blank, effect, search, base, columns, constants)
    mode = find_map_from_both(search, (term,), base.values, there_now.warm_start, constants.learned_steps)
    if not mode.solved:
        return None
    best, families = _most_probable(search, term, mode, port, base, constants)
    law = LearnedLaw(
        name=effect.name,
        port=port,
        term=best.term,
        problem=mine,
        search=search,
        mode=best.mode,
        spans=spans,
        families=families,
        log_prior=best.log_prior,
        only=best.only,
    )
    return None if _is_impossible(law) else law


def _is_impossible(law: LearnedLaw) -> bool:
    """Whether what gives way moves against its load: no part does that by itself, however well it fits."""
    there = [each.port.name for name, each in law.problem.catalogue.items() if name != law.name]
    if law.port.kind is not PortKind.SERIES or law.port.name in there:
        return False
    n = np.linspace(-1.0, 1.0, 201)
    columns = np.stack(what_gives(jnp.asarray(n), jnp.asarray(n), jnp.zeros(n.size)))
    return float([law.values[name] for name in law.units] @ columns @ n) < 0.0


def _with_amplitudes(
    term: Term,
    effect: Effect,
    search: Search,
    base: LaplaceFit,
    columns: Mapping[str, NDArray[np.float64]],
    constants: DecisionConstants,
) -> Term:
    """The term with coefficients whose prior is as wide as to first order about the baseline explains most.

    ``columns`` are the change of the rows (m,) per unit of each, by name; what the data hardly see is left out.
    """
    size = {name: float(np.linalg.norm(column)) for name, column in columns.items()}
    least = constants.least_function_share * max(size.values())
    seen = [name for name in columns if size[name] > least]
    widths = widths_of(search, base, np.stack([columns[name] for name in seen], axis=1), constants)
    units = {each.name: each.unit for each in effect.parameters}
    amplitudes = tuple(
        Linear(name, units[name], 0.0, float(width)) for name, width in zip(seen, widths, strict=True)
    )
    return replace(term, amplitudes=amplitudes)


class _FamilyAlone(NamedTuple):
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


def _some_of(term: Term, found: _FamilyAlone) -> Term:
    """The term of all functions with those of a family alone."""
    kept = [each for each in term.amplitudes if each.name in found.functions]
    return replace(term, amplitudes=tuple(replace(each, scale=found.width * each.scale) for each in kept))


class _FittedFunctions(NamedTuple):
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
    def weight(self) -> float:
        """Their log evidence, with the prior probability of the functions."""
        return self.mode.evidence + self.log_prior


def _most_probable(
    search: Search,
    term: Term,
    mode: LaplaceFit,
    port: Port,
    base: LaplaceFit,
    constants: DecisionConstants,
) -> tuple[_FittedFunctions, Mapping[Family, float]]:
    """The most probable functions of a law, and what the law's ``families`` are.

    All functions of the port, which are fitted with ``term`` and ``mode``, or those of a family that is likely.
    """
    found = _families(search, mode, port, constants)
    weights = {family: each.weight for family, each in found.items()}
    best, least = _FittedFunctions(term, mode), base.evidence + constants.alarm_log_odds
    # To first order about all functions together the families are not known well enough to take the first.
    likely = sorted(found, key=lambda family: -found[family].weight)[: constants.likely_families]
    for family in likely:
        each = found[family]
        if family is not likely[0] and each.weight <= least:
            continue
        some, near = _some_of(term, each), best.mode.prediction.warm_start
        alone = find_map(search, (some,), each.start, near, constants.learned_steps)
        if alone.solved:
            fitted = _FittedFunctions(some, alone, each.log_prior, family)
            weights[family] = fitted.weight
            best = fitted if fitted.weight > best.weight else best
    return best, weights if best.only else _spared(search, mode, port)


def _families(
    search: Search, mode: LaplaceFit, port: Port, constants: DecisionConstants
) -> dict[Family, _FamilyAlone]:
    """Each family's functions without those of the others, to first order about the fit."""
    seen = {each.name for each in mode.coordinates}
    found = {}
    for family in dict.fromkeys(each.family for each in functions_at(port)):
        mine = tuple(name for name in coefficients_of(port, family) if name in seen)
        if mine:
            found[family] = _needed(search, mode, port, mine, constants)
    return found


def _spared(search: Search, mode: LaplaceFit, port: Port) -> dict[Family, float]:
    """Minus the log evidence of the law without the functions of each family."""
    gone = {each.family: coefficients_of(port, each.family) for each in functions_at(port)}
    return {family: -_alone(search, mode, names, (), 1.0, 0.0).weight for family, names in gone.items()}


def _needed(
    search: Search, mode: LaplaceFit, port: Port, family: tuple[str, ...], constants: DecisionConstants
) -> _FamilyAlone:
    """Those of a family's functions without which the law is less probable; one at least."""
    of_all, interactions = set(coefficients_at(port)), interactions_at(port)
    priors = {
        name: constants.interaction_prior if name in interactions else constants.function_prior
        for name in family
    }

    def alone(functions: tuple[str, ...], width: float) -> _FamilyAlone:
        log_prior = sum(log(each if name in functions else 1.0 - each) for name, each in priors.items())
        return _alone(search, mode, of_all.difference(functions), functions, width, log_prior)

    def at_its_width(functions: tuple[str, ...]) -> _FamilyAlone:
        tried = (alone(functions, width) for width in constants.family_widths)
        return max(tried, key=lambda each: each.weight)

    # Of functions that do nearly the same, one alone is needed: the best may lie beyond worse ones.
    found = [at_its_width(family)]
    while len(found[-1].functions) > 1:
        left = found[-1].functions
        fewer = [alone(tuple(each for each in left if each != gone), found[-1].width) for gone in left]
        found.append(max(fewer, key=lambda each: each.weight))
    return at_its_width(max(found, key=lambda each: each.weight).functions)


def _alone(
    search: Search,
    mode: LaplaceFit,
    gone: Collection[str],
    functions: tuple[str, ...],
    width: float,
    log_prior: float,
) -> _FamilyAlone:
    """The fit with the coordinates that are ``gone`` at zero, to first order.

    The coefficients of the ``functions`` have a prior that is ``width`` times as wide as in the fit.
    """
    kept = np.array([each.name not in gone for each in mode.coordinates])
    missed, slopes = search.missed(mode.prediction), search.turned(mode.slopes)
    coordinates = tuple(
        replace(each, scale=width * each.scale)
        if each.name in functions and isinstance(each, Linear)
        else each
        for each, keep in zip(mode.coordinates, kept, strict=True)
        if keep
    )
    wider = np.array([width if each.name in functions else 1.0 for each in coordinates])
    without = missed + slopes[:, ~kept] @ mode.x[~kept]
    here = mode.x[kept] / wider
    top = linearised_optimum(search.rows, without, slopes[:, kept] * wider, here, bounds_of(coordinates))
    start = {each.name: each.value(float(x)) for each, x in zip(coordinates, top.x, strict=True)}
    evidence = log_evidence(top.value, top.precision, coordinates)
    return _FamilyAlone(functions, width, evidence + log_prior, log_prior, start)
