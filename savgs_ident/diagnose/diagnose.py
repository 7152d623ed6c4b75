"""The diagnosis of a campaign: recalibrate, attribute, score, fit, hold out, and say what is missing."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.candidates import (
    candidates_of,
    confusable_of,
    estimates_among,
    not_judgeable_of,
)
from savgs_ident.diagnose.engine.climb import Mode
from savgs_ident.diagnose.engine.heldout import HeldOut, held_out_by_law, hold_out
from savgs_ident.diagnose.engine.parallel import in_parallel, side_by_side
from savgs_ident.diagnose.engine.search import Tell
from savgs_ident.diagnose.judgement import Case, Judged, judge, recalibrate, settle
from savgs_ident.diagnose.result import (
    Diagnosis,
    ForceLoop,
    Learned,
    NextTest,
    PortShare,
    Responses,
    SweepShrink,
)
from savgs_ident.diagnose.rig.gap import Rows, shrinks
from savgs_ident.diagnose.rig.learning import LearnedLaw, can_be_learned, learn
from savgs_ident.diagnose.rig.loops import loops_of
from savgs_ident.diagnose.rig.next_test import next_tests
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.diagnose.rig.sweep import Hypothesis, sweep_shrink
from savgs_ident.diagnose.rig.where import cycle_positions, gap_map
from savgs_ident.diagnose.settings import DiagnosisSettings
from savgs_ident.diagnose.verdict import probabilities, rivals_of
from savgs_ident.diagnose.words import verdict_of, warnings_of
from savgs_ident.effects.learned.forces import coefficients_at
from savgs_ident.effects.registry import CATALOGUE
from savgs_ident.model.effect import Port
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.sweep_response import SweepResponse

Corrected = tuple[RigPlant, tuple[str, ...], Mapping[str, float]]
"""A plant, the terms in it, and values by name [SI]."""


def diagnose_response(
    measured: HarmonicResponse,
    rig: Rig,
    settings: DiagnosisSettings | None = None,
    values: Mapping[str, float] | None = None,
    progress: Tell | None = None,
    sweep: SweepResponse | None = None,
) -> Diagnosis:
    """Diagnose the gap between a rig's baseline model and a measured response.

    ``rig`` is the rig as known before any fit; ``values`` (SI, by name) are those that the baseline is given with,
    the rig's own where left out. A ``sweep`` of the cam is no part of the diagnosis: it is predicted, and compared.

    Look at ``converged`` of the result. Raises :class:`InputError` for a response that cannot be used, for names
    that do not exist, and for a rig whose baseline has no periodic motion.
    """
    # Threads of the linear algebra only get in each other's way: its matrices are small, and there are many.
    with threadpool_limits(1, "blas"):
        return _diagnose(
            measured, rig, settings or DiagnosisSettings(), values or {}, progress or _silent, sweep
        )


def _diagnose(
    measured: HarmonicResponse,
    rig: Rig,
    options: DiagnosisSettings,
    values: Mapping[str, float],
    tell: Tell,
    sweep: SweepResponse | None,
) -> Diagnosis:
    began = time.perf_counter()
    case = recalibrate(measured, rig, options, values, tell)
    first = judge(case, tell)
    aside = [each for each in _compared(case, first) if each is not first.chosen.mode]
    (case, judged), (tests, held) = side_by_side(
        lambda: settle(case, first, tell),
        lambda: (_next_tests(case, first, tell), _held_out(case, aside, tell)),
    )
    named = judged.chosen.mode if judged.kind in ("effect", "several") else None
    chosen = [] if judged.chosen.mode is None else [judged.chosen.mode]
    law = _learned(case, judged, held["none"], tell) if judged.kind == "unknown" else None
    after = _after(case, judged, named, law)
    last, swept = side_by_side(
        lambda: _held_out(case, chosen, tell),
        lambda: _predict_sweep(case, values, after, sweep, tell),
    )
    linear = held_out_by_law(case.search, judged.place.held_out)
    held = {**held, **last, "unknown": linear if law is None else law.held}
    # Before what is named was settled: its rivals were not.
    rivals = rivals_of(list(first.weighed), first.chosen)
    found = _assemble(case, judged, rivals, named, law, held, measured, options, tell)
    return replace(found, sweep=swept, next_tests=tests, wall_s=time.perf_counter() - began)


def _learned(case: Case, judged: Judged, without: HeldOut, tell: Tell) -> LearnedLaw | None:
    """The law at the port of something unknown, on the nonlinear rig; None where that does not help."""
    if not can_be_learned(judged.seat):
        return None
    tell(f"learning a force at the port {judged.seat}")
    law = learn(case.plant, case.data, case.base, judged.seat)
    return law if law.mode.status.ok and law.held.mean > without.mean else None


def _after(case: Case, judged: Judged, named: Mode | None, law: LearnedLaw | None) -> Corrected | None:
    """The plant with what the verdict puts into it; None for a law to first order: no model can be solved with it."""
    if law is not None:
        return law.plant, (law.name,), law.values
    if judged.kind == "unknown":
        return None
    mode = named or case.base
    return case.plant, mode.terms, mode.values


def _compared(case: Case, judged: Judged) -> list[Mode]:
    """The baseline and the two best fitted hypotheses: those that predict tests that they were not fitted to."""
    return [case.base, *sorted(judged.findings.modes, key=lambda each: -each.evidence)[:2]]


def _held_out(case: Case, modes: Sequence[Mode], tell: Tell) -> dict[str, HeldOut]:
    """Left-out predictions by name of the hypothesis."""
    terms = {term.name: term for term in case.plant.candidates}

    def without_parts(mode: Mode) -> tuple[str, HeldOut]:
        name = " + ".join(mode.terms) or "none"
        tell(f"leaving tests out: {name}")
        return name, hold_out(case.search, mode, tuple(terms[each] for each in mode.terms))

    return dict(in_parallel(without_parts, modes))


def _assemble(
    case: Case,
    judged: Judged,
    rivals: tuple[str, ...],
    named: Mode | None,
    law: LearnedLaw | None,
    held: dict[str, HeldOut],
    measured: HarmonicResponse,
    options: DiagnosisSettings,
    tell: Tell,
) -> Diagnosis:
    plant, data, base = case.plant, case.data, case.base
    after = named or base
    rows = Rows(
        before=case.given,
        recalibrated=held["none"].rows,
        after=held["unknown" if judged.kind == "unknown" else " + ".join(after.terms) or "none"].rows,
        channel=plant.channel,
    )
    together, by_channel = shrinks(data, rows)
    confusable = confusable_of(judged.findings)
    verdict = verdict_of(judged, rivals, together)
    shares = probabilities(list(judged.weighed))
    fitted = after.prediction.rows
    if judged.kind == "unknown":
        fitted = judged.place.held_out if law is None else law.mode.prediction.rows
    tell("inferring the signal at the port")
    loops = _loops(case, judged, named, verdict.ports)
    return Diagnosis(
        model=options.model,
        effects=options.baseline,
        rig=plant.rig,
        parameters=base.values,
        identified=after.values,
        verdict=verdict,
        ports=tuple(PortShare(each.name, each.share, each.reach) for each in judged.places),
        map=gap_map(plant, data, base.prediction.rows),
        cycle=cycle_positions(plant, data, base.prediction.rows),
        candidates=candidates_of(judged.findings, judged.weighed, shares, held, case.search),
        shrink=together,
        by_channel=by_channel,
        sweep=None,
        next_tests=(),
        not_judgeable=not_judgeable_of(judged.findings),
        confusable=confusable,
        loops=loops,
        responses=_responses(plant, case.given, base.prediction.rows, fitted),
        measured=measured,
        converged=base.status.ok and after.status.ok,
        warnings=warnings_of(case, after, judged, together),
        wall_s=0.0,
        learned=None if law is None else _offered(law),
    )


def _offered(law: LearnedLaw) -> Learned:
    own = coefficients_at(Port(law.port))
    return Learned(law.name, law.port, estimates_among(law.mode, own), law.values)


def _predict_sweep(
    case: Case,
    values: Mapping[str, float],
    after: Corrected | None,
    sweep: SweepResponse | None,
    tell: Tell,
) -> SweepShrink | None:
    """The gap of a recorded sweep: of the baseline as given, recalibrated, and with what is named."""
    if sweep is None:
        return None
    tell("predicting the sweep")
    plant = case.plant if after is None else after[0]
    hypotheses: list[Hypothesis] = [((), values), ((), case.base.values)]
    return sweep_shrink(plant, sweep, hypotheses if after is None else [*hypotheses, after[1:]])


def _responses(plant: RigPlant, *rows: NDArray[np.float64]) -> Responses:
    return Responses(*(plant.likelihood.harmonics(each[None], plant.shape)[0] for each in rows))


def _loops(case: Case, judged: Judged, named: Mode | None, ports: Sequence[str]) -> tuple[ForceLoop, ...]:
    if not ports:
        return ()
    found = next((each for each in judged.places if each.name == ports[0]), None)
    if found is None:
        return ()
    values = case.base.values | ({} if named is None else named.values)
    effect = None
    if named is not None:
        effect = next(
            (CATALOGUE[name] for name in named.terms if CATALOGUE[name].port.value == ports[0]), None
        )
    return loops_of(case.plant, case.plant.values(values), case.base.prediction.near, found, effect)


def _next_tests(case: Case, judged: Judged, tell: Tell) -> tuple[NextTest, ...]:
    """Tests that separate the chosen hypothesis from the best fitted one that looks like it."""
    chosen = judged.chosen.mode
    if chosen is None or len(chosen.terms) != 1:
        return ()
    pairs = [each.effects for each in confusable_of(judged.findings)]
    alike = {name for pair in pairs if chosen.terms[0] in pair for name in pair}
    rivals = [
        mode
        for mode in judged.findings.modes
        if len(mode.terms) == 1 and mode.terms[0] in alike - {*chosen.terms}
    ]
    if not rivals:
        return ()
    rival = max(rivals, key=lambda each: each.evidence)
    tell(f"looking for a test that tells {chosen.terms[0]} from {rival.terms[0]}")
    return next_tests(case.search, case.plant, chosen, rival)


def _silent(line: str) -> None:
    del line
