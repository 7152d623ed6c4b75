"""The diagnosis of a campaign: recalibrate, locate, select, hold out, and say what is missing.

The stages in order, each a whole record:

1. the baseline recalibrated (:func:`~savgs_ident.diagnosis.model_selection.recalibrate`);
2. hypotheses and ports compared (:func:`~savgs_ident.diagnosis.model_selection.select_model`);
3. what is named found again on a finer mesh, while the next tests are looked for and the rivals predict tests that
   were left out;
4. the corrected model: the named effects, or a law learned at the port of something unknown;
5. the result, put together once from all of these.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import InputError
from savgs_ident.core.executor import in_parallel, side_by_side
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.diagnosis.candidates import candidates_of, confusable_of, estimates_among, not_judgeable_of
from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FlexibleMember
from savgs_ident.diagnosis.gap import Rows, shrinks
from savgs_ident.diagnosis.held_out import HeldOut, hold_out, select_in_folds
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.model_selection import (
    recalibrate,
    refit_named,
    select_model,
    settle,
)
from savgs_ident.diagnosis.narrative import write_verdict, write_warnings
from savgs_ident.diagnosis.problem import AbstractProblem
from savgs_ident.diagnosis.result import (
    NONE,
    UNKNOWN,
    Candidate,
    Diagnosis,
    DiagnosisSettings,
    Estimate,
    ForceLoop,
    FurtherShrink,
    Hypothesis,
    Learned,
    NextTest,
    PortShare,
)
from savgs_ident.diagnosis.search import hypothesis_of
from savgs_ident.diagnosis.sweep import ModelPoint, sweep_shrink
from savgs_ident.diagnosis.verdict import indistinguishable, most_probable
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import coefficients_at
from savgs_ident.inference.find_map import LaplaceFit
from savgs_ident.inference.observations import Data
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse

FurtherRecording = Callable[[AbstractProblem, Sequence[ModelPoint]], FurtherShrink | None]
"""Predicts a recording that takes no part, by two or three models: as given, recalibrated, with what is named."""


def baseline_problem(
    measured: HarmonicResponse,
    plant: AbstractPlant,
    parameters: ParameterTable,
    catalogue: Mapping[str, Effect],
    settings: DiagnosisSettings,
    models: Iterable[tuple[str, ...]] = (),
) -> tuple[DwellProblem, Data]:
    """A plant without effects, its catalogue less the effects that are left out, and the response as data.

    ``models`` are sets of effects that such plants are known to have together. Raises :class:`InputError` for effects
    that do not exist, for effects of the baseline that are to be left out, and for a response that cannot be used.
    """
    offered = offered_effects(catalogue, settings)
    return dwell_problem(
        measured,
        plant,
        parameters,
        offered,
        settings.baseline,
        settings.free,
        settings.orders,
        settings.periodic,
        models,
        settings.constants,
    )


def offered_effects(catalogue: Mapping[str, Effect], settings: DiagnosisSettings) -> dict[str, Effect]:
    """The catalogue less the effects that are left out.

    Raises :class:`InputError` for effects that do not exist, and for effects of the baseline that are to be left out.
    """
    absent = sorted({*settings.without, *settings.baseline} - set(catalogue))
    if absent:
        raise InputError(
            f"there is no effect '{absent[0]}'", remedy="choose among: " + ", ".join(sorted(catalogue))
        )
    needed = sorted({*settings.without} & {*settings.baseline})
    if needed:
        raise InputError(
            f"the effect '{needed[0]}' is part of the baseline",
            remedy="leave out effects that the baseline lacks",
        )
    return {name: each for name, each in catalogue.items() if name not in settings.without}


def diagnose_dwells(
    plant: DwellProblem,
    data: Data,
    measured: HarmonicResponse,
    given: Model,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    progress: Progress = no_progress,
    sweep: SweepResponse | None = None,
) -> Diagnosis:
    """Diagnose the gap between the baseline of a plant in dwells and the measured response.

    ``plant`` and ``data`` are what is compared, ``values`` (SI, by name) those that the baseline is given with. A
    ``sweep`` is no part of the diagnosis: it is predicted, and compared. ``given``, the model as known before any
    fit, is handed on to the result.

    Look at ``converged`` of the result. Raises :class:`InputError` for a plant whose baseline has no periodic motion.
    """

    def predict_sweep(problem: AbstractProblem, points: Sequence[ModelPoint]) -> FurtherShrink | None:
        assert sweep is not None
        assert isinstance(problem, DwellProblem)
        progress("predicting the sweep")
        return sweep_shrink(problem, sweep, points)

    further = None if sweep is None else predict_sweep
    return diagnose_problem(plant, data, given, settings, values, progress, further, measured)


def diagnose_problem(
    plant: AbstractProblem,
    data: Data,
    given: Model,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    progress: Progress = no_progress,
    further: FurtherRecording | None = None,
    measured: HarmonicResponse | None = None,
) -> Diagnosis:
    """Diagnose the gap between a baseline and its data, of whatever kind these are.

    ``further`` predicts a recording that takes no part; ``measured``, the dwells that the data come from, is handed
    on to the result like ``given``.

    Look at ``converged`` of the result. Raises :class:`InputError` for a baseline that has no solution.
    """
    # Threads of the linear algebra only get in each other's way: its matrices are small, and there are many.
    with threadpool_limits(1, "blas"):
        return _diagnose(plant, data, measured, given, settings, values, progress, further)


def _diagnose(
    plant: AbstractProblem,
    data: Data,
    measured: HarmonicResponse | None,
    given: Model,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    progress: Progress,
    further: FurtherRecording | None,
) -> Diagnosis:
    began = time.perf_counter()
    problem = recalibrate(plant, data, values, progress, settings.constants)
    selected = select_model(problem, progress)
    others = [each for each in _compared(problem, selected) if each is not selected.chosen.mode]
    (refitted, evidence), (tests, held) = side_by_side(
        lambda: refit_named(problem, selected, progress),
        lambda: (_next_tests(problem, selected, progress), _held_out(problem, others, progress)),
    )
    member = evidence.named_law or (evidence.offered if evidence.kind == "unknown" else None)
    law = None if member is None else member.law
    fits = [] if evidence.chosen.mode is None or law is not None else [evidence.chosen.mode]
    last, apart = side_by_side(
        lambda: {**_held_out(refitted, fits, progress), **_held_out_by_member(member, progress, settings)},
        lambda: _predict_further(refitted, evidence, law, values, further),
    )
    held = {**held, **last}
    held = {**held, UNKNOWN: _held_out_unknown(evidence, held[NONE])}
    if evidence.kind == "unknown" and member is not None and held[member.hypothesis].mean <= held[NONE].mean:
        law = None

    base, model = problem.base, _corrected_model(refitted, evidence, law)
    together, by_channel = shrinks(data, _left_out_rows(problem, evidence, held, model))
    settled = settle(evidence, together, problem.constants)
    if settled is not evidence:
        evidence, law = settled, None
        model = _corrected_model(refitted, evidence, law)
        together, by_channel = shrinks(data, _left_out_rows(problem, evidence, held, model))
        apart = _predict_further(refitted, evidence, law, values, further)
    # Before what is named was refitted: the alternatives were not.
    candidates = candidates_of(
        evidence.findings, evidence.weighed, held, refitted.search, problem.families, problem.constants
    )
    alternatives = indistinguishable(selected.weighed, selected.chosen, problem.constants)
    verdict = write_verdict(refitted, evidence, alternatives, together)
    return Diagnosis(
        model=settings.model,
        effects=settings.baseline,
        given=given,
        parameters=base.values,
        identified=model.fit.values,
        intervals=estimates_among(model.fit, plant.free),
        verdict=verdict,
        ports=_port_shares(evidence, candidates),
        map=plant.gap_map(data, base.prediction.rows),
        cycle=plant.cycle_positions(data, base.prediction.rows),
        regimes=plant.regimes(problem.search.data, base),
        candidates=candidates,
        shrink=together,
        by_channel=by_channel,
        further=apart,
        next_tests=tests,
        not_judgeable=not_judgeable_of(evidence.findings, problem.constants),
        confusable=confusable_of(evidence.findings, problem.constants),
        loops=_loops(refitted, model, evidence, law, verdict.ports, progress),
        responses=plant.responses(data, problem.given, base.prediction.rows, model.rows),
        measured=measured,
        converged=all(each.status.ok for each in _decisive_fits(problem, selected, evidence, law)),
        warnings=write_warnings(
            refitted, evidence, model.fit, held[model.hypothesis].beyond - held[NONE].beyond
        ),
        learned=None if law is None else _offered(law),
        wall_s=time.perf_counter() - began,
    )


def _held_out_by_member(
    member: FlexibleMember | None, progress: Progress, settings: DiagnosisSettings
) -> dict[Hypothesis, HeldOut]:
    """What a learned law predicts of tests left out."""
    if member is None:
        return {}
    progress(f"leaving tests out: {member.hypothesis}")
    return {member.hypothesis: member.law.held_out(settings.constants)}


def _held_out_unknown(evidence: DiagnosisEvidence, without: HeldOut) -> HeldOut:
    """What a law known to first order predicts of tests left out; the baseline where it does worse than that."""
    return max(evidence.localisation.held_out, without, key=lambda each: each.mean)


def _port_shares(evidence: DiagnosisEvidence, candidates: Sequence[Candidate]) -> tuple[PortShare, ...]:
    """Shares of all ports, with the probability that something acts there."""
    unknown = next((each.probability for each in candidates if each.hypothesis == UNKNOWN), 0.0)

    def probability(port: str) -> float:
        named = sum(each.probability for each in candidates if port in each.ports)
        return named + (unknown if port == evidence.port else 0.0)

    return tuple(
        PortShare(each.name, each.share, each.free_input_share, probability(each.name))
        for each in evidence.localisations
    )


def _left_out_rows(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    held: Mapping[Hypothesis, HeldOut],
    model: "_CorrectedModel",
) -> Rows:
    """Rows of the tests when each was left out, by the three models; what is named is selected anew without each."""
    after = held[model.hypothesis].rows
    if model.hypothesis not in (NONE, UNKNOWN):
        priors = {each.hypothesis: each.weight - each.mode.evidence for each in evidence.weighed if each.mode}
        known = [name for name, each in held.items() if each.evidence and name in priors]
        after = select_in_folds(
            problem.data, [held[name] for name in known], [priors[name] for name in known], problem.constants
        )
    return Rows(
        before=problem.given,
        recalibrated=held[NONE].rows,
        after=after,
        channel=problem.plant.channel,
        channels=problem.plant.channels,
    )


@dataclass(frozen=True)
class _CorrectedModel:
    """The model with what the verdict puts into it.

    Attributes:
        hypothesis: what that is.
        fit: the fit of the named effects; of the baseline where none are named.
        rows: of the response that it predicts [unit of each reading], (m,).
    """

    hypothesis: Hypothesis
    fit: LaplaceFit
    rows: NDArray[np.float64]


def _corrected_model(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, law: LearnedLaw | None
) -> _CorrectedModel:
    if law is not None:
        member = next(each for each in evidence.flexible if each.law is law)
        return _CorrectedModel(member.hypothesis, law.mode, law.mode.prediction.rows)
    if evidence.kind == "unknown":
        return _CorrectedModel(UNKNOWN, problem.base, evidence.localisation.held_out.rows)
    fit = evidence.chosen.mode or problem.base
    return _CorrectedModel(hypothesis_of(fit), fit, fit.prediction.rows)


def _decisive_fits(
    problem: DiagnosisProblem,
    selected: DiagnosisEvidence,
    evidence: DiagnosisEvidence,
    law: LearnedLaw | None,
) -> list[LaplaceFit]:
    """The fits that the verdict stands on."""
    heaviest = most_probable(selected.findings, problem.constants)
    fits = [problem.base, heaviest, selected.chosen.mode, evidence.chosen.mode]
    return [each for each in (*fits, None if law is None else law.mode) if each is not None]


def _compared(problem: DiagnosisProblem, evidence: DiagnosisEvidence) -> list[LaplaceFit]:
    """The baseline and the two best fitted hypotheses: those that predict tests that were left out."""
    return [problem.base, *sorted(evidence.findings.modes, key=lambda each: -each.evidence)[:2]]


def _held_out(
    problem: DiagnosisProblem, modes: Sequence[LaplaceFit], progress: Progress
) -> dict[Hypothesis, HeldOut]:
    """Predictions of tests left out, by hypothesis."""

    def without_parts(mode: LaplaceFit) -> tuple[Hypothesis, HeldOut]:
        hypothesis = hypothesis_of(mode)
        progress(f"leaving tests out: {hypothesis}")
        return hypothesis, hold_out(problem.search, mode, problem.terms(hypothesis), problem.constants)

    return dict(in_parallel(without_parts, modes))


def _offered(law: LearnedLaw) -> Learned:
    every = {name: Estimate(name, 0.0, 0.0, 0.0, unit) for name, unit in law.units.items()}
    fitted = {each.name: each for each in estimates_among(law.mode, coefficients_at(law.port))}
    return Learned(law.name, law.port.location, tuple((every | fitted).values()), law.values)


def _predict_further(
    problem: DiagnosisProblem,
    evidence: DiagnosisEvidence,
    law: LearnedLaw | None,
    values: Mapping[str, float],
    further: FurtherRecording | None,
) -> FurtherShrink | None:
    """The gap of a further recording: of the baseline as given, recalibrated, and with what is named.

    Nothing comes after where a law is known to first order alone: no model can be solved with that.
    """
    if further is None:
        return None
    base = problem.base
    points: list[ModelPoint] = [((), values), ((), base.values)]
    if law is not None:
        return further(law.problem, [*points, ((law.name,), law.values)])
    if evidence.kind == "unknown":
        return further(problem.plant, points)
    fit = evidence.chosen.mode or base
    return further(problem.plant, [*points, (fit.terms, fit.values)])


def _loops(
    problem: DiagnosisProblem,
    model: _CorrectedModel,
    evidence: DiagnosisEvidence,
    law: LearnedLaw | None,
    ports: Sequence[str],
    progress: Progress,
) -> tuple[ForceLoop, ...]:
    """The signal inferred at the first named port, beside the law that is named or learned there."""
    found = next((each for each in evidence.localisations if each.name in ports[:1]), None)
    if found is None:
        return ()
    progress("inferring the signal at the port")
    effects = [problem.plant.catalogue[name] for name in model.hypothesis.effects]
    effects += [] if law is None else [law.effect]
    here = next((each for each in effects if each.port.location == ports[0]), None)
    values = problem.base.values | model.fit.values | ({} if law is None else law.values)
    return problem.plant.loops(values, problem.base.prediction.warm_start, found, here)


def _next_tests(
    problem: DiagnosisProblem, evidence: DiagnosisEvidence, progress: Progress
) -> tuple[NextTest, ...]:
    """Tests that separate the chosen hypothesis from the best fitted one that looks like it."""
    chosen = evidence.chosen.mode
    if chosen is None or len(chosen.terms) != 1:
        return ()
    pairs = [each.effects for each in confusable_of(evidence.findings, problem.constants)]
    alike = {name for pair in pairs if chosen.terms[0] in pair for name in pair} - {*chosen.terms}
    rivals = [mode for mode in evidence.findings.modes if len(mode.terms) == 1 and mode.terms[0] in alike]
    if not rivals:
        return ()
    rival = max(rivals, key=lambda each: each.evidence)
    progress(f"looking for a test that separates {chosen.terms[0]} from {rival.terms[0]}")
    return problem.plant.next_tests(problem.search, chosen, rival)
