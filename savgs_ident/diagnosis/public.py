"""What is missing in a model: the diagnosis of any plant (``import savgs_ident`` offers it), and of the quarter car.

A response of dwells is diagnosed by the periodic motions of the plant, a measured motion by the force of its drive.
The model says which effects may be missing in its plant, and which such plants are known to have together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress, no_progress
from savgs_ident.diagnosis.diagnose import (
    Watch,
    baseline_problem,
    diagnose_dwells,
    diagnose_problem,
    nobody,
    offered_effects,
)
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.gap import FurtherShrink
from savgs_ident.diagnosis.motion_problem import further_motion, motion_problem
from savgs_ident.diagnosis.problem import ModelPoint
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.observations import Data
from savgs_ident.inference.port_sizes import sized_to
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.simulate.driven_plant import motion_in, motion_of, sized_along
from savgs_ident.simulate.excitation import Measurements, campaign_of, first_sweep
from savgs_ident.simulate.forgetting import forgetful_response
from savgs_ident.simulate.program_cache import use_persistent_cache


def diagnose(
    model: Model,
    measured: Measurements | DrivenMotion,
    *,
    held_out: Campaign | DrivenMotion | None = None,
    without: Sequence[str] = (),
    orders: int = 9,
    max_frequency: float | None = None,
    constants: DecisionConstants = DEFAULTS,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Diagnosis:
    """Diagnose the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks.

    The model is recalibrated first, within its tolerances, so that a part inside its tolerance is not called a gap.
    Every effect of the catalogue is then tested, alone and in pairs; if none explains the recordings the verdict is
    "unknown", with the port at which something is missing.

    Args:
        model: the baseline, of the rig or of another plant.
        measured: the recordings, or the response of their dwells; or a measured motion, along which a plant with one
            coordinate is held against the force of its drive, as it is where recordings have no dwell. For other
            plants a sweep is cut into windows then; a road is in any case.
        held_out: another motion, that nothing is fitted to: it is predicted, and compared.
        without: effects to leave out of the catalogue.
        orders: highest harmonic order to compare.
        max_frequency: leave out faster dwells [Hz].
        constants: what the verdict is decided by, each with its origin: priors, thresholds, limits of the search.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``converged`` of the result. Raises :class:`InputError` for a campaign that cannot be used, for names that
    do not exist, and for a model without periodic motion.
    """
    use_persistent_cache()
    motion = motion_in(measured, model) if isinstance(measured, Campaign) else None
    measured = measured if motion is None else motion
    if isinstance(measured, DrivenMotion):
        held_out = motion_of(held_out, model) if isinstance(held_out, Campaign) else held_out
        return _diagnose_motion(model, measured, held_out, without, constants, command, progress)
    if held_out is not None:
        raise InputError(
            "a held-out motion goes with a measured motion alone", remedy="diagnose each campaign by itself"
        )
    asked = ask_dwells(model, measured, orders, max_frequency, without, constants, progress)
    response, given, settings = asked.response, asked.given, asked.settings
    campaign = campaign_of(measured)
    # Without dwells a sweep is what the model is fitted to, and no test that was left out.
    apart = campaign if response.dwells.size else None
    sweep, found_in_sweep = (None, ()) if apart is None else first_sweep(apart, model.plant)
    plant, data = problem_of_dwells(response, given, settings)
    origin = model.origin(campaign, (*asked.warnings, *found_in_sweep)).with_command(command)
    return diagnose_dwells(
        plant, data, response, given, settings, asked.values, progress, sweep, origin=origin
    )


@dataclass(frozen=True)
class AskedDwells:
    """A response, and the baseline that it is to be diagnosed with.

    Attributes:
        response: of dwells, or of windows in motions that do not repeat.
        given: the model as known before its own fit, its effects as large as the recorded motion asks for.
        settings: what the baseline is, and what is compared.
        values: those that the baseline is given with [SI], by name.
        warnings: about the recordings.
    """

    response: HarmonicResponse
    given: Model
    settings: DiagnosisSettings
    values: Mapping[str, float]
    warnings: tuple[DataWarning, ...]


def ask_dwells(
    model: Model,
    measured: Measurements,
    orders: int = 9,
    max_frequency: float | None = None,
    without: Sequence[str] = (),
    constants: DecisionConstants = DEFAULTS,
    progress: Progress = no_progress,
) -> AskedDwells:
    """What :func:`diagnose` holds recordings of dwells or of roads against.

    Raises as it does, and :class:`InputError` for a motion along which a plant is held against its drive's force.
    """
    if isinstance(measured, Campaign) and motion_in(measured, model) is not None:
        raise InputError(
            "the recordings are of a motion along which the drive's force is compared",
            remedy="`fit` and `diagnose` serve them; here record dwells, a sweep or a road that is imposed",
        )
    response = forgetful_response(measured, model, orders, max_frequency, progress)
    model, resized = sized_to(model, response)
    given, settings, values = baseline_of(model, orders, without, constants)
    return AskedDwells(response, given, settings, values, (*response.warnings, *resized))


def problem_of_dwells(
    measured: HarmonicResponse, given: Model, settings: DiagnosisSettings
) -> tuple[DwellProblem, Data]:
    """A plant as known before any fit, with the effects that may be missing in it, and the response as data.

    Raises :class:`InputError` for effects that do not exist, for effects of the baseline that are to be left out, and
    for a response that cannot be used.
    """
    bare = replace(given.build(), effects=())
    return baseline_problem(measured, bare, given.table, given.candidates, settings, given.known_models)


def _diagnose_motion(
    model: Model,
    motion: DrivenMotion,
    held_out: DrivenMotion | None,
    without: Sequence[str],
    constants: DecisionConstants,
    command: Sequence[str],
    progress: Progress,
) -> Diagnosis:
    """Diagnose a plant from the force of its drive along a measured motion."""
    model = sized_along(model, motion)
    bare, given = replace(model.build(), effects=()), model.before
    settings, values = _asked(model, 0, without, constants)
    offered = offered_effects(given.candidates, settings)
    problem, data = motion_problem(
        motion, bare, given.table, offered, model.effects, settings.free, settings.constants
    )

    def predict(points: Sequence[ModelPoint]) -> FurtherShrink:
        assert held_out is not None
        return further_motion(held_out, points)

    further = None if held_out is None else predict
    origin = replace(model.origin(warnings=motion.warnings), data=motion.source, command=tuple(command))
    return diagnose_problem(problem, data, given, settings, values, progress, further, origin=origin)


def baseline_of(
    model: Model,
    orders: int = 9,
    without: Sequence[str] = (),
    constants: DecisionConstants = DEFAULTS,
) -> tuple[Model, DiagnosisSettings, Mapping[str, float]]:
    """The model as known before its own fit, what the baseline is, and the values that it is given with [SI]."""
    return model.before, *_asked(model, orders, without, constants)


def _asked(
    model: Model, orders: int, without: Sequence[str], constants: DecisionConstants
) -> tuple[DiagnosisSettings, Mapping[str, float]]:
    """What the baseline is, and the values that it is given with [SI]."""
    free, values = (model.free(), {}) if model.is_drawing else model.identified
    settings = DiagnosisSettings(model.name, model.effects, free, orders, tuple(without), constants=constants)
    return settings, values


SIMTR = DiagnosisSettings("simtr", MODELS["simtr"], FREE)
"""The paper's model as the baseline, with the parameters that the paper identifies."""


def diagnose_response(
    measured: HarmonicResponse,
    rig: Rig,
    settings: DiagnosisSettings | None = None,
    values: Mapping[str, float] | None = None,
    progress: Progress = no_progress,
    sweep: SweepResponse | None = None,
    watch: Watch = nobody,
    origin: Origin = NO_ORIGIN,
) -> Diagnosis:
    """Diagnose the gap between a rig's baseline model and a measured response.

    ``rig`` is the rig as known before any fit; ``values`` (SI, by name) are those that the baseline is given with,
    the rig's own where left out. A ``sweep`` of the cam is no part of the diagnosis: it is predicted, and compared.
    ``watch`` gets what the verdict was decided from; ``origin`` is that of the result.

    Look at ``converged`` of the result. Raises :class:`InputError` for a response that cannot be used, for names
    that do not exist, and for a rig whose baseline has no periodic motion.
    """
    settings = settings or SIMTR
    given = RigModel(rig, settings.baseline)
    plant, data = problem_of_dwells(measured, given, settings)
    return diagnose_dwells(
        plant, data, measured, given, settings, values or {}, progress, sweep, watch, origin
    )
