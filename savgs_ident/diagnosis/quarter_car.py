"""The quarter-car rig as the subject of a diagnosis: its catalogue, and what a diagnosis of it may ask for."""

from collections.abc import Mapping

from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.diagnosis.diagnose import baseline_problem, diagnose_dwells
from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings
from savgs_ident.inference.observations import Data
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse, SweepResponse

SIMTR = DiagnosisSettings("simtr", MODELS["simtr"], FREE)
"""The paper's model as the baseline, with the parameters that the paper identifies."""


def diagnose_response(
    measured: HarmonicResponse,
    rig: Rig,
    settings: DiagnosisSettings | None = None,
    values: Mapping[str, float] | None = None,
    progress: Progress = no_progress,
    sweep: SweepResponse | None = None,
) -> Diagnosis:
    """Diagnose the gap between a rig's baseline model and a measured response.

    ``rig`` is the rig as known before any fit; ``values`` (SI, by name) are those that the baseline is given with,
    the rig's own where left out. A ``sweep`` of the cam is no part of the diagnosis: it is predicted, and compared.

    Look at ``converged`` of the result. Raises :class:`InputError` for a response that cannot be used, for names
    that do not exist, and for a rig whose baseline has no periodic motion.
    """
    settings = settings or SIMTR
    plant, data = quarter_car_problem(measured, rig, settings)
    given = RigModel(rig, settings.baseline)
    return diagnose_dwells(plant, data, measured, given, settings, values or {}, progress, sweep)


def quarter_car_problem(
    measured: HarmonicResponse, rig: Rig, settings: DiagnosisSettings
) -> tuple[DwellProblem, Data]:
    """The rig with its catalogue, less the effects that are left out, and the response as data.

    Raises :class:`InputError` for effects that do not exist, for effects of the baseline that are to be left out, and
    for a response that cannot be used.
    """
    return baseline_problem(
        measured, QuarterCar(damper_curve(rig)), rig.parameters, CATALOGUE, settings, MODELS.values()
    )
