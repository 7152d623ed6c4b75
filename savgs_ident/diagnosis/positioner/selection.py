"""Which laws are missing: a greedy search that does not take neighbouring rows for independent witnesses.

Rows follow each other faster than what a model misses changes, so that neighbours tell the same thing and evidence
over rows is boastful. A law is named if the evidence speaks for it and if it also predicts parts of the recording
that it was not fitted to: there the gain is counted block by block of time, and must stand out from its own scatter
over the blocks.

Laws of the textbook come first, and details only after them, when all laws are open. In the end whatever is no
longer needed beside the others is dropped: a detail may explain what an earlier law stood in for.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.held_out import hold_out
from savgs_ident.diagnosis.positioner.laws import Law
from savgs_ident.diagnosis.positioner.plant import PositionerPlant, pitch_choices
from savgs_ident.diagnosis.score_test import Score, score_terms
from savgs_ident.inference.find_map import LaplaceFit, Search, find_map, search_of
from savgs_ident.inference.observations import Data, Term

ENOUGH = 5.0
"""Log evidence without which no law is named: odds of 150 to 1."""

CLEAR = 3.0
"""Standard errors by which the gain in parts left out must exceed zero."""

PROMISING = 3
"""How many of the best scored are fitted in full."""

PITCHES = 6
"""How many of the best pitches are scored."""


class Gain(NamedTuple):
    """Rise of the log predictive density per row, and its standard error from the scatter over blocks."""

    mean: float
    error: float

    @property
    def clear(self) -> bool:
        """Whether it stands out."""
        return self.mean > CLEAR * self.error


@dataclass(frozen=True)
class Step:
    """A law that was added, or dropped, on the way.

    Attributes:
        term: its name.
        added: whether it was added.
        evidence_gain: log evidence that it brings beside the others.
        heldout: rise of the log predictive density that it brings in parts left out.
        scores: scores of all laws that were not in the model before, best first; none if dropped.
        mode: the hypothesis after the step.
    """

    term: str
    added: bool
    evidence_gain: float
    heldout: Gain
    scores: tuple[Score, ...]
    mode: LaplaceFit


@dataclass(frozen=True)
class Selection:
    """The laws that are missing.

    Attributes:
        base: the baseline, recalibrated.
        textbook: steps from it to the laws of the textbook that are missing.
        details: steps from there to the details.
    """

    base: LaplaceFit
    textbook: tuple[Step, ...]
    details: tuple[Step, ...]

    @property
    def plain(self) -> LaplaceFit:
        """The hypothesis with the laws of the textbook."""
        return self.textbook[-1].mode if self.textbook else self.base

    @property
    def refined(self) -> LaplaceFit:
        """The hypothesis with all details."""
        return self.details[-1].mode if self.details else self.plain


def select_laws(plant: PositionerPlant, data: Data) -> Selection:
    """Names the laws of the plant's catalogue that are missing in its baseline."""
    chooser = _Chooser(plant, search_of(plant, data), _pitches(plant))
    base = find_map(chooser.search, (), {}, None)
    textbook = _forward(chooser, base, lambda law: not law.refines)
    plain = textbook[-1].mode if textbook else base
    present = {"", *(law.term.name for law in plant.laws(plain.terms))}
    details = _forward(chooser, plain, lambda law: law.refines in present)
    details += _backward(chooser, details[-1].mode) if details else []
    return Selection(base, tuple(textbook), tuple(details))


@dataclass(frozen=True)
class _Chooser:
    plant: PositionerPlant
    search: Search
    pitches: Mapping[str, tuple[Term, NDArray[np.float64]]]

    def terms(self, names: Sequence[str]) -> tuple[Term, ...]:
        return tuple(law.term for name in names for law in self.plant.catalogue if law.term.name == name)

    def scores(self, mode: LaplaceFit) -> list[Score]:
        """Scores of all laws that are not in ``mode``, best first."""
        search = self.search
        left = [law.term for law in self.plant.catalogue if law.term.name not in mode.terms]
        terms = [term for term in left if term.name not in self.pitches]
        for term in left:
            if term.name in self.pitches:
                every, columns = self.pitches[term.name]
                power = np.sum((columns.transpose(0, 2, 1) @ search.residual(mode.prediction)) ** 2, axis=1)
                likely = tuple(every.tries[place] for place in np.argsort(-power)[:PITCHES])
                terms.append(replace(term, tries=likely))
        return score_terms(search, mode, terms)

    def heldout(self, mode: LaplaceFit, other: LaplaceFit) -> Gain:
        """Rise of the log predictive density over ``other`` in parts left out."""
        one, two = (hold_out(self.search, each, self.terms(each.terms)) for each in (mode, other))
        rise, test = one.log_density - two.log_density, self.search.data.test
        blocks = np.bincount(test, rise - rise.mean())
        error = np.sqrt(np.sum(blocks**2) * blocks.size / (blocks.size - 1)) / rise.size
        return Gain(float(rise.mean()), float(error))


def _pitches(plant: PositionerPlant) -> dict[str, tuple[Term, NDArray[np.float64]]]:
    """The terms that have a pitch, looked for at every one, with their columns (tries, m, amplitudes)."""
    found = {}
    for law in plant.catalogue:
        if any(shape.unit == "m" for shape in law.term.shapes):
            every = law.term.at_multiples(pitch_choices(plant.motion, law))
            found[law.term.name] = (every, plant.columns((), {}, None, [every])[0])
    return found


def _forward(chooser: _Chooser, start: LaplaceFit, wanted: Callable[[Law], bool]) -> list[Step]:
    """Adds the best of the wanted laws as long as one is significant."""
    steps: list[Step] = []
    mode = start
    while True:
        scores = chooser.scores(mode)
        laws = {law.term.name: law for law in chooser.plant.catalogue}
        open_to = [score for score in scores if wanted(laws[score.term.name])][:PROMISING]
        if not open_to:
            return steps
        modes = [
            find_map(
                chooser.search, chooser.terms((*mode.terms, score.term.name)), mode.values | score.start, None
            )
            for score in open_to
        ]
        best = max(range(len(modes)), key=lambda place: modes[place].evidence)
        gain, heldout = modes[best].evidence - mode.evidence, chooser.heldout(modes[best], mode)
        if gain < ENOUGH or not heldout.clear:
            return steps
        mode = modes[best]
        steps.append(Step(open_to[best].term.name, True, gain, heldout, tuple(scores), mode))


def _backward(chooser: _Chooser, start: LaplaceFit) -> list[Step]:
    """Drops the least needed of the laws as long as one is not."""
    steps: list[Step] = []
    mode = start
    while mode.terms:
        without = [
            find_map(chooser.search, chooser.terms([n for n in mode.terms if n != name]), mode.values, None)
            for name in mode.terms
        ]
        least = max(range(len(without)), key=lambda place: without[place].evidence)
        gain, heldout = mode.evidence - without[least].evidence, chooser.heldout(mode, without[least])
        if gain >= ENOUGH and heldout.clear:
            return steps
        steps.append(Step(mode.terms[least], False, gain, heldout, (), without[least]))
        mode = without[least]
    return steps
