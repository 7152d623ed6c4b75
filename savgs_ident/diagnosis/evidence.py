"""What a model selection works on and what comes out of it, as records.

A :class:`DiagnosisProblem` is a plant with its data and its baseline at its best. :class:`FittedHypotheses` are the
fits of all. A :class:`DiagnosisEvidence` is what speaks for every hypothesis about what is missing, and what may be
said; its :class:`FlexibleMember` are learned laws as hypotheses.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.findings import Findings
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.localisation import Localisation
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.result import NONE, UNKNOWN, Hypothesis, Kind, PortFamily
from savgs_ident.diagnosis.score_test import prior_conflict
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.diagnosis.verdict import (
    BrokenTolerance,
    Change,
    UnknownEvidence,
    WeighedHypothesis,
    broken_tolerance,
    uncertain_odds,
)
from savgs_ident.effects.base import Family, Port
from savgs_ident.effects.effect import families_of
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Data, Term


@dataclass(frozen=True)
class DiagnosisProblem:
    """A plant, what it is compared with, and its baseline as given and recalibrated.

    Attributes:
        plant: the plant with its catalogue and what drives it.
        data: what it is compared with.
        search: both, as a search for parameters takes them.
        given: rows of the baseline as given [unit of each reading], (m,).
        base: the baseline recalibrated.
        constants: what the verdict is decided by.
        drifts: relative change of parameters from the first test of the campaign to the last [1], by name: those that
            certainly change, where the baseline drifts by more than is tolerated.
    """

    plant: AbstractProblem
    data: Data
    search: Search
    given: NDArray[np.float64]
    base: LaplaceFit
    constants: DecisionConstants = DEFAULTS
    drifts: Mapping[str, float] = field(default_factory=dict)

    def location(self, effect: str) -> str:
        """Where an effect of the catalogue acts."""
        return self.plant.catalogue[effect].port.location

    def locations(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Where the effects of a hypothesis act, each location once."""
        return tuple(dict.fromkeys(self.location(name) for name in hypothesis.effects))

    def families(self, hypothesis: Hypothesis) -> tuple[PortFamily, ...]:
        """Where a hypothesis acts and of which kind it is, each once."""
        if hypothesis.flexible:
            return (hypothesis.flexible,)
        found = families_of([self.plant.catalogue[name] for name in hypothesis.effects])
        return tuple(PortFamily(place, family) for place, family in found)

    def is_tolerance(self, hypothesis: Hypothesis, broken: BrokenTolerance) -> bool:
        """Whether effects are tolerances that do not hold, by other names: they change numbers that are off."""
        numbers = {self.plant.catalogue[name].number for name in hypothesis.effects}
        return bool(numbers) and numbers <= set(broken.conflict.off)

    def location_text(self, location: str) -> str:
        """What a reader calls a location."""
        return self.plant.plant.location_words.get(location, location)

    def broken_beside(self, mode: LaplaceFit, count: int) -> BrokenTolerance:
        """The tolerances that do not hold beside a fit, where the catalogue has ``count`` effects."""
        conflict = prior_conflict(mode, self.plant.nuisances, self.constants)
        ports = {number.name: port.location for port in self.plant.model(()).ports for number in port.numbers}
        return broken_tolerance(mode, conflict, count, ports, self.constants)

    def port(self, name: str) -> Port:
        """The port of a name."""
        return next(each for each in self.plant.plant.scaled_ports if each.name == name)

    def terms(self, hypothesis: Hypothesis) -> tuple[Term, ...]:
        """The candidates that a hypothesis consists of."""
        return tuple(self._candidates[name] for name in hypothesis.effects)

    @cached_property
    def _candidates(self) -> Mapping[str, Term]:
        return {term.name: term for term in self.plant.candidates}


@dataclass(frozen=True)
class FittedHypotheses:
    """All hypotheses fitted, before they are weighed against each other.

    Attributes:
        findings: all that were scored and fitted.
        localisations: what a law at each location would explain.
        laws: learned laws that were fitted on the nonlinear plant.
        beside: log evidence of a law beside the most probable effects.
        best: the most probable fit when they were compared.
        change: what its effects do to the response.
    """

    findings: Findings
    localisations: tuple[Localisation, ...]
    laws: tuple[LearnedLaw, ...]
    beside: float
    best: LaplaceFit
    change: Change


class FlexibleMember(NamedTuple):
    """A learned law at a port as a hypothesis.

    Attributes:
        law: the law at its best.
        weight: log evidence plus log prior.
        left: share of the baseline's misfit that it leaves.
        sd: standard deviation of the weight [nat].
        relative_prior: what of the weight is due to the prior of its functions and of its family there [nat].
    """

    law: LearnedLaw
    weight: float
    left: float
    sd: float = 0.0
    relative_prior: float = 0.0

    @property
    def location(self) -> str:
        """Where it acts."""
        return self.law.port.location

    @property
    def family(self) -> Family:
        """The kind of thing that it is."""
        return self.law.family

    @property
    def hypothesis(self) -> Hypothesis:
        """As a hypothesis among others."""
        return Hypothesis(flexible=PortFamily(self.location, self.family))


@dataclass(frozen=True)
class DiagnosisEvidence:
    """What speaks for every hypothesis, and what may be said.

    Attributes:
        findings: all hypotheses that were scored and fitted.
        localisations: what a law at each location would explain.
        flexible: learned laws that were fitted on the nonlinear plant, the most probable first.
        weighed: hypotheses by falling weight.
        unknown: what speaks most for something that the catalogue lacks.
        broken: the tolerances that most probably do not hold where nothing else is missing.
        off: how many tolerances [1] parameters are off their sheet beside the effects that are named, by name; none
            where all tolerances hold more probably.
        kind: what may be said.
        chosen: the hypothesis that it rests on.
        left: share of the baseline's misfit that the most probable effects leave.
        named_law: the learned law that is named, where no formula of the catalogue explains the data.
        refit_failed: whether what is named could not be found again on a finer mesh.
        unsupported: whether what would be named predicts tests that were held out no better than the baseline.
        unsupported_at: where it acts, if something is missing all the same; empty if not.
        refuted: what was to be named then.
        immaterial: by hypothesis, the probability that it changes the response by too little to matter, if it is
            right: nothing that counts is missing then.
        insufficient: fitted hypotheses that leave much: if they are right, something unknown is missing besides.
        besides: whether something small is more probably missing besides what is named than not.
    """

    findings: Findings
    localisations: tuple[Localisation, ...]
    flexible: tuple[FlexibleMember, ...]
    weighed: tuple[WeighedHypothesis, ...]
    unknown: UnknownEvidence
    broken: BrokenTolerance
    kind: Kind
    chosen: WeighedHypothesis
    left: float
    named_law: FlexibleMember | None = None
    refit_failed: bool = False
    unsupported: bool = False
    unsupported_at: str = ""
    refuted: Hypothesis = NONE
    immaterial: Mapping[Hypothesis, float] = field(default_factory=dict)
    insufficient: tuple[Hypothesis, ...] = ()
    off: Mapping[str, float] = field(default_factory=dict)
    besides: bool = False

    @property
    def localisation(self) -> Localisation:
        """The location of something unknown: where a law is most probable, or where one was named in vain."""
        first = self.unsupported_at or next(iter(self.weight_by_location))
        return next(each for each in self.localisations if each.name == first)

    @property
    def left_by_named(self) -> float:
        """Share of the baseline's misfit that what is named leaves."""
        return self.left if self.named_law is None else self.named_law.left

    @property
    def prior_gain(self) -> float:
        """By how much what is chosen spares the parameters of the plant implausible values: rise of log prior [nat].

        Calibration can take up much of what is missing, but only by parameters that are far off their sheet.
        """
        base, mode = self.findings.base, self.chosen.mode
        return 0.0 if mode is None else 0.5 * float(base.x @ base.x - mode.x @ mode.x)

    @property
    def offered(self) -> FlexibleMember | None:
        """The learned law that explains most, where it acts at the most probable location."""
        there = [each for each in self.flexible if each.location == self.localisation.name]
        return max(there, key=lambda each: each.weight, default=None)

    @property
    def weight_by_location(self) -> Mapping[str, float]:
        """Log weight of a law at every location, the most probable first.

        A law that was fitted on the nonlinear plant counts instead of its linear estimate.
        """
        return {name: weight for name, (weight, _) in self._weights.items()}

    @cached_property
    def _weights(self) -> Mapping[str, tuple[float, float]]:
        """Log weight of a law at every location with its standard deviation [nat], the most probable first."""
        found = {each.name: (each.evidence, 0.0) for each in self.localisations}
        solved: dict[str, tuple[float, float]] = {}
        for each in self.flexible:
            evidence = each.law.mode.evidence + each.relative_prior
            if each.location not in solved or evidence > solved[each.location][0]:
                solved[each.location] = evidence, each.sd
        return dict(sorted((found | solved).items(), key=lambda item: -item[1][0]))

    @property
    def port(self) -> str:
        """Where something unknown acts: the port of a broken tolerance, if that is it, or that of the law."""
        if self.named_law is not None:
            return self.named_law.location
        broken = self.broken.ports if self.unknown.is_tolerance else ()
        return broken[0] if broken else self.localisation.name

    def indistinguishable_ports(self, constants: DecisionConstants = DEFAULTS) -> tuple[str, ...]:
        """Other ports at which a law of something unknown is nearly as probable, the most probable first."""
        if self.named_law is None and self.port != self.localisation.name:
            return ()
        most = self._weights[self.port]
        return tuple(
            name
            for name, each in self._weights.items()
            if name != self.port
            and uncertain_odds(most[0] - each[0], hypot(most[1], each[1]))
            < constants.indistinguishable_log_odds
        )

    def ports_alike(self, port: str, constants: DecisionConstants = DEFAULTS) -> tuple[str, ...]:
        """Other ports at which a law would do as much as the effect that is named, at ``port``, the best first.

        A learned law that is about as probable as the effect; and a law that is to first order about as probable as
        one at the port, or more: a formula may be far more probable than the catalogue's formulas elsewhere, but what
        it does may be that of another law all the same. None of these where a law at the port explains little.
        """
        near = constants.indistinguishable_log_odds
        learned = [
            each.hypothesis.flexible.port
            for each in self.weighed
            if each.hypothesis.flexible is not None
            and uncertain_odds(self.chosen.weight - each.weight, hypot(self.chosen.sd, each.sd)) < near
        ]
        here = next((each for each in self.localisations if each.name == port), None)
        if here is None or here.share < constants.alike_share:
            likely = []
        else:
            ranked = sorted(self.localisations, key=lambda each: -each.evidence)
            likely = [each.name for each in ranked if each.evidence > here.evidence - near]
        return tuple(name for name in dict.fromkeys([*learned, *likely]) if name != port)


def counted_with_more(evidence: DiagnosisEvidence) -> DiagnosisEvidence:
    """The evidence of effects that are named, with what speaks for something small besides them on their side.

    They are missing in either case.
    """
    unknown, chosen = evidence.unknown, evidence.chosen
    if evidence.kind not in ("effect", "several") or evidence.named_law is not None:
        return evidence
    evidence = replace(evidence, besides=unknown.weight > chosen.weight)
    if unknown.reason != "law beside effects":
        return evidence
    both = replace(chosen, weight=float(np.logaddexp(chosen.weight, unknown.weight)))
    others = [
        replace(each, weight=-np.inf) if each.hypothesis == UNKNOWN else each
        for each in evidence.weighed
        if each is not chosen
    ]
    return replace(
        evidence, chosen=both, weighed=tuple(sorted((both, *others), key=lambda each: -each.weight))
    )


def is_better_form(problem: DiagnosisProblem, evidence: DiagnosisEvidence, member: FlexibleMember) -> bool:
    """Whether a formula would be named and a learned law of its family at its port is certainly more probable.

    The formula is the nearest then: its own probability would be next to nothing.
    """
    chosen, constants = evidence.chosen, problem.constants
    if evidence.kind != "effect" or problem.families(chosen.hypothesis) != (member.hypothesis.flexible,):
        return False
    much = member.weight > chosen.weight + constants.indistinguishable_log_odds
    return much and member.left <= evidence.left
