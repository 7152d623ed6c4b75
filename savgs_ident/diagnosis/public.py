"""What is missing in a model: the diagnosis of any plant (``import savgs_ident`` offers it), and of the quarter car.

A response of dwells is diagnosed by the periodic motions of the plant, a measured motion by the force of its drive.
The model says which effects may be missing in its plant, and which such plants are known to have together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
from savgs_ident.diagnosis.evidence import DiagnosisProblem
from savgs_ident.diagnosis.gap import FurtherShrink
from savgs_ident.diagnosis.motion_problem import MotionProblem, further_motion, motion_problem
from savgs_ident.diagnosis.problem import ModelPoint
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.initial_states import compared_motion, settle_initial_states
from savgs_ident.inference.observations import Data
from savgs_ident.inference.port_sizes import sized_to
from savgs_ident.inference.problem import ProblemSettings
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse
from savgs_ident.simulate.compared_tests import Measurements, campaign_of, first_sweep
from savgs_ident.simulate.driven_plant import held_against, motion_of, origin_along, sized_along
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
    asked = ask(model, measured, orders, max_frequency, without, constants, progress)
    if isinstance(asked, AskedMotion):
        apart = motion_of(held_out, model) if isinstance(held_out, Campaign) else held_out
        return _diagnose_motion(model, asked, apart, command, progress)
    if held_out is not None:
        raise InputError(
            "a held-out motion goes with a measured motion alone",
            remedy="diagnose one campaign, and hold a model against the other by `bode`",
        )
    assert not isinstance(measured, DrivenMotion)
    campaign = campaign_of(measured)
    # Without dwells a sweep is what the model is fitted to, and no test that was left out.
    sweep, found_in_sweep = (
        first_sweep(campaign, model.plant) if campaign and asked.response.dwells.size else (None, ())
    )
    plant, data = asked.problem()
    origin = model.origin(campaign, (*asked.warnings, *found_in_sweep)).with_command(command)
    return diagnose_dwells(
        plant, data, asked.response, asked.given, asked.settings, asked.values, progress, sweep, origin=origin
    )


class NoiseLevels(NamedTuple):
    """To which level of noise each row belongs, (m,), and how many degrees of freedom that was found from, (m,).

    Infinitely many where the level is known.
    """

    level: NDArray[np.intp]
    dof: NDArray[np.float64]


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

    def problem(self) -> tuple[DwellProblem, Data]:
        """The plant with what may be missing in it, and the response as data; raises as :func:`problem_of_dwells`."""
        return problem_of_dwells(self.response, self.given, self.settings)

    def noise_levels(self, problem: DiagnosisProblem) -> NoiseLevels:
        """One for each channel of a test."""
        measured, plant, test = self.response, problem.plant, problem.data.test
        level = test * len(plant.channels) + plant.channel
        if measured.covariance_dof is None:
            return NoiseLevels(level, np.full(level.size, np.inf))
        first = {c: measured.channel(n) for c, n in enumerate(plant.channels) if n in measured.channels}
        places = np.array([first[channel] for channel in plant.channel])
        return NoiseLevels(level, np.asarray(measured.covariance_dof[test, places, 1]))


@dataclass(frozen=True)
class AskedMotion:
    """A measured motion, and the baseline of which the drive's force is to be diagnosed along it.

    Attributes:
        motion: what was measured.
        given: the model as known before its own fit, its forces as large as the recorded one asks for.
        settings: what the baseline is.
        values: those that the baseline is given with [SI], by name.
    """

    motion: DrivenMotion
    given: Model
    settings: DiagnosisSettings
    values: Mapping[str, float]

    @property
    def warnings(self) -> tuple[DataWarning, ...]:
        """About the recordings."""
        return self.motion.warnings

    def problem(self) -> tuple[MotionProblem, Data]:
        """The plant with what may be missing in it, and the force of its drive as data.

        Raises :class:`InputError` for effects that do not exist, and for effects of the baseline that are to be left
        out.
        """
        given, settings = self.given, self.settings
        bare, offered = replace(given.build(), effects=()), offered_effects(given.candidates, settings)
        return motion_problem(
            self.motion, bare, given.table, offered, given.effects, settings.free, settings.constants
        )

    def noise_levels(self, problem: DiagnosisProblem) -> NoiseLevels:
        """One for all rows, which is known: there are thousands of them."""
        rows = problem.data.measured.size
        return NoiseLevels(np.zeros(rows, np.intp), np.full(rows, np.inf))


Asked = AskedDwells | AskedMotion
"""What a diagnosis is asked about."""


def ask(
    model: Model,
    measured: Measurements | DrivenMotion,
    orders: int = 9,
    max_frequency: float | None = None,
    without: Sequence[str] = (),
    constants: DecisionConstants = DEFAULTS,
    progress: Progress = no_progress,
) -> Asked:
    """What :func:`diagnose` holds a model against: a response, or the force of a drive; raises as it does."""
    measured = held_against(measured, model)
    if isinstance(measured, DrivenMotion):
        sized = sized_along(model, measured)
        settings, values = _asked(sized, 0, without, constants)
        return AskedMotion(measured, sized.before, settings, values)
    response, _ = compared_motion(measured, model, orders, max_frequency, progress)
    model, resized = sized_to(model, response)
    given, settings, values = baseline_of(model, orders, without, constants)
    if response.initial_states is not None:
        options = ProblemSettings(orders=orders)
        response, _ = settle_initial_states(response, given, tuple(settings.free), options, progress, values)
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
    asked: AskedMotion,
    held_out: DrivenMotion | None,
    command: Sequence[str],
    progress: Progress,
) -> Diagnosis:
    """Diagnose a plant from the force of its drive along a measured motion."""
    problem, data = asked.problem()

    def predict(points: Sequence[ModelPoint]) -> FurtherShrink:
        assert held_out is not None
        return further_motion(held_out, points)

    further = None if held_out is None else predict
    origin = origin_along(model, asked.motion, command)
    return diagnose_problem(
        problem, data, asked.given, asked.settings, asked.values, progress, further, origin=origin
    )


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
