"""The case before the court: the baseline recalibrated, hypotheses and ports, and what kind of verdict they allow."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import log

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.engine.attribution import Attribution, anywhere, attribute
from savgs_ident.diagnose.engine.climb import Mode, Search, climb, refine, search_of
from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.engine.parallel import side_by_side
from savgs_ident.diagnose.engine.search import (
    EXPLAINED,
    Findings,
    Tell,
    find_terms,
    left_over,
    with_partners_among,
)
from savgs_ident.diagnose.engine.strain import strain_of
from savgs_ident.diagnose.result import Kind
from savgs_ident.diagnose.rig.comparison import rig_plant
from savgs_ident.diagnose.rig.places import places_of
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.diagnose.rig.seats import SEATS
from savgs_ident.diagnose.settings import DiagnosisSettings
from savgs_ident.diagnose.sittings import Sitting, at_and_elsewhere, by_place, may_be_imitated, sittings_of
from savgs_ident.diagnose.verdict import (
    CONFUSED,
    LEFT,
    LEFT_BY_ANOTHER_LAW,
    PRIOR_UNKNOWN,
    Change,
    Strained,
    Unknown,
    Weighed,
    heaviest,
    kind_of,
    most_strained,
    of_material_parts,
    prior_of,
    reweighed,
    unknown_of,
    weigh,
)
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.responses.harmonic_response import HarmonicResponse

NEAREST = 2
"""Ports of what a hypothesis leaves whose effects are tried: at the first may sit a stand-in of the hypothesis."""


@dataclass(frozen=True)
class Case:
    """A rig as a plant, what it is held against, and the baseline as given and recalibrated.

    ``given`` are the rows of the baseline as given, (m,) [unit of each reading].
    """

    plant: RigPlant
    data: Data
    search: Search
    given: NDArray[np.float64]
    base: Mode


@dataclass(frozen=True)
class Judged:
    """What was found out about a case.

    Attributes:
        findings: all hypotheses that were scored and fitted.
        places: what a law at each port would explain.
        weighed: hypotheses by falling weight.
        unknown: what speaks most for something that the catalogue lacks.
        strained: the tolerance that is most probably broken.
        kind: what may be said.
        chosen: the hypothesis that it rests on.
        left: share of the baseline's excess misfit that the heaviest hypothesis leaves.
        settled: whether the parameters of what is named are free of what finitely many nodes cost.
        besides: what a law at each port would explain beside the best single effect, where that was asked.
        another_law: whether the named effect acts by another law than the catalogue's.
    """

    findings: Findings
    places: tuple[Attribution, ...]
    weighed: tuple[Weighed, ...]
    unknown: Unknown
    strained: Strained
    kind: Kind
    chosen: Weighed
    left: float
    settled: bool = True
    besides: tuple[Sitting, ...] = ()
    another_law: bool = False

    @property
    def sittings(self) -> tuple[Sitting, ...]:
        """Laws at all ports, alone and beside the best single effect."""
        return (*sittings_of(self.places), *self.besides)

    @property
    def place(self) -> Attribution:
        """Where a law of something unknown would most probably sit."""
        first = next(iter(by_place(self.sittings)))
        return next(each for each in self.places if each.name == first)

    @property
    def beside(self) -> tuple[str, ...]:
        """Ports at which it may sit as well, the most probable first."""
        if self.seat != self.place.name:
            return ()
        (_, most), *others = by_place(self.sittings).items()
        return tuple(name for name, weight in others if weight > most - CONFUSED)

    @property
    def seat(self) -> str:
        """The port at which something unknown shows: that of a broken tolerance, if that is it, or of the law."""
        broken = SEATS.get(self.strained.strain.parameter) if self.unknown.reason == "strain" else None
        return self.place.name if broken is None else broken.value


def recalibrate(
    measured: HarmonicResponse,
    rig: Rig,
    options: DiagnosisSettings,
    values: Mapping[str, float],
    tell: Tell,
) -> Case:
    """The baseline at its own best: what calibration alone can do. It is started from ``values`` [SI]."""
    unknown = sorted({*options.without, *options.baseline} - set(CATALOGUE))
    if unknown:
        raise InputError(
            f"there is no effect '{unknown[0]}'", remedy="choose among: " + ", ".join(sorted(CATALOGUE))
        )
    needed = sorted({*options.without} & {*options.baseline})
    if needed:
        raise InputError(
            f"the effect '{needed[0]}' is part of the baseline",
            remedy="leave out effects that the baseline lacks",
        )
    catalogue = {name: each for name, each in CATALOGUE.items() if name not in options.without}
    tell("solving the baseline")
    plant, data = rig_plant(
        measured, rig, catalogue, options.baseline, options.free, options.orders, options.periodic
    )
    near, _ = side_by_side(lambda: plant.start(values), plant.rehearse)
    search = search_of(plant, data)
    given = plant.predict((), values, [each.name for each in plant.nuisances], near)
    tell("recalibrating the baseline")
    base = climb(search, (), values, near)
    if not np.isfinite(base.evidence):
        raise InputError("the baseline cannot be recalibrated", remedy="mend the rig file")
    base = refine(search, base, ())
    return Case(plant, data, search, given.rows, base)


def judge(case: Case, tell: Tell) -> Judged:
    """Hypotheses, ports and the verdict's kind."""
    plant, search, base = case.plant, case.search, case.base
    tell("attributing the gap to ports, and looking for its cause")
    findings, places = side_by_side(
        lambda: find_terms(search, base, plant.candidates, tell, plant.known),
        lambda: _attributed(case, base),
    )
    findings, besides = _rest(case, of_material_parts(findings, partial(_change_without, case)), tell)
    best = heaviest(findings)
    left = left_over(search, base, best)
    strained = most_strained(findings, lambda mode: strain_of(mode, plant.nuisances))
    alone = anywhere(places)
    place = max(places, key=lambda each: each.evidence)
    if _change(case, place.held_out - base.prediction.rows).is_trace:
        alone = -np.inf
    unknown = unknown_of(findings, alone, besides, strained.weight)
    weighed = weigh(findings, unknown)
    kind, chosen = kind_of(weighed, _change_without(case, best, best.terms), left)
    found = Judged(findings, tuple(places), tuple(weighed), unknown, strained, kind, chosen, left)
    return found if kind != "unknown" or unknown.reason == "strain" else _looked_at_closer(case, found, tell)


def _looked_at_closer(case: Case, judged: Judged, tell: Tell) -> Judged:
    """Something unknown, seen beside an effect that does nearly the same, if there is one.

    It may sit elsewhere than it seems without it, or only be that effect by another law.
    """
    singles = [mode for mode in judged.findings.modes if len(mode.terms) == 1]
    best = max(singles, key=lambda mode: mode.evidence, default=case.base)
    left, change = left_over(case.search, case.base, best), _change_without(case, best, best.terms)
    if not best.terms or left > LEFT_BY_ANOTHER_LAW or not change.matters:
        return judged
    tell(f"what {best.terms[0]} leaves")
    prior, port = prior_of(best.terms, len(judged.findings.scores)), CATALOGUE[best.terms[0]].port.value
    names = {port, *may_be_imitated(judged.places, case.base.evidence)}
    places = [each for each in _attributed(case, best) if each.name in names]
    closer = replace(judged, besides=sittings_of(places, prior))
    own, elsewhere = at_and_elsewhere(closer.sittings, port)
    if own < elsewhere + CONFUSED:
        return closer
    weighed = reweighed(judged.weighed, best, own + log(PRIOR_UNKNOWN), elsewhere + log(PRIOR_UNKNOWN))
    chosen = next(each for each in weighed if each.mode is best)
    return replace(closer, weighed=tuple(weighed), kind="effect", chosen=chosen, left=left, another_law=True)


def _rest(case: Case, findings: Findings, tell: Tell) -> tuple[Findings, float]:
    """The findings, and the log evidence of a law beside the heaviest of them, if this leaves something that matters.

    Where it leaves much, the effects at the ports where such a law explains most are tried beside its members.
    """
    best, search, candidates = heaviest(findings), case.search, case.plant.candidates
    left = left_over(search, case.base, best)
    # Two effects together imitate a third one well, but for a small rest.
    if not best.terms or left <= (EXPLAINED if len(best.terms) == 1 else 0.0):
        return findings, -np.inf
    tell(f"what {' + '.join(best.terms)} leaves")
    places = _attributed(case, best)
    if left > LEFT:
        ports = {each.name for each in sorted(places, key=lambda each: -each.evidence)[:NEAREST]}
        near = [term for term in candidates if CATALOGUE[term.name].port.value in ports]
        more = with_partners_among(search, findings, near, best, candidates, tell)
        findings = of_material_parts(more, partial(_change_without, case))
        if heaviest(findings).terms != best.terms:
            return _rest(case, findings, tell)
    place = max(places, key=lambda each: each.evidence)
    beside = _change(case, place.held_out - best.prediction.rows)
    return findings, anywhere(places) if beside.matters else -np.inf


def settle(case: Case, judged: Judged, tell: Tell) -> tuple[Case, Judged]:
    """The case and its judgement with the named effects found again, free of what finitely many nodes cost."""
    mode = judged.chosen.mode
    if judged.kind not in ("effect", "several") or mode is None:
        return case, judged
    tell(f"settling {' + '.join(mode.terms)}")
    plant = case.plant.corrected(mode.terms, mode.values, mode.prediction.near)
    search = search_of(plant, case.data)
    terms = {term.name: term for term in plant.candidates}
    found = climb(search, tuple(terms[name] for name in mode.terms), mode.values, mode.prediction.near)
    if plant is case.plant or not np.isfinite(found.evidence):
        return case, replace(judged, settled=False)
    chosen = replace(judged.chosen, mode=found)
    weighed = tuple(chosen if each is judged.chosen else each for each in judged.weighed)
    modes = tuple(found if each is mode else each for each in judged.findings.modes)
    findings = replace(judged.findings, modes=modes)
    return replace(case, plant=plant, search=search), replace(
        judged, findings=findings, weighed=weighed, chosen=chosen
    )


def _attributed(case: Case, mode: Mode) -> list[Attribution]:
    """What a law at each port would explain beyond a hypothesis."""
    p = case.plant.values(mode.values)
    return attribute(case.search, mode, places_of(case.plant, mode.terms, p, mode.prediction.near))


def _change_without(case: Case, mode: Mode, gone: Sequence[str]) -> Change:
    """What some terms of a hypothesis do to the response, all other parameters as they are.

    In the channel where they do most; infinite where there is no motion without them.
    """
    if not gone:
        return Change(0.0, 0.0)
    left = tuple(name for name in mode.terms if name not in gone)
    wanted = [each.name for each in case.plant.nuisances]
    taken = {each.name for name in gone for each in case.plant.catalogue[name].parameters}
    values = {name: value for name, value in mode.values.items() if name not in taken or name in wanted}
    without = case.plant.predict(left, values, wanted, case.base.prediction.near)
    if not without.solved:
        return Change(np.inf, np.inf)
    return _change(case, mode.prediction.rows - without.rows)


def _change(case: Case, rows: NDArray[np.float64]) -> Change:
    """A change of the rows, in the channel where it is most."""
    channel, test = case.plant.channel, case.data.test
    return Change(_share(case, rows, channel), _share(case, rows, channel * case.data.tests + test))


def _share(case: Case, rows: NDArray[np.float64], group: NDArray[np.intp]) -> float:
    """A change of the rows as a share of the response, in the group of rows where it is most."""
    squares, whole = np.bincount(group, rows**2), np.bincount(group, case.data.measured**2)
    return float(np.sqrt(np.max(squares[whole > 0.0] / whole[whole > 0.0])))
