"""Evidence of a diagnosis as it is told in sentences and warnings, from a few numbers."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.evidence import (
    DiagnosisEvidence,
)
from savgs_ident.diagnosis.findings import Findings
from savgs_ident.diagnosis.gap import Shrink
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis, PortFamily
from savgs_ident.diagnosis.score_test import PriorConflict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.diagnosis.verdict import (
    BrokenTolerance,
    Reason,
    UnknownEvidence,
    WeighedHypothesis,
)
from savgs_ident.effects.base import Family
from savgs_ident.inference.prior import Linear
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.ports import LOCATION_WORDS

GAP = Shrink(0.3, 0.04, 0.002, 0.0015, 0.99, (0.98, 1.0))
RAIL_FRICTION = PortFamily("rail", Family.FRICTION)
RAIL: Any = SimpleNamespace(name="rail", share=0.9, evidence=50.0)
PROBLEM: Any = SimpleNamespace(
    constants=DEFAULTS,
    plant=SimpleNamespace(catalogue=CATALOGUE),
    drifts={},
    location_text=lambda location: LOCATION_WORDS[location],
    location=lambda name: CATALOGUE[name].port.location,
    locations=lambda hypothesis: tuple(CATALOGUE[name].port.location for name in hypothesis.effects),
    families=lambda hypothesis: (
        tuple(
            PortFamily(CATALOGUE[name].port.location, CATALOGUE[name].law.family)
            for name in hypothesis.effects
        )
        or (hypothesis.flexible,)
    ),
)


def mode_of(evidence: float, *terms: str, off: float = 0.0) -> Any:
    """A fit whose only tolerance is ``off`` by so many standard deviations."""
    coordinates = (Linear("m_u", "kg", 50.0, 1.0),)
    return SimpleNamespace(
        terms=terms, evidence=evidence, status=Status.CONVERGED, x=np.array([off]), coordinates=coordinates
    )


def evidence_of(kind: Any, reason: Reason, weights: dict[str, float], **more: Any) -> DiagnosisEvidence:
    """Evidence by the weights of "none", "unknown" and single effects."""
    effects = {name: weight for name, weight in weights.items() if name not in ("none", "unknown")}
    weighed = [
        WeighedHypothesis(Hypothesis((name,)), weight, mode_of(weight, name))
        for name, weight in effects.items()
    ]
    weighed += [
        WeighedHypothesis(NONE, weights["none"], mode_of(weights["none"])),
        WeighedHypothesis(UNKNOWN, weights["unknown"], None),
    ]
    ranked = tuple(sorted(weighed, key=lambda each: -each.weight))
    modes = tuple(each.mode for each in weighed if each.mode is not None and each.hypothesis.effects)
    return DiagnosisEvidence(
        findings=Findings(
            mode_of(weights["none"], off=more.get("off", 0.0)), (), modes, more.get("lost", ())
        ),
        localisations=(RAIL,),
        flexible=more.get("flexible", ()),
        weighed=ranked,
        unknown=UnknownEvidence(weights["unknown"], reason),
        broken=BrokenTolerance(
            weights["unknown"], PriorConflict(20.0, more.get("broken", {"k_t": -4.2})), NONE, ("tyre_radial",)
        ),
        kind=kind,
        chosen=next(each for each in ranked if str(each.hypothesis) == kind),
        left=0.08,
        named_law=more.get("named_law"),
        refit_failed=more.get("refit_failed", False),
        off=more.get("off_beside", {}),
    )
