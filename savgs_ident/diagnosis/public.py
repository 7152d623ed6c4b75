"""What ``import savgs_ident`` offers of diagnosis: what is missing in a model."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.diagnosis.diagnose import baseline_problem, diagnose_dwells
from savgs_ident.diagnosis.quarter_car import diagnose_response
from savgs_ident.diagnosis.result import Diagnosis, DiagnosisSettings
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.measured import Measurements, campaign_of, first_sweep, measured_response
from savgs_ident.simulate.program_cache import use_persistent_cache


def diagnose(
    model: Model,
    measured: Measurements,
    *,
    without: Sequence[str] = (),
    orders: int = 9,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> Diagnosis:
    """Diagnose the sim-to-real gap: where it lies, which unmodelled effect causes it, how far it shrinks.

    The model is recalibrated first, within its tolerances, so that a part inside its tolerance is not called a gap.
    Every effect of the catalogue is then tested, alone and in pairs; if none explains the recordings the verdict is
    "unknown", with the port at which something is missing.

    Args:
        model: the baseline, of the rig or of another plant.
        measured: the recordings, or the response of their dwells.
        without: effects to leave out of the catalogue.
        orders: highest harmonic order to compare.
        max_frequency: leave out faster dwells [Hz].
        progress: is told what is being done.

    Look at ``converged`` of the result. Raises :class:`InputError` for a campaign that cannot be used, for names that
    do not exist, and for a model without periodic motion.
    """
    use_persistent_cache()
    response = measured_response(measured, orders, max_frequency, progress, model.build())
    campaign = campaign_of(measured)
    if isinstance(model, RigModel):
        rig, settings, values = baseline_of(model, orders, without)
        sweep = None if campaign is None else first_sweep(campaign)
        found = diagnose_response(response, rig, settings, values, progress, sweep)
    else:
        given, settings, values = model.before, *_asked(model, orders, without)
        bare = replace(model.build(), effects=())
        plant, data = baseline_problem(response, bare, given.table, model.catalogue, settings)
        found = diagnose_dwells(plant, data, response, given, settings, values, progress)
    return replace(found, origin=model.origin(campaign, response.warnings))


def baseline_of(
    model: RigModel, orders: int = 9, without: Sequence[str] = ()
) -> tuple[Rig, DiagnosisSettings, Mapping[str, float]]:
    """The rig as known before its own fit, what the baseline is, and the values that it is given with [SI]."""
    return model.before.rig, *_asked(model, orders, without)


def _asked(
    model: Model, orders: int, without: Sequence[str]
) -> tuple[DiagnosisSettings, Mapping[str, float]]:
    """What the baseline is, and the values that it is given with [SI]."""
    free, values = (model.free(), {}) if model.is_drawing else model.identified
    return DiagnosisSettings(model.name, model.effects, free, orders, tuple(without)), values
