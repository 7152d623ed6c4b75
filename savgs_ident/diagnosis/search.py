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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from savgs_ident.core.executor import in_parallel
from savgs_ident.core.presentation import Progress
from savgs_ident.diagnosis.findings import (
    Findings,
    LostHypothesis,
    explains_all,
    hypothesis_of,
    left_over,
)
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import (
    PairScore,
    Score,
    best_pairs,
    cosine,
    peaks_by_try,
    prior_conflict,
    score_terms,
    scores_by_try,
)
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.find_map import (
    LaplaceFit,
    Search,
    densest,
    find_map,
    find_map_from_both,
    refine,
)
from savgs_ident.inference.observations import Term


def single_effects(
    search: Search,
    base: LaplaceFit,
    terms: Sequence[Term],
    progress: Progress,
    known: Sequence[tuple[str, ...]] = (),
    constants: DecisionConstants = DEFAULTS,
) -> Findings:
    """Single effects that may be missing in the recalibrated baseline ``base``, scored, the promising ones fitted.

    ``known`` are sets of terms that are often missing together. They are fitted from their typical sizes, because a
    search from a baseline that lacks all of them, and misses by as much as it moves, would not arrive.
    """
    fits = _Fits(search, base, {term.name: term for term in terms}, progress, constants)
    together = fits.refined([fits.fitted_together(names) for names in known])
    if any(fits.explains_all(mode) for mode in together):
        progress(f"{hypothesis_of(together[0])}: nothing is left")
        return _findings(base, score_terms(search, base, list(terms), constants), together)
    progress(f"scores of {len(terms)} effects")
    scores = score_terms(search, base, list(terms), constants)
    return _findings(base, scores, [*together, *_single_effects(fits, scores)])


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
    fits = _Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
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
    size, too; and what swings from every natural frequency that is tried, fitted already or not, because a sharp
    resonance shows to first order, and at a typical size, only where it is met to a few per cent.
    """
    tried = {mode.terms for mode in findings.modes}
    fits = _Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
    others = [term for term in wanted if (term.name,) not in tried]
    singles = fits.extended(findings.base, score_terms(search, findings.base, others, constants))
    least = max((mode.evidence for mode in findings.modes), default=-np.inf) - constants.refined_log_evidence
    singles += in_parallel(lambda term: fits.from_typical_size(term, least), others)
    for term in wanted:
        if term.tries:
            singles += fits.extended(
                findings.base, scores_by_try(search, findings.base, term, constants), least
            )
    found = fits.refined(_best_of_each([*findings.modes, *singles]))
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
    fits = _Fits(search, findings.base, {term.name: term for term in terms}, progress, constants)
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


@dataclass(frozen=True)
class _Fits:
    """Full fits of hypotheses to the same data: what all steps of a search share."""

    search: Search
    base: LaplaceFit
    terms: Mapping[str, Term]
    progress: Progress
    constants: DecisionConstants

    def explains_all(self, mode: LaplaceFit) -> bool:
        """Whether a hypothesis leaves next to nothing."""
        return mode.solved and explains_all(self.search, self.base, mode, self.constants)

    def is_spotless(self, mode: LaplaceFit) -> bool:
        """Whether a hypothesis leaves hardly more than the noise, and every parameter within its tolerance."""
        return self._left(mode) == 0.0 and not self.conflicts(mode)

    def negligible(self, modes: Sequence[LaplaceFit]) -> float:
        """The log evidence below which nothing is worth fitting beside ``modes``, one of which explains all."""
        enough = [mode.evidence for mode in modes if self.explains_all(mode)]
        return max(enough, default=-np.inf) - self.constants.refined_log_evidence

    def conflicts(self, mode: LaplaceFit) -> bool:
        """Whether the data speak for a tolerance that does not hold beside this hypothesis."""
        found = prior_conflict(mode, self.search.plant.nuisances, self.constants)
        return found.gain > self.constants.promising_log_evidence

    def lookalikes(self, scores: Sequence[Score], of: Sequence[Score]) -> list[Score]:
        """Those scores whose effect does nearly the same as any of the others."""
        least = self.constants.lookalike_cosine
        return [each for each in scores if any(abs(cosine(each, other)) > least for other in of)]

    def fitted_together(self, names: tuple[str, ...]) -> LaplaceFit:
        """The fit of several terms together, from their typical sizes."""
        self.progress(f"fitting {Hypothesis(names)} from typical sizes")
        chosen, typical = tuple(self.terms[name] for name in names), self.constants.typical_coordinate
        start = {each.name: each.value(typical) for term in chosen for each in term.amplitudes}
        start |= {each.name: each.centre for term in chosen for each in term.shapes}
        return find_map_from_both(
            self.search, chosen, self.base.values | start, self.base.prediction.warm_start
        )

    def fitted_alone(self, name: str, pair: LaplaceFit) -> LaplaceFit:
        """The fit of one member of a pair, from where it is beside the other."""
        self.progress(f"fitting {name} from its value in {hypothesis_of(pair)}")
        return find_map(self.search, (self.terms[name],), pair.values, pair.prediction.warm_start)

    def from_typical_size(self, term: Term, least: float) -> LaplaceFit:
        """The best fit of a term from its typical size and the shapes that are tried; those below ``least`` given up.

        Of what swings from the frequency that is nearest. A stop is fitted from each gap: the nearest of all may be
        one that is never closed, from where nothing leads on.
        """
        self.progress(f"fitting {term.name} from its typical size")
        typical = {each.name: each.value(self.constants.typical_coordinate) for each in term.amplitudes}
        starts = [self.base.values | typical | shapes for shapes in term.tried]
        near = self.base.prediction.warm_start
        chosen = [densest(self.search, (term,), starts, near)] if term.tries else starts
        fits = [find_map_from_both(self.search, (term,), start, near, least=least) for start in chosen]
        return max(fits, key=lambda fit: fit.evidence)

    def extended(
        self, parent: LaplaceFit, scores: Sequence[Score], least: float = -np.inf
    ) -> list[LaplaceFit]:
        """Fits of the scored terms, each added to those of ``parent``; those below ``least`` are given up."""
        inherited = tuple(self.terms[name] for name in parent.terms)

        def fit(score: Score) -> LaplaceFit:
            self.progress(f"fitting {hypothesis_of(parent).with_effect(score.term.name)}")
            start = parent.values | score.start
            return find_map_from_both(
                self.search, (*inherited, score.term), start, parent.prediction.warm_start, least=least
            )

        return in_parallel(fit, scores)

    def beside(self, parent: LaplaceFit, scores: Sequence[Score], least: float) -> list[LaplaceFit]:
        """Fits of the scored terms, each added to those of ``parent``: what swings, from its likely frequencies.

        Frequencies that score no more than ``least`` are left out.
        """

        def starts(score: Score) -> list[Score]:
            if not score.term.tries:
                return [score]
            peaks = peaks_by_try(self.search, parent, score.term, self.constants)
            return [each for each in peaks if each.evidence > least][: self.constants.resonance_peaks]

        return _best_of_each(self.extended(parent, [start for score in scores for start in starts(score)]))

    def together(self, pairs: Sequence[PairScore]) -> list[LaplaceFit]:
        """Fits of scored pairs from where they promise most."""

        def fit(pair: PairScore) -> LaplaceFit:
            self.progress(f"fitting {Hypothesis(tuple(term.name for term in pair.terms))}")
            start, warm_start = self.base.values | pair.start, self.base.prediction.warm_start
            return find_map_from_both(self.search, pair.terms, start, warm_start)

        return in_parallel(fit, pairs)

    def exchanged(self, pair: LaplaceFit, kept: str, score: Score) -> LaplaceFit:
        """The fit of a pair with the member that is not ``kept`` exchanged for the scored term."""
        self.progress(f"fitting {Hypothesis((kept, score.term.name))}")
        start = pair.values | score.start
        return find_map(self.search, (self.terms[kept], score.term), start, pair.prediction.warm_start)

    def refined(self, modes: Sequence[LaplaceFit]) -> list[LaplaceFit]:
        """The hypotheses, best first, the best of them on a mesh adapted to their own motion."""
        ranked = sorted(modes, key=lambda mode: -mode.evidence)

        def again(mode: LaplaceFit) -> LaplaceFit:
            self.progress(f"refining {hypothesis_of(mode)}")
            better = refine(self.search, mode, tuple(self.terms[name] for name in mode.terms))
            return better if better.solved else mode

        solved = [mode for mode in ranked[: self.constants.refined_fits] if mode.solved]
        least = ranked[0].evidence - self.constants.refined_log_evidence if ranked else 0.0
        close = [mode for mode in solved if mode.evidence > least]
        finer = in_parallel(again, [mode for mode in close if not mode.precise])
        others = [mode for mode in ranked if not any(mode is each and not mode.precise for each in close)]
        return sorted([*finer, *others], key=lambda mode: -mode.evidence)

    def _left(self, mode: LaplaceFit) -> float:
        return left_over(self.search, self.base, mode, self.constants)


def _single_effects(fits: _Fits, scores: Sequence[Score]) -> list[LaplaceFit]:
    """Fits of the single effects whose scores promise most, best first."""
    constants, base = fits.constants, fits.base
    worth = [each for each in scores if each.evidence > base.evidence + constants.promising_log_evidence]
    first, second = constants.first_fits, constants.first_fits + constants.further_fits
    alike = fits.lookalikes(worth[first:second], worth[:1])
    begun = fits.extended(base, worth[:first])
    least = fits.negligible(begun)
    ranked = fits.refined([*begun, *fits.extended(base, alike, least)])
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
    return fits.refined(_best_of_each([*ranked, *more]))


def _swinging(fits: _Fits, ranked: Sequence[LaplaceFit]) -> list[LaplaceFit]:
    """Fits of what swings from its typical size, as far as they come near to the best of those ``ranked``.

    A strong resonance is far from what it does to first order, wherever it is.
    """
    if fits.explains_all(fits.base):
        return []
    near = max((mode.evidence for mode in ranked), default=-np.inf) - fits.constants.refined_log_evidence
    several = [term for term in fits.terms.values() if term.tries]
    return in_parallel(lambda term: fits.from_typical_size(term, near), several)


def _best_of_each(modes: Sequence[LaplaceFit]) -> list[LaplaceFit]:
    """Of fits of the same hypothesis the best."""
    ranked = sorted(modes, key=lambda mode: mode.evidence)
    return list({hypothesis_of(mode): mode for mode in ranked}.values())


def _pairs(
    fits: _Fits,
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
    fits: _Fits, parent: LaplaceFit, known: Sequence[LaplaceFit], least: float
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
    fits: _Fits, pairs: list[LaplaceFit], parents: set[Hypothesis], least: float
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
    fits: _Fits, found: Sequence[LaplaceFit], scores: Sequence[Score], least: float
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


def _with_lookalikes(fits: _Fits, pairs: list[LaplaceFit], scores: Sequence[Score]) -> list[LaplaceFit]:
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


def _with_small_second_effects(fits: _Fits, parent: LaplaceFit) -> list[LaplaceFit]:
    """Pairs of a term that explains nearly all with effects so small that one alone does not show the other."""
    others = [term for name, term in fits.terms.items() if name not in parent.terms]
    scores = score_terms(fits.search, parent, others, fits.constants)
    least = parent.evidence + fits.constants.promising_log_evidence
    worth = [each for each in scores if each.evidence > least]
    return fits.beside(parent, worth[: fits.constants.pairs_per_parent], least)
