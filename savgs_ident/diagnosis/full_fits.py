"""Full fits of hypotheses: what all steps of a search for what is missing share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from savgs_ident.core.presentation import Progress
from savgs_ident.core.threads import in_parallel
from savgs_ident.diagnosis.findings import explains_all, hypothesis_of, left_over
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import (
    PairScore,
    Score,
    cosine,
    peaks_by_try,
    prior_conflict,
    scores_by_try,
)
from savgs_ident.diagnosis.thresholds import DecisionConstants
from savgs_ident.inference.find_map import (
    densest,
    find_map,
    find_map_from_both,
    find_map_from_several,
    refine,
)
from savgs_ident.inference.laplace import is_hopeless
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import NumberChange, Term


@dataclass(frozen=True)
class Fits:
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

    def from_every_frequency(self, term: Term) -> LaplaceFit:
        """The best fit of what swings from all natural frequencies that are tried.

        From its typical size, and from that which promises most to first order: a sharp resonance shows to first
        order only where it is met to a few per cent, and a strong one is far from that.
        """
        self.progress(f"fitting {term.name} from every natural frequency")
        typical = {each.name: each.value(self.constants.typical_coordinate) for each in term.amplitudes}
        scores = scores_by_try(self.search, self.base, term, self.constants)
        starts = [*(typical | shapes for shapes in term.tried), *(dict(each.start) for each in scores)]
        return find_map_from_several(
            self.search,
            (term,),
            [self.base.values | each for each in starts],
            self.base.prediction.warm_start,
            self.constants.resonance_steps,
            self.constants.resonance_peaks,
        )

    def extended(
        self, parent: LaplaceFit, scores: Sequence[Score], least: float = -np.inf
    ) -> list[LaplaceFit]:
        """Fits of the scored terms, each added to those of ``parent``.

        Those below ``least`` are given up, and those whose scores promise too little for it are not begun.
        """
        inherited = tuple(self.terms[name] for name in parent.terms)

        def fit(score: Score) -> LaplaceFit:
            self.progress(f"fitting {hypothesis_of(parent).with_effect(score.term.name)}")
            terms, near = (*inherited, score.term), parent.prediction.warm_start
            start: Mapping[str, float] = parent.values | score.start
            if score.term.change is not None:
                instead = parent.values | _in_place_of_its_number(score.term.change, score.term, parent)
                start = densest(self.search, terms, (start, instead), near)
            return find_map_from_both(self.search, terms, start, near, least=least)

        return in_parallel(
            fit,
            [
                each
                for each in scores
                if not is_hopeless(parent.evidence, each.evidence - parent.evidence, least)
            ],
        )

    def beside(self, parent: LaplaceFit, scores: Sequence[Score], least: float) -> list[LaplaceFit]:
        """Fits of the scored terms, each added to those of ``parent``: what swings, from its likely frequencies.

        Frequencies that score no more than ``least`` are left out.
        """

        def starts(score: Score) -> list[Score]:
            if not score.term.tries:
                return [score]
            peaks = peaks_by_try(self.search, parent, score.term, self.constants)
            return [each for each in peaks if each.evidence > least][: self.constants.resonance_peaks]

        return best_of_each(self.extended(parent, [start for score in scores for start in starts(score)]))

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


def _in_place_of_its_number(change: NumberChange, term: Term, parent: LaplaceFit) -> dict[str, float]:
    """The number that a term changes as on its sheet, and the term with all that ``parent`` has it off; SI.

    Where calibration has taken up a large change, no step leads from there to the change itself: both do the same
    along a curve.
    """
    (amplitude,) = term.amplitudes
    off = amplitude.centre + (parent.values[change.number] - change.sheet) / change.slope
    return {change.number: change.sheet, amplitude.name: min(max(off, amplitude.lower), amplitude.upper)}


def best_of_each(modes: Sequence[LaplaceFit]) -> list[LaplaceFit]:
    """Of fits of the same hypothesis the best."""
    ranked = sorted(modes, key=lambda mode: mode.evidence)
    return list({hypothesis_of(mode): mode for mode in ranked}.values())
