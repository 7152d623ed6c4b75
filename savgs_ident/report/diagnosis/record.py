"""A diagnosis as the JSON object of ``diagnosis.json``: SI throughout, the unit beside the value."""

from collections.abc import Iterable

from savgs_ident.core.files import warning_record
from savgs_ident.core.presentation import Origin
from savgs_ident.diagnosis.gap import FurtherShrink, Shrink
from savgs_ident.diagnosis.result import Candidate, Diagnosis, Estimate, Learned


def diagnosis_record(diagnosis: Diagnosis, origin: Origin) -> dict[str, object]:
    """The contract's keys first, then further results and the origin.

    Gaps and shares are relative (0.1 is 10 %), but for ``gap_percent`` of the map; ``gap_sigma`` and
    ``score_sigma`` are in standard deviations, ``heldout_gain`` and ``gain_beyond`` are in nats per datum.
    """
    return {
        "schema": 2,
        "baseline": {
            "model": diagnosis.model,
            "parameters": dict(diagnosis.parameters),
            "effects": diagnosis.effects,
        },
        "verdict": {
            "kind": diagnosis.verdict.kind,
            "effects": diagnosis.verdict.effects,
            "ports": diagnosis.verdict.ports,
            "confusable_with": diagnosis.verdict.confusable_with,
            "sentence": diagnosis.verdict.sentence,
            "confusable_ports": diagnosis.verdict.confusable_ports,
            "families": [str(each) for each in diagnosis.verdict.families],
            "law_known": diagnosis.verdict.law_known,
            "probability": diagnosis.verdict.probability,
            "another_law": not diagnosis.verdict.law_known,
        },
        "where": _where(diagnosis),
        "which": [_candidate(each) for each in diagnosis.candidates],
        "shrink": _shrink(diagnosis.shrink)
        | {"by_channel": {name: _shrink(each) for name, each in diagnosis.by_channel.items()}},
        "next_test": [
            {
                "test": each.test,
                "separates": [str(hypothesis) for hypothesis in each.separates],
                "expected_sigma": each.expected_sigma,
            }
            for each in diagnosis.next_tests
        ],
        "not_judgeable": [
            {
                "effect": each.effect,
                "parameter": each.parameter,
                "smallest": each.smallest,
                "unit": each.unit,
            }
            for each in diagnosis.not_judgeable
        ],
        "confusable": [{"effects": each.effects, "cosine": each.cosine} for each in diagnosis.confusable],
        "sweep": _further(diagnosis.further) if diagnosis.further and diagnosis.measured else None,
        "further": diagnosis.further and {"recording": diagnosis.further.name} | _further(diagnosis.further),
        "identified": dict(diagnosis.identified),
        "intervals": _parameters(diagnosis.intervals),
        "drifts": dict(diagnosis.drifts),
        "learned": diagnosis.learned and _learned(diagnosis.learned),
        "converged": diagnosis.converged,
        "warnings": diagnosis.warnings,
        "wall_s": diagnosis.wall_s,
        "provenance": _provenance(origin),
    }


def _provenance(origin: Origin) -> dict[str, object]:
    return {**origin.record, "warnings": [warning_record(warning) for warning in origin.warnings]}


def _where(diagnosis: Diagnosis) -> dict[str, object]:
    return {
        "ports": [
            {
                "port": each.port,
                "probability": each.probability,
                "share": each.share,
                "reach": each.free_input_share,
            }
            for each in diagnosis.ports
        ],
        "map": [
            {
                "channel": each.channel,
                "frequency_hz": each.frequency_hz,
                "order": each.order,
                "gap_percent": each.gap_percent,
                "gap_sigma": each.gap_sigma,
            }
            for each in diagnosis.map
        ],
        "cycle": [
            {
                "channel": each.channel,
                "reversal": each.reversal,
                "mid_stroke": each.mid_stroke,
                "between": each.between,
            }
            for each in diagnosis.cycle
        ],
        "regimes": [
            {"regime": each.name, "gap_percent": each.gap_percent, "p_value": each.p_value}
            for each in diagnosis.regimes
        ],
    }


def _candidate(each: Candidate) -> dict[str, object]:
    return {
        "effect": str(each.hypothesis),
        "port": each.port,
        "family": each.family,
        "probability": each.probability,
        "score_sigma": each.score_sigma,
        "heldout_gain": each.heldout_gain,
        "gain_beyond": each.gain_beyond,
        "parameters": _parameters(each.parameters),
        "effects": each.effects,
        "share_closed": each.share_closed,
        "refitted": each.refitted,
    }


def _parameters(estimates: Iterable[Estimate]) -> dict[str, dict[str, object]]:
    return {
        each.name: {"value": each.value, "lo": each.lo, "hi": each.hi, "unit": each.unit}
        for each in estimates
    }


def _learned(each: Learned) -> dict[str, object]:
    return {
        "effect": each.effect,
        "port": each.port,
        "parameters": _parameters(each.parameters),
        "identified": dict(each.identified),
    }


def _further(each: FurtherShrink) -> dict[str, object]:
    return {
        "before": each.before,
        "recalibrated": each.recalibrated,
        "after": each.after,
        "floor": each.floor,
    }


def _shrink(each: Shrink) -> dict[str, object]:
    return {
        "before": each.before,
        "recalibrated": each.recalibrated,
        "after": each.after,
        "floor": each.floor,
        "closed_by_calibration": each.closed_by_calibration,
        "closed_by_effect": each.closed_by_effect,
        "interval_by_effect": each.interval_by_effect,
        "share_closed": each.share_closed,
        "interval": each.interval,
    }
