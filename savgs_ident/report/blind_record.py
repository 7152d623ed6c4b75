"""Blind trials as the JSON object of ``blind.json``."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from savgs_ident.diagnose.blind.score import Score
from savgs_ident.diagnose.blind.totals import Rate, confusion_of, rates_of
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.report.origin import versions_of

PACKAGES = ("jax", "numpy", "scipy")


def blind_record(
    scores: Sequence[Score], settings: Mapping[str, Any], command: Sequence[str]
) -> dict[str, Any]:
    """Rates with their 95 % intervals (Wilson) and bounds, the confusion matrix, and the marks of every trial.

    ``trusted`` says that every rate keeps its bounds. Shares and changes are relative, parameters in SI.
    """
    rates, confusion = rates_of(scores), confusion_of(scores, tuple(CATALOGUE))
    return {
        "schema": 1,
        "trusted": all(rate.met is not False for rate in rates.values()),
        "trials": len(scores),
        "kinds": {
            kind: sum(score.kind == kind for score in scores) for kind in ("none", "effect", "two", "unknown")
        },
        "rates": {name: _rate(rate) for name, rate in rates.items()},
        "confusion": {
            "truths": confusion.truths,
            "verdicts": confusion.verdicts,
            "counts": confusion.counts,
        },
        "settings": dict(settings),
        "scores": [
            asdict(score)
            | {"intervals": {name: asdict(i) | {"holds": i.holds} for name, i in score.intervals.items()}}
            for score in scores
        ],
        "command": " ".join(command),
        "versions": versions_of(PACKAGES),
    }


def _rate(rate: Rate) -> dict[str, Any]:
    return {
        "count": rate.count,
        "of": rate.total,
        "rate": rate.rate,
        "interval": [rate.low, rate.high],
        "least": rate.least,
        "most": rate.most,
        "met": rate.met,
    }
