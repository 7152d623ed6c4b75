"""Flexible members as hypotheses: a learned law at a port, fitted on the true, nonlinear plant.

Localisation learns a law to first order about the baseline. Here the same functions of what the port sees become part
of the model (:mod:`savgs_ident.effects.learned`), and their coefficients are fitted beside the baseline's own
parameters, as those of any effect: with a prior, a null and an evidence. So the law can be weighed against the
catalogue's formulas, solved, simulated and exported.

Which family the law is of follows from the fit: its functions of all other families are taken away, to first order
about the fit, and one by one those of the family that are not needed; what remains is weighed. The likely families
are fitted again by themselves; where the functions of one are more probable than all, the law is made of them. A play
is fitted as one that is blocked at its ends, too: until then it may give way as slowly as a film of oil does.

How large coefficients may be is unknown before the data: their prior is one of several widths, first the one that is
the most probable to first order about the baseline, for each family then the one that is so about the fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import log
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.core.threads import in_parallel, side_by_side
from savgs_ident.diagnosis.held_out import HeldOut, hold_out
from savgs_ident.diagnosis.law_families import FittedFunctions, families_fitted, families_spared
from savgs_ident.diagnosis.learning_start import best_places, widths_alone, with_amplitudes
from savgs_ident.diagnosis.problem import AbstractProblem, term_of
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import Family, Port, PortKind
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import learned_effect
from savgs_ident.effects.learned_functions import (
    blocking_at,
    coefficients_at,
    coefficients_of,
    what_gives,
)
from savgs_ident.inference.find_map import find_map, find_map_from_both
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, Start, search_of
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Logarithmic


@dataclass(frozen=True)
class LearnedLaw:
    """A law at its best, beside the baseline.

    Attributes:
        name: of the effect.
        port: where it acts.
        term: its coefficients as a search takes them.
        problem: the baseline with the law, and those that share its program.
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
        return (
            {each.name: each.value for each in self.effect.parameters} | self.mode.values | dict(self.spans)
        )

    @property
    def weight(self) -> float:
        """Its log evidence, with the prior probability of its functions."""
        return self.mode.evidence + self.log_prior

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
    ports: Sequence[Port],
    constants: DecisionConstants = DEFAULTS,
    given: Start | None = None,
    progress: Progress = no_progress,
    least: float = -np.inf,
) -> tuple[LearnedLaw, ...]:
    """The laws at ports, in their order; ``base`` is the recalibrated baseline.

    They are looked for from there and from the plant as ``given``. There is none at a port without learned law, where
    the plant with one has no solution, or where the law is impossible. Given up is what cannot come to a log evidence
    of ``least``, or cannot be as probable as a law that is known: the first port's, which promises most, then of the
    others' the one that leads after some steps. The others are begun while the first is gone on with.
    """

    def begin(port: Port, near: float) -> _Begun | None:
        progress(f"learning a law at {port.location} ({port.name})")
        return _begin_learning(problem, data, base, port, constants, given, near)

    def finish(each: _Begun, near: float) -> LearnedLaw | None:
        progress(f"telling families apart at {each.port.location} ({each.port.name})")
        ended = each.gone_on(near, constants)
        return ended.law(*_most_probable(ended, base, near, constants))

    def begun(some: Sequence[Port], near: float) -> list[_Begun]:
        return [each for each in in_parallel(partial(begin, near=near), some) if each is not None]

    def near_to(weights: Sequence[float]) -> float:
        return max(least, max(weights, default=-np.inf) - constants.alarm_log_odds)

    first = begun(ports[:1], least)
    laws, left = side_by_side(
        lambda: [finish(each, least) for each in first],
        lambda: begun(ports[1:], near_to([each.best.weight for each in first])),
    )
    found = [law for law in laws if law is not None]
    left = sorted(left, key=lambda each: -each.best.weight)
    while left and left[0].best.weight > max((law.weight for law in found), default=-np.inf):
        law = finish(left.pop(0), near_to([each.weight for each in found]))
        found += [] if law is None else [law]
    near = near_to([law.weight for law in found])
    found += [law for law in in_parallel(partial(finish, near=near), left) if law is not None]
    order = [each.name for each in ports]
    return tuple(sorted(found, key=lambda law: order.index(law.port.name)))


class _Begun(NamedTuple):
    """All functions of a port fitted, and those of a play that is blocked, if any; see :class:`LearnedLaw`.

    ``places`` is what :func:`best_places` says and ``alone`` what :func:`widths_alone` does.
    """

    port: Port
    problem: AbstractProblem
    search: Search
    spans: Mapping[str, float]
    places: Mapping[str, float]
    alone: Mapping[tuple[str, ...], float]
    every: FittedFunctions
    blocked: FittedFunctions | None

    @property
    def best(self) -> FittedFunctions:
        """The more probable ones."""
        return max((each for each in (self.every, self.blocked) if each), key=lambda each: each.weight)

    def gone_on(self, least: float, constants: DecisionConstants) -> "_Begun":
        """Both fits to their ends, or until they cannot come to a log evidence of ``least``, or near to the other.

        A play that is impossible leaves the port its other laws.
        """
        both = [each for each in (self.every, self.blocked) if each]
        bound = max(least, self.best.weight - constants.alarm_log_odds)
        every, *blocked = in_parallel(lambda each: each.gone_on(self.search, bound, constants), both)
        possible = [each for each in blocked if self.law(each, {}) is not None]
        return self._replace(every=every, blocked=possible[0] if possible else None)

    def law(self, fitted: FittedFunctions, families: Mapping[Family, float]) -> LearnedLaw | None:
        """The law of some functions; None where it is impossible."""
        law = LearnedLaw(
            name=fitted.term.name,
            port=self.port,
            term=fitted.term,
            problem=self.problem,
            search=self.search,
            mode=fitted.mode,
            spans=self.spans,
            families=families,
            log_prior=fitted.log_prior,
            only=fitted.only,
        )
        return None if _is_impossible(law) else law


def _begin_learning(
    problem: AbstractProblem,
    data: Data,
    base: LaplaceFit,
    port: Port,
    constants: DecisionConstants,
    given: Start | None,
    least: float,
) -> _Begun | None:
    """The first steps of the fit of all functions of a port; None where there is none."""
    at_rest = _at_rest(problem, base, port)
    if at_rest is None or not at_rest.prediction.solved:
        return None
    mine, effect, spans, known = at_rest
    search, names = search_of(mine, data, given), coefficients_at(port)
    places = best_places(mine, search, base, port, known.warm_start, constants)
    values = {**base.values, **places}
    there_now = mine.predict((effect.name,), values, names, known.warm_start)
    if not there_now.solved:
        return None
    shapes = tuple(each for each in term_of(effect, constants).shapes if each.name not in spans)
    blank = Term(effect.name, port.location, (), shapes)
    columns = dict(zip(names, there_now.slopes.T, strict=True))
    term = with_amplitudes(blank, effect, search, base, columns, constants)
    steps, near = constants.first_learned_steps, there_now.warm_start
    free = [each.name for each in term.amplitudes]
    mode = find_map_from_both(search, (term,), values, near, steps, least, free)
    if not mode.solved:
        return None
    blocked = _blocked_play(search, effect, blank, port, base, near, constants)
    alone = widths_alone(term, port, search, base, columns, constants)
    return _Begun(port, mine, search, spans, places, alone, FittedFunctions(term, mode), blocked)


class _AtRest(NamedTuple):
    """The baseline with a learned law that does nothing: the problem, the law, its ``spans`` and the motion."""

    problem: AbstractProblem
    effect: Effect
    spans: Mapping[str, float]
    prediction: Prediction


def _at_rest(problem: AbstractProblem, base: LaplaceFit, port: Port) -> _AtRest | None:
    """The baseline with the law of a port; None where no law can be learned there."""
    spans = problem.learned_spans(port, base.values, base.prediction.warm_start)
    if spans is None:
        return None
    effect = learned_effect(port)
    there = {name: each for name, each in problem.catalogue.items() if name in problem.baseline}
    alike = {each.name: each for each in _alike(effect, problem)}
    parameters = tuple(each for some in alike.values() for each in some.parameters)
    table = ParameterTable(parameters).with_values(spans)
    mine = replace(
        problem,
        parameters=merge_parameters(problem.parameters, table),
        catalogue={**there, **alike},
    ).uncorrected()
    known = mine.predict((effect.name,), base.values, (), base.prediction.warm_start)
    return _AtRest(mine, effect, spans, known)


def rehearse_learning(problem: AbstractProblem, base: LaplaceFit, port: Port) -> None:
    """Have compiled what :func:`learn` will ask for at a port: nothing else must wait for it."""
    _at_rest(problem, base, port)


def _alike(effect: Effect, problem: AbstractProblem) -> list[Effect]:
    """The learned laws of all that gives way, whose programs serve each other, if this is one of them."""
    if effect.port.kind is not PortKind.SERIES:
        return [effect]
    ports = problem.plant.scaled_ports
    series = (each for each in ports if each.kind is PortKind.SERIES and not each.resonant)
    return [learned_effect(each) for each in series]


def _is_impossible(law: LearnedLaw) -> bool:
    """Whether what gives way moves against its load: no part does that by itself, however well it fits."""
    there = [each.port.name for name, each in law.problem.catalogue.items() if name != law.name]
    if law.port.kind is not PortKind.SERIES or law.port.name in there:
        return False
    n = np.linspace(-1.0, 1.0, 201)
    columns = np.stack(what_gives(jnp.asarray(n), jnp.asarray(n), jnp.zeros(n.size)))
    return float([law.values[name] for name in law.units] @ columns @ n) < 0.0


def _most_probable(
    begun: _Begun, base: LaplaceFit, least: float, constants: DecisionConstants
) -> tuple[FittedFunctions, Mapping[Family, float]]:
    """The most probable functions of a law, and what the law's ``families`` are.

    All functions of the port, or a play that is blocked, or those of a family that is likely, where this can come to
    a log evidence of ``least``.
    """
    best, weights = begun.best, dict[Family, float]()
    if begun.every.attainable(begun.search, constants) > least:
        start = {**base.values, **begun.places}
        weights, fitted = families_fitted(
            begun.search, begun.every, begun.port, begun.alone, start, least, constants
        )
        best = max((best, *fitted), key=lambda each: each.weight)
    if best.only is None:
        return best, families_spared(begun.search, begun.every.mode, begun.port)
    return best, weights | {best.only: best.weight}


def _blocked_play(
    search: Search,
    effect: Effect,
    blank: Term,
    port: Port,
    base: LaplaceFit,
    near: Any,
    constants: DecisionConstants,
) -> FittedFunctions | None:
    """The functions of a play that is blocked at its ends, after the first steps from the baseline.

    ``blank`` is the port's learned law without coefficients, and the plant is solved from ``near``, where nothing
    gives way. None where there is no play, or none with a solution.
    """
    blocking = blocking_at(port)
    if blocking is None:
        return None
    lags = tuple(replace(each, centre=constants.lag_of_play * port.time_scale) for each in blank.shapes)
    blocked = Logarithmic(blocking, "1", constants.blocking_of_play, constants.shape_width, 0.0, np.inf)
    names, shapes = coefficients_of(port, Family.PLAY), (*lags, blocked)
    start = {**base.values, **{each.name: each.centre for each in shapes}}
    there_now = search.plant.predict((effect.name,), start, names, near)
    if not there_now.solved:
        return None
    columns = dict(zip(names, there_now.slopes.T, strict=True))
    term = with_amplitudes(replace(blank, shapes=shapes), effect, search, base, columns, constants)
    mode = find_map(search, (term,), start, there_now.warm_start, constants.first_learned_steps)
    log_prior = len(term.amplitudes) * log(constants.function_prior)
    return FittedFunctions(term, mode, log_prior, Family.PLAY) if mode.solved else None
