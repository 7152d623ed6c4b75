"""The search for what is missing: scores, then full fits of the promising, then pairs where one is not enough.

Every hypothesis that is fitted in full comes out as a :class:`Mode` with its evidence. The linear evidence of
the scores says which are worth the fit; a pair is tried on top of the best single terms if these leave more than
the noise, or strain what is known to a tolerance.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.climb import Mode, Search, climb, refine
from savgs_ident.diagnose.engine.parallel import in_parallel
from savgs_ident.diagnose.engine.prediction import Term
from savgs_ident.diagnose.engine.score import Score, cosine, score_terms, scores_of
from savgs_ident.diagnose.engine.strain import strain_of

Tell = Callable[[str], None]
"""Is told what is going on, a line at a time."""

FIRST = 2
"""Single terms that are fitted in full at first, with those that look like the very first."""

MORE = 4
"""Further ones that are, if the first leave something."""

ALIKE = 0.9
"""Cosine from which on two terms look alike: where one explains all, the other must be fitted too."""

NOTICED = 2.0
"""Rise of the log evidence, by the score, from which on a term is worth a fit."""

SURE = 10.0
"""Rise of the log evidence from which on partners are looked for."""

PARTNERS = 3
"""Partners tried with a term that leaves something."""

PARENTS = 2
"""Best single terms that are tried with partners."""

TYPICAL = 0.5
"""Coordinate of a typical size: priors of amplitudes are two of them wide."""

CLOSE = 300.0
"""Log evidence below the best from which on precision does not matter."""

REFINED = 3
"""Best hypotheses that are found again with the plant as precise as it can be."""

LITTLE = 0.3
"""Excess that noise known from few periods and the plant's own solver may leave."""

EXPLAINED = 0.01
"""Share of the baseline's excess misfit that a hypothesis may leave and still count as explaining all."""


@dataclass(frozen=True)
class Findings:
    """All that was tried.

    Attributes:
        base: the baseline, recalibrated.
        scores: scores of all candidates at the baseline, best first.
        modes: hypotheses that were fitted in full, the best first; the baseline is not among them.
        lost: terms of the hypotheses whose fit found no motion.
    """

    base: Mode
    scores: tuple[Score, ...]
    modes: tuple[Mode, ...]
    lost: tuple[tuple[str, ...], ...] = ()

    @property
    def best(self) -> Mode:
        """The hypothesis with the greatest evidence."""
        return max((self.base, *self.modes), key=lambda mode: mode.evidence)


def excess(search: Search, mode: Mode) -> float:
    """Mean square of the residuals in noise variances, less one [1]: what the noise does not explain."""
    kept = search.kept
    residual = search.residual(mode.prediction)[kept]
    return max(float(np.mean(residual**2 / search.data.variance[kept])) - 1.0, 0.0)


def left_over(search: Search, base: Mode, mode: Mode) -> float:
    """Share of the baseline's excess that a hypothesis leaves; 0 where it leaves hardly more than the noise.

    Infinite where the baseline left nothing.
    """
    left, whole = excess(search, mode), excess(search, base)
    if left <= LITTLE:
        return 0.0
    return left / whole if whole > 0.0 else np.inf


def find_terms(
    search: Search,
    base: Mode,
    terms: Sequence[Term],
    tell: Tell,
    known: Sequence[tuple[str, ...]] = (),
) -> Findings:
    """Hypotheses about what is missing in the baseline at its mode ``base``.

    ``known`` are sets of terms that are often missing together. They are fitted from their typical sizes, where the
    search would not come from a baseline that lacks all of them and misses by as much as it moves.
    """
    wholes = _refined(search, [_whole(search, base, names, terms, tell) for names in known], terms, tell)
    if any(_explains_all(search, base, whole) for whole in wholes):
        tell(f"{' + '.join(wholes[0].terms)}: nothing is left")
        return _findings(base, score_terms(search, base, list(terms)), wholes)
    tell(f"scores of {len(terms)} effects")
    columns = search.plant.columns((), base.values, base.prediction.near, list(terms))
    alone = dict(zip((term.name for term in terms), columns, strict=True))
    scores = scores_of(search, base, terms, columns)
    worth = [each for each in scores if each.evidence > base.evidence + NOTICED]
    first = worth[:FIRST] + _alike(worth[FIRST : FIRST + MORE], worth[:1])
    ranked = _refined(search, _fitted(search, base, first, terms, tell), terms, tell)
    begun = {each.term.name for each in first}
    later = [each for each in worth if each.term.name not in begun]
    if ranked and _explains_all(search, base, ranked[0]):
        later = _alike(later, [each for each in scores if each.term.name == ranked[0].terms[0]])
    else:
        later = later[:MORE]
    ranked = _refined(search, [*ranked, *_fitted(search, base, later, terms, tell)], terms, tell)
    pairs: list[Mode] = []
    if ranked and ranked[0].evidence > base.evidence + SURE:
        wanting = not _explains_all(search, base, ranked[0])
        if wanting or strain_of(ranked[0], search.plant.nuisances).gain > NOTICED:
            solved = [mode for mode in ranked[: PARENTS if wanting else 1] if np.isfinite(mode.evidence)]
            for parent in solved:
                pairs += _with_partners(search, parent, terms, pairs, tell)
            pairs = _refined(search, pairs, terms, tell)
            if pairs and not _spotless(search, base, pairs[0]):
                pairs = _with_others(search, base, pairs, {mode.terms for mode in solved}, terms, tell)
        else:
            pairs = _refined(search, _with_small_partners(search, ranked[0], terms, alone, tell), terms, tell)
        if pairs and pairs[0].evidence > ranked[0].evidence:
            pairs = _with_doubles(search, pairs, scores, terms, tell)
    return _findings(base, scores, [*wholes, *ranked, *pairs])


def with_partners_among(
    search: Search, findings: Findings, near: Sequence[Term], best: Mode, terms: Sequence[Term], tell: Tell
) -> Findings:
    """The findings, and pairs of each member of the hypothesis ``best`` with each of the terms ``near``.

    Beside a stand-in the right partner shows little: it has to be tried beside the right member alone.
    """
    pairs: list[Mode] = []
    tried = {frozenset(mode.terms) for mode in findings.modes}
    parents = [mode for mode in findings.modes if len(mode.terms) == 1 and mode.terms[0] in best.terms]
    for parent in parents:
        others = [term for term in near if frozenset({*parent.terms, term.name}) not in tried]
        others = [term for term in others if term.name not in parent.terms]
        pairs += _fitted(search, parent, score_terms(search, parent, others), terms, tell)
    more = _findings(findings.base, findings.scores, _refined(search, [*findings.modes, *pairs], terms, tell))
    return replace(more, lost=(*findings.lost, *more.lost))


def _findings(base: Mode, scores: Sequence[Score], modes: Sequence[Mode]) -> Findings:
    found = sorted((mode for mode in modes if np.isfinite(mode.evidence)), key=lambda mode: -mode.evidence)
    lost = tuple(mode.terms for mode in modes if not np.isfinite(mode.evidence))
    return Findings(base, tuple(scores), tuple(found), lost)


def _explains_all(search: Search, base: Mode, mode: Mode) -> bool:
    return bool(np.isfinite(mode.evidence)) and left_over(search, base, mode) <= EXPLAINED


def _spotless(search: Search, base: Mode, mode: Mode) -> bool:
    """Whether a hypothesis leaves hardly more than the noise, and every tolerance about where its sheet has it."""
    strained = strain_of(mode, search.plant.nuisances).gain > NOTICED
    return left_over(search, base, mode) == 0.0 and not strained


def _alike(scores: Sequence[Score], to: Sequence[Score]) -> list[Score]:
    """Those that look like any of the others."""
    return [each for each in scores if any(abs(cosine(each, other)) > ALIKE for other in to)]


def _whole(search: Search, base: Mode, names: tuple[str, ...], terms: Sequence[Term], tell: Tell) -> Mode:
    """The fit of several terms together, from their typical sizes."""
    tell(f"fitting {' + '.join(names)} from typical sizes")
    chosen = tuple(next(term for term in terms if term.name == name) for name in names)
    start = {each.name: each.value(TYPICAL) for term in chosen for each in term.amplitudes}
    start |= {each.name: each.centre for term in chosen for each in term.shapes}
    return climb(search, chosen, base.values | start, base.prediction.near)


def _refined(search: Search, modes: Sequence[Mode], terms: Sequence[Term], tell: Tell) -> list[Mode]:
    """The hypotheses, the best of them made precise, best first."""
    by_name = {term.name: term for term in terms}
    ranked = sorted(modes, key=lambda mode: -mode.evidence)

    def again(mode: Mode) -> Mode:
        tell(f"refining {' + '.join(mode.terms)}")
        better = refine(search, mode, tuple(by_name[name] for name in mode.terms))
        return better if np.isfinite(better.evidence) else mode

    solved = [mode for mode in ranked[:REFINED] if np.isfinite(mode.evidence)]
    near = [mode for mode in solved if mode.evidence > ranked[0].evidence - CLOSE]
    finer = in_parallel(again, [mode for mode in near if not mode.precise])
    settled = [mode for mode in ranked if not any(mode is each and not mode.precise for each in near)]
    return sorted([*finer, *settled], key=lambda mode: -mode.evidence)


def _with_partners(
    search: Search,
    parent: Mode,
    terms: Sequence[Term],
    known: Sequence[Mode],
    tell: Tell,
) -> list[Mode]:
    """Pairs of a fitted term with the partners that score best beside it."""
    tell(f"partners of {' + '.join(parent.terms)}")
    tried = {frozenset(mode.terms) for mode in known}
    others = [
        term
        for term in terms
        if term.name not in parent.terms and frozenset({*parent.terms, term.name}) not in tried
    ]
    scores = score_terms(search, parent, others)
    worth = [each for each in scores if each.evidence > parent.evidence]
    return _fitted(search, parent, worth[:PARTNERS], terms, tell)


def _with_others(
    search: Search,
    base: Mode,
    pairs: list[Mode],
    parents: set[tuple[str, ...]],
    terms: Sequence[Term],
    tell: Tell,
) -> list[Mode]:
    """The pairs, and those that keep a member of the best ones and exchange the other.

    A member that shows only beside another one is no parent by itself: the other may have been a stand-in.
    """
    by_name = {term.name: term for term in terms}
    beside = {
        name: pair for pair in reversed(pairs[:PARENTS]) for name in pair.terms if (name,) not in parents
    }

    def alone(name: str) -> Mode:
        tell(f"fitting {name} as it is beside the other")
        return climb(search, (by_name[name],), beside[name].values, beside[name].prediction.near)

    for parent in in_parallel(alone, list(beside)):
        if np.isfinite(parent.evidence):
            pairs = [*pairs, *_with_partners(search, parent, terms, pairs, tell)]
    return _refined(search, pairs, terms, tell)


def _with_doubles(
    search: Search, pairs: list[Mode], scores: Sequence[Score], terms: Sequence[Term], tell: Tell
) -> list[Mode]:
    """The pairs, and the best one with either member exchanged for what looks like it."""
    by_name, by_score = {term.name: term for term in terms}, {score.term.name: score for score in scores}
    best, tried = pairs[0], {frozenset(mode.terms) for mode in pairs}
    exchanged = [
        (kept, double)
        for kept, gone in (best.terms, best.terms[::-1])
        for double in _alike(scores, [by_score[gone]])
        if double.term.name not in best.terms and frozenset({kept, double.term.name}) not in tried
    ]

    def fit(exchange: tuple[str, Score]) -> Mode:
        kept, double = exchange
        tell(f"fitting {kept} + {double.term.name}")
        chosen = (by_name[kept], double.term)
        return climb(search, chosen, best.values | double.start, best.prediction.near)

    return _refined(search, [*pairs, *in_parallel(fit, exchanged)], terms, tell)


def _with_small_partners(
    search: Search,
    parent: Mode,
    terms: Sequence[Term],
    alone: Mapping[str, NDArray[np.float64]],
    tell: Tell,
) -> list[Mode]:
    """Pairs of a term that explains nearly all with partners so small that one alone does not show the other.

    What a partner would do is taken from the motion without the term, columns by name in ``alone``: near enough to
    say whether it is worth a fit.
    """
    others = [term for term in terms if term.name not in parent.terms]
    scores = scores_of(search, parent, others, [alone[term.name] for term in others])
    worth = [each for each in scores if each.evidence > parent.evidence + NOTICED]
    return _fitted(search, parent, worth[:PARTNERS], terms, tell)


def _fitted(
    search: Search, parent: Mode, scores: Sequence[Score], terms: Sequence[Term], tell: Tell
) -> list[Mode]:
    """Full fits of the scored terms, each added to those of ``parent``."""
    by_name = {term.name: term for term in terms}
    inherited = tuple(by_name[name] for name in parent.terms)

    def fit(score: Score) -> Mode:
        tell(f"fitting {' + '.join((*parent.terms, score.term.name))}")
        return climb(search, (*inherited, score.term), parent.values | score.start, parent.prediction.near)

    return in_parallel(fit, scores)
