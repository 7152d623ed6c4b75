"""How the marks of blind trials move when a decision constant is halved or doubled.

Every trial of a run with ``--sensitivity`` gets further verdicts from its own fits
(:mod:`savgs_ident.diagnosis.varied_constants`); what is said then stands in its ``diagnosis.json``. Here it is
marked, and counted.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from savgs_ident.diagnosis.diagnose import Watch
from savgs_ident.diagnosis.evidence import DiagnosisProblem, FittedHypotheses
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.varied_constants import FACTORS, VARIED, vary_constants
from savgs_ident.validation.blind_answer import Answer, Score, score_of
from savgs_ident.validation.blind_rates import Rate, rates_of

KEY = "sensitivity"
"""The key of the verdicts by other constants in a trial's ``diagnosis.json``."""


@dataclass(frozen=True)
class MovedMarks:
    """The marks of all trials with their verdicts by another constant.

    Attributes:
        constant: name of the constant.
        value: what it is instead.
        trials: how many trials there are.
        changed: how many of them get another verdict.
        rates: all rates, by name.
    """

    constant: str
    value: float
    trials: int
    changed: int
    rates: Mapping[str, Rate]


def varied_into(found: dict[str, Any]) -> Watch:
    """A watcher of a diagnosis that puts verdicts by other constants into ``found``, by constant and factor."""

    def watch(problem: DiagnosisProblem, fitted: FittedHypotheses) -> None:
        varied = vary_constants(problem, fitted, {})
        found[KEY] = {
            name: {str(factor): asdict(verdict) for factor, verdict in verdicts.items()}
            for name, verdicts in varied.items()
        }

    return watch


def moved_marks(trials: Sequence[tuple[Score, Answer, Mapping[str, Any]]]) -> tuple[MovedMarks, ...]:
    """The marks by every constant; each trial as its score, its answer and the object of its ``diagnosis.json``.

    Empty where none has verdicts by other constants.
    """
    varied_trials = [each for each in trials if _has_verdicts(each[2])]
    return tuple(_moved(varied_trials)) if varied_trials else ()


def _has_verdicts(diagnosis: Mapping[str, Any]) -> bool:
    """Whether all verdicts by other constants are there: an earlier version may have had others."""
    varied = diagnosis.get(KEY)
    return isinstance(varied, dict) and all(
        str(factor) in varied.get(name, {}) for name in VARIED for factor in FACTORS
    )


def _moved(varied_trials: Sequence[tuple[Score, Answer, Mapping[str, Any]]]) -> Iterator[MovedMarks]:
    for name in VARIED:
        for factor in FACTORS:
            scores = [_marked(*each, name, factor) for each in varied_trials]
            changed = sum(
                _said(one) != _said(other) for one, (other, _, _) in zip(scores, varied_trials, strict=True)
            )
            value = factor * getattr(DEFAULTS, name)
            yield MovedMarks(name, value, len(scores), changed, rates_of(scores))


def _marked(score: Score, answer: Answer, diagnosis: Mapping[str, Any], name: str, factor: float) -> Score:
    """The score with another verdict; intervals and gaps, which were not computed again, are those of the trial."""
    other = score_of(answer, {**diagnosis, "verdict": diagnosis[KEY][name][str(factor)]}, score.version)
    return replace(
        other,
        share_closed=score.share_closed,
        closed_by_effect=score.closed_by_effect,
        intervals=score.intervals,
    )


def _said(score: Score) -> tuple[object, ...]:
    return score.verdict, score.said, score.families, score.located_right, score.port_right
