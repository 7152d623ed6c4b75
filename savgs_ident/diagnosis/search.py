"""The search for what is missing: scores, then full fits of the promising, then pairs where one is not enough.

Forward selection. The linear evidence of the scores says which single effects are worth a full fit. If the best of
them leaves more than the noise, or pulls a parameter away from its tolerance, pairs are fitted:

1. the best single effects, each with the effects that score best beside it;
2. members of the best pairs that are no single effect of step 1, with other effects: the second member may be a
   stand-in;
3. pairs that to first order about the baseline promise more than the best of these: of two effects that together
   are like a third one neither need be near to the best single effect;
4. the best pair with either member exchanged for its lookalikes.

Every hypothesis that is fitted in full comes out with its evidence; one whose fit found no solution of the plant is
named in :attr:`~savgs_ident.diagnosis.findings.Findings.lost`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import in_parallel, side_by_side
from savgs_ident.diagnosis.findings import (
    Findings,
    LostHypothesis,
    hypothesis_of,
)
from savgs_ident.diagnosis.full_fits import Fits, best_of_each
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import (
    Score,
    best_pairs,
    score_terms,
)
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Term


def _nothing() -> None:
    """Do nothing."""


def single_effects(
    search: Search,
    base: LaplaceFit,
    terms: Sequence[Term],
    progress: Progress,
    known: Sequence[tuple[str, ...]] = (),
    constants: DecisionConstants = DEFAULTS,
    meanwhile: Callable[[], None] = _nothing,
) -> Findings:
    """Single effects that may be missing in the recalibrated baseline ``base``, scored, the promising ones fitted.

    Where the best of them does not explain all, ``meanwhile`` is done beside the fits of the others.

    ``known`` are sets of terms that are often missing together. They are fitted from their typical sizes, because a
    search from a baseline that lacks all of them, and misses by as much as it moves, would not arrive.
    """
    fits = Fits(search, base, {term.name: term for term in terms}, progress, constants)
    together = fits.refined([fits.fitted_together(names) for names in known])
    if any(fits.explains_all(mode) for mode in together):
        progress(f"{hypothesis_of(together[0])}: nothing is left")
        return _findings(base, score_terms(search, base, list(terms), constants), together)
    progress(f"scores of {len(terms)} effects")
    scores = score_terms(search, base, list(terms), constants)
    return _findings(base, scores, [*together, *_single_effects(fits, scores, meanwhile)])


def with_pairs(
    search: Search,
    findings: Findings,
    terms: Sequence[Term],
    progress: Progress,
    constants: DecisionConstants = DEFAULTS,
    least: float = -np.inf,
) -> Findings:
    """The findings, and pairs of effects where the best single one is not enough.

    Pairs whose score promises no log evidence beyond ``least`` are not fitted.
    """
    fits = Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
    singles = [mode for mode in findings.modes if len(mode.terms) == 1]
    if not singles or singles[0].evidence <= findings.base.evidence + constants.pair_log_evidence:
        return findings
    pairs = _pairs(fits, singles, findings.scores, least)
    more = _findings(findings.base, findings.scores, [*findings.modes, *pairs])
    return replace(more, lost=(*findings.lost, *more.lost))


def singles_among(
    search: Search,
    findings: Findings,
    wanted: Sequence[Term],
    terms: Sequence[Term],
    progress: Progress,
    constants: DecisionConstants = DEFAULTS,
) -> Findings:
    """The findings, and each of the ``wanted`` among the ``terms`` alone that has not been fitted yet.

    An effect that acts far from in proportion to its size scores little at its null: it is fitted from its typical
    size, too; and what swings from every natural frequency that is tried, fitted already or not.
    """
    tried = {mode.terms for mode in findings.modes}
    fits = Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
    others = [term for term in wanted if (term.name,) not in tried]
    singles = fits.extended(findings.base, score_terms(search, findings.base, others, constants))
    least = max((mode.evidence for mode in findings.modes), default=-np.inf) - constants.refined_log_evidence
    singles += in_parallel(lambda term: fits.from_typical_size(term, least), others)
    singles += [fits.from_every_frequency(term) for term in wanted if term.tries]
    found = fits.refined(best_of_each([*findings.modes, *singles]))
    more = _findings(findings.base, findings.scores, found)
    return replace(more, lost=(*findings.lost, *more.lost))


def pairs_with(
    search: Search,
    findings: Findings,
    best: LaplaceFit,
    others: Sequence[Term],
    terms: Sequence[Term],
    progress: Progress,
    constants: DecisionConstants = DEFAULTS,
) -> Findings:
    """The findings, and pairs of each member of the hypothesis ``best`` with each of the ``others``.

    Beside a stand-in the right second effect explains little: it has to be fitted beside the right member alone.
    """
    fits = Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
    tried = {hypothesis_of(mode) for mode in findings.modes}
    pairs: list[LaplaceFit] = []
    for parent in findings.modes:
        if len(parent.terms) == 1 and parent.terms[0] in best.terms:
            untried = [
                term
                for term in others
                if term.name not in parent.terms and hypothesis_of(parent).with_effect(term.name) not in tried
            ]
            pairs += fits.extended(parent, score_terms(search, parent, untried, constants))
    more = _findings(findings.base, findings.scores, fits.refined([*findings.modes, *pairs]))
    return replace(more, lost=(*findings.lost, *more.lost))


def _findings(
    base: LaplaceFit,
    scores: Sequence[Score],
    modes: Sequence[LaplaceFit],
) -> Findings:
    found = sorted((mode for mode in modes if mode.solved), key=lambda mode: -mode.evidence)
    lost = tuple(LostHypothesis(hypothesis_of(mode), mode.status) for mode in modes if not mode.solved)
    return Findings(base, tuple(scores), tuple(found), lost)


def _single_effects(fits: Fits, scores: Sequence[Score], meanwhile: Callable[[], None]) -> list[LaplaceFit]:
    """Fits of the single effects whose scores promise most, best first."""
    constants, base = fits.constants, fits.base
    worth = [each for each in scores if each.evidence > base.evidence + constants.promising_log_evidence]
    # The best alone: where it explains all, little or nothing is worth fitting beside it.
    begun = fits.refined(fits.extended(base, worth[:1]))
    if not begun or fits.explains_all(begun[0]):
        return _other_singles(fits, scores, worth, begun)
    return side_by_side(lambda: _other_singles(fits, scores, worth, begun), meanwhile)[0]


def _other_singles(
    fits: Fits, scores: Sequence[Score], worth: Sequence[Score], begun: Sequence[LaplaceFit]
) -> list[LaplaceFit]:
    """The best single effect, which is fitted already, and those of the others that are ``worth`` it, best first."""
    constants, base = fits.constants, fits.base
    first, second = constants.first_fits, constants.first_fits + constants.further_fits
    alike = fits.lookalikes(worth[first:second], worth[:1])
    least = fits.negligible(begun)
    ranked = fits.refined([*begun, *fits.extended(base, [*worth[1:first], *alike], least)])
    names = {each.term.name for each in (*worth[:first], *alike)}
    later = [each for each in worth if each.term.name not in names]
    beyond = max(least, fits.negligible(ranked))
    if ranked and fits.explains_all(ranked[0]):
        named = [each for each in scores if each.term.name == ranked[0].terms[0]]
        more = fits.extended(base, fits.lookalikes(later, named), beyond)
    else:
        more = fits.extended(base, later[: constants.further_fits], beyond)
        if not any(fits.explains_all(mode) for mode in more):
            more += _swinging(fits, ranked)
    return fits.refined(best_of_each([*ranked, *more]))


def _swinging(fits: Fits, ranked: Sequence[LaplaceFit]) -> list[LaplaceFit]:
    """Fits of what swings from its typical size, as far as they come near to the best of those ``ranked``.

    A strong resonance is far from what it does to first order, wherever it is.
    """
    if fits.explains_all(fits.base):
        return []
    near = max((mode.evidence for mode in ranked), default=-np.inf) - fits.constants.refined_log_evidence
    several = [term for term in fits.terms.values() if term.tries]
    return in_parallel(lambda term: fits.from_typical_size(term, near), several)


def _pairs(
    fits: Fits,
    singles: Sequence[LaplaceFit],
    scores: Sequence[Score],
    least: float,
) -> list[LaplaceFit]:
    """Fits of pairs that promise more than ``least``, best first."""
    best = singles[0]
    wanting = not fits.explains_all(best)
    if wanting or fits.conflicts(best):
        parents = [mode for mode in singles[: fits.constants.parents if wanting else 1] if mode.solved]
        pairs: list[LaplaceFit] = []
        for parent in parents:
            pairs += _with_second_effects(fits, parent, pairs, least)
        pairs = fits.refined(pairs)
        if pairs and not fits.is_spotless(pairs[0]):
            pairs = _with_other_second_effects(fits, pairs, {hypothesis_of(mode) for mode in parents}, least)
    else:
        pairs = fits.refined(_with_small_second_effects(fits, best))
    pairs = fits.refined([*pairs, *_best_to_first_order(fits, pairs or [best], scores, least)])
    if pairs and pairs[0].evidence > best.evidence:
        pairs = _with_lookalikes(fits, pairs, scores)
    return pairs


def _with_second_effects(
    fits: Fits, parent: LaplaceFit, known: Sequence[LaplaceFit], least: float
) -> list[LaplaceFit]:
    """Pairs of a fitted term with the effects that score best beside it, and more than ``least``.

    Less those that are ``known``.
    """
    fits.progress(f"effects beside {hypothesis_of(parent)}")
    tried, alone = {hypothesis_of(mode) for mode in known}, hypothesis_of(parent)
    others = [
        term
        for name, term in fits.terms.items()
        if name not in parent.terms and alone.with_effect(name) not in tried
    ]
    scores = score_terms(fits.search, parent, others, fits.constants)
    least = max(parent.evidence, least)
    worth = [each for each in scores if each.evidence > least]
    return fits.beside(parent, worth[: fits.constants.pairs_per_parent], least)


def _with_other_second_effects(
    fits: Fits, pairs: list[LaplaceFit], parents: set[Hypothesis], least: float
) -> list[LaplaceFit]:
    """The pairs, and those that keep a member of the best ones and exchange the other.

    A member that shows only beside another one is no parent by itself: the other may have been a stand-in.
    """
    best = pairs[: fits.constants.parents]
    members = {
        name: pair for pair in reversed(best) for name in pair.terms if Hypothesis((name,)) not in parents
    }
    for parent in in_parallel(lambda name: fits.fitted_alone(name, members[name]), list(members)):
        if parent.solved:
            pairs = [*pairs, *_with_second_effects(fits, parent, pairs, least)]
    return fits.refined(pairs)


def _best_to_first_order(
    fits: Fits, found: Sequence[LaplaceFit], scores: Sequence[Score], least: float
) -> list[LaplaceFit]:
    """Pairs that are not ``found`` yet and promise more about the baseline than the best of these has."""
    tried = {hypothesis_of(mode) for mode in found}
    least = max(found[0].evidence, least)
    worth = [
        pair
        for pair in best_pairs(fits.search, fits.base, scores, fits.constants.first_order_pairs)
        if pair.evidence > least and Hypothesis(tuple(term.name for term in pair.terms)) not in tried
    ]
    return fits.together(worth[: fits.constants.pairs_per_parent])


def _with_lookalikes(fits: Fits, pairs: list[LaplaceFit], scores: Sequence[Score]) -> list[LaplaceFit]:
    """The pairs, and the best one with either member exchanged for its lookalikes."""
    by_name = {score.term.name: score for score in scores}
    best, tried = pairs[0], {hypothesis_of(mode) for mode in pairs}
    exchanges = [
        (kept, lookalike)
        for kept, gone in (best.terms, best.terms[::-1])
        for lookalike in fits.lookalikes(scores, [by_name[gone]])
        if lookalike.term.name not in best.terms and Hypothesis((kept, lookalike.term.name)) not in tried
    ]
    return fits.refined([*pairs, *in_parallel(lambda each: fits.exchanged(best, *each), exchanges)])


def _with_small_second_effects(fits: Fits, parent: LaplaceFit) -> list[LaplaceFit]:
    """Pairs of a term that explains nearly all with effects so small that one alone does not show the other."""
    others = [term for name, term in fits.terms.items() if name not in parent.terms]
    scores = score_terms(fits.search, parent, others, fits.constants)
    least = parent.evidence + fits.constants.promising_log_evidence
    worth = [each for each in scores if each.evidence > least]
    return fits.beside(parent, worth[: fits.constants.pairs_per_parent], least)
