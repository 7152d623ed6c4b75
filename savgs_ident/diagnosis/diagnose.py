"""The diagnosis of a campaign: recalibrate, locate, select, hold out, and say what is missing.

The stages in order, each a whole record:

1. the baseline recalibrated (:func:`~savgs_ident.diagnosis.model_selection.recalibrate`);
2. hypotheses and ports compared (:func:`~savgs_ident.diagnosis.model_selection.compare_models`), once more where a
   baseline that drifts is more probable (:mod:`~savgs_ident.diagnosis.drift`), and decided among;
3. what is named found again on a finer mesh, while the next tests are looked for and the alternatives predict tests
   that were left out;
4. the corrected model: the named effects, or a law learned at the port of something unknown;
5. the result, put together once from all of these.
"""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress, no_progress
from savgs_ident.diagnosis.candidates import candidates_of, confusable_of, estimates_among, not_judgeable_of
from savgs_ident.diagnosis.caveats import write_further, write_warnings
from savgs_ident.diagnosis.conclusion import (
    CorrectedModel,
    FurtherRecording,
    conclude,
    leave_tests_out,
)
from savgs_ident.diagnosis.drift import drifting
from savgs_ident.diagnosis.dwell_problem import DwellProblem, dwell_problem
from savgs_ident.diagnosis.evidence import DiagnosisEvidence, DiagnosisProblem, FittedHypotheses
from savgs_ident.diagnosis.gap import FurtherShrink
from savgs_ident.diagnosis.learning import LearnedLaw
from savgs_ident.diagnosis.model_selection import (
    compare_models,
    decide_among,
    recalibrate,
)
from savgs_ident.diagnosis.narrative import write_verdict
from savgs_ident.diagnosis.problem import AbstractProblem, DrawnLaw, ModelPoint, drawn_law
from savgs_ident.diagnosis.result import (
    NONE,
    UNKNOWN,
    Candidate,
    Diagnosis,
    DiagnosisSettings,
    Estimate,
    ForceLoop,
    Learned,
    PortShare,
    Verdict,
)
from savgs_ident.diagnosis.sweep_gap import sweep_shrink
from savgs_ident.diagnosis.verdict import indistinguishable, most_probable
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned_functions import coefficients_at
from savgs_ident.inference.laplace_fit import LaplaceFit
from savgs_ident.inference.observations import Data
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse

Watch = Callable[[DiagnosisProblem, FittedHypotheses], None]
"""Is given the problem and its fitted hypotheses when the diagnosis is done."""


def nobody(problem: DiagnosisProblem, fitted: FittedHypotheses) -> None:
    """Watch nothing."""
    del problem, fitted


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
    watch: Watch = nobody,
    origin: Origin = NO_ORIGIN,
) -> Diagnosis:
    """Diagnose the gap between the baseline of a plant in dwells and the measured response.

    ``plant`` and ``data`` are what is compared, ``values`` (SI, by name) those that the baseline is given with. A
    ``sweep`` is no part of the diagnosis: it is predicted, and compared. ``given``, the model as known before any
    fit, is handed on to the result, and so is its ``origin``; ``watch`` gets what the verdict was decided from.

    Look at ``converged`` of the result. Raises :class:`InputError` for a plant whose baseline has no periodic motion.
    """

    def predict_sweep(points: Sequence[ModelPoint]) -> FurtherShrink | None:
        assert sweep is not None
        progress("predicting the sweep")
        return sweep_shrink(sweep, points)

    further = None if sweep is None else predict_sweep
    return diagnose_problem(plant, data, given, settings, values, progress, further, measured, watch, origin)


def diagnose_problem(
    plant: AbstractProblem,
    data: Data,
    given: Model,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    progress: Progress = no_progress,
    further: FurtherRecording | None = None,
    measured: HarmonicResponse | None = None,
    watch: Watch = nobody,
    origin: Origin = NO_ORIGIN,
) -> Diagnosis:
    """Diagnose the gap between a baseline and its data, of whatever kind these are.

    ``further`` predicts a recording that takes no part; ``measured``, the dwells that the data come from, is handed
    on to the result like ``given`` and ``origin``; ``watch`` gets what the verdict was decided from.

    Look at ``converged`` of the result. Raises :class:`InputError` for a baseline that has no solution, and for a
    single test.
    """
    if data.tests < 2:
        raise InputError(
            "there is one test only, so that none can be left out to see whether what is found predicts it",
            remedy=f"record {settings.constants.fewest_held_out_tests} tests or more, at different frequencies",
        )
    # Threads of the linear algebra only get in each other's way: its matrices are small, and there are many.
    with threadpool_limits(1, "blas"):
        began = time.perf_counter()
        recalibrated = recalibrate(plant, data, values, progress, settings.constants)
        _refuse_mistaken(recalibrated)
        problem, fitted = fit_hypotheses(recalibrated, progress)
        found = _concluded(
            problem, fitted, measured, given, settings, values, progress, further, began, origin
        )
        watch(problem, fitted)
        return found


def diagnose_recalibrated(
    problem: DiagnosisProblem, given: Model, settings: DiagnosisSettings, values: Mapping[str, float]
) -> Diagnosis:
    """The same of a baseline that is recalibrated already, without a word on the way."""
    began = time.perf_counter()
    found, fitted = fit_hypotheses(problem, no_progress)
    return _concluded(found, fitted, None, given, settings, values, no_progress, None, began, NO_ORIGIN)


MENDED = 0.1
"""Part of what the baseline misses as given, or a model without motion, up to which calibration is an explanation."""


def _refuse_mistaken(problem: DiagnosisProblem) -> None:
    """Raises :class:`InputError` where a channel has another unit or sign, which no effect should have to explain."""
    mistaken = problem.plant.mistaken(problem.given)
    measured, size = problem.search.data.measured, problem.search.data.discrepancy_scale
    nothing, given, base = (
        float(np.linalg.norm((rows - measured) / size))
        for rows in (np.zeros_like(measured), problem.given, problem.base.prediction.rows)
    )
    if mistaken and base > MENDED * min(nothing, given):
        raise InputError(mistaken, remedy="mend its header, or give its unit and scale in channels.toml")


def fit_hypotheses(
    problem: DiagnosisProblem, progress: Progress
) -> tuple[DiagnosisProblem, FittedHypotheses]:
    """The problem, with a baseline that drifts where that is most probable, and its hypotheses fitted."""
    fitted = compare_models(problem, progress)
    drifts = drifting(problem, decide_among(problem, fitted), progress)
    return (problem, fitted) if drifts is None else (drifts, compare_models(drifts, progress))


def _concluded(
    problem: DiagnosisProblem,
    fitted: FittedHypotheses,
    measured: HarmonicResponse | None,
    given: Model,
    settings: DiagnosisSettings,
    values: Mapping[str, float],
    progress: Progress,
    further: FurtherRecording | None,
    began: float,
    origin: Origin,
) -> Diagnosis:
    selected = decide_among(problem, fitted)
    found = conclude(leave_tests_out(problem, selected, values, progress, further), values, further)
    plant, data, recalibrated = problem.plant, problem.data, problem.search.followed(problem.base)
    base, evidence, model = problem.base, found.evidence, found.model
    # Before what is named was refitted: the alternatives were not.
    candidates = candidates_of(
        evidence.findings,
        evidence.weighed,
        found.held,
        found.problem.search,
        problem.families,
        problem.constants,
    )
    alternatives = indistinguishable(selected.weighed, selected.chosen, problem.constants)
    verdict = write_verdict(found.problem, evidence, alternatives, found.gap)
    beyond = found.held[model.hypothesis].beyond - found.held[NONE].beyond
    return Diagnosis(
        model=settings.model,
        effects=settings.baseline,
        given=given,
        parameters=base.values,
        identified=model.fit.values,
        intervals=estimates_among(found.problem.search, model.fit, plant.free),
        verdict=verdict,
        ports=_port_shares(evidence, candidates),
        map=plant.gap_map(data, recalibrated),
        cycle=plant.cycle_positions(data, recalibrated),
        regimes=plant.regimes(problem.search.data, base),
        candidates=candidates,
        shrink=found.gap,
        by_channel=found.by_channel,
        further=found.further,
        next_tests=found.next_tests,
        not_judgeable=not_judgeable_of(evidence.findings, problem.constants),
        confusable=confusable_of(evidence.findings, problem.constants),
        loops=_loops(found.problem, model, evidence, found.law, verdict, progress),
        responses=plant.responses(data, problem.given, recalibrated, model.rows),
        measured=measured,
        converged=all(each.status.ok for each in _decisive_fits(problem, selected, evidence, found.law)),
        warnings=(
            *write_warnings(found.problem, evidence, model.fit, beyond),
            *write_further(found.further, found.gap),
        ),
        learned=None if found.law is None else _offered(found.problem, found.law),
        drifts=problem.drifts,
        wall_s=time.perf_counter() - began,
        origin=origin,
    )


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


def _offered(problem: DiagnosisProblem, law: LearnedLaw) -> Learned:
    every = {name: Estimate(name, 0.0, 0.0, 0.0, unit) for name, unit in law.units.items()}
    fitted = {
        each.name: each for each in estimates_among(problem.search, law.mode, coefficients_at(law.port))
    }
    return Learned(law.name, law.port.location, tuple((every | fitted).values()), law.values)


def _loops(
    problem: DiagnosisProblem,
    model: CorrectedModel,
    evidence: DiagnosisEvidence,
    law: LearnedLaw | None,
    verdict: Verdict,
    progress: Progress,
) -> tuple[ForceLoop, ...]:
    """The signal inferred at the first named port, beside the law that is named or learned there.

    And beside the catalogue's formula that comes nearest to a learned one.
    """
    found = next((each for each in evidence.localisations if each.name in verdict.ports[:1]), None)
    if found is None:
        return ()
    progress("inferring the signal at the port")
    base, nearest = problem.base, None
    values = base.values | model.fit.values | ({} if law is None else law.values)
    effects = [problem.plant.catalogue[name] for name in model.hypothesis.effects]
    effects += [] if law is None else [law.effect]
    here = next((each for each in effects if each.port.location == found.name), None)
    drawn = None if here is None else drawn_law(here, values, model.fit, problem.search)
    if law is not None:
        fits = (each for each in evidence.findings.modes if each.terms and each.terms == verdict.effects)
        formula = next(fits, None)
        if formula is not None:
            effect = problem.plant.catalogue[formula.terms[0]]
            nearest = DrawnLaw(effect, base.values | formula.values)
    return problem.plant.loops(values, base.prediction.warm_start, found, drawn, nearest)
