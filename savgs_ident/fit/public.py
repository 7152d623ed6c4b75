"""The public call ``fit``: a model identified from a campaign."""

from collections.abc import Sequence
from dataclasses import replace

from savgs_ident.core.presentation import Progress, no_progress
from savgs_ident.fit.least_squares import FitSettings, fit_least_squares
from savgs_ident.fit.result import Fit
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.model import load_model
from savgs_ident.plants.quarter_car.rig import default_campaign_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.simulate.excitation import Measurements, campaign_of, measured_response
from savgs_ident.simulate.program_cache import use_persistent_cache


def fit(
    model: Model,
    measured: Measurements,
    free: Sequence[str] = (),
    *,
    orders: int = 9,
    peak_to_peak: bool = False,
    fixed_tolerances: bool = False,
    max_frequency: float | None = None,
    progress: Progress = no_progress,
) -> Fit:
    """Identify a model: parameters with errors, how well they fit, what the data identify.

    Args:
        model: the rig, or another plant, with its effects; one that was identified before starts from what was known
            then, for its values would count the data twice.
        measured: the recordings, or the response of their dwells.
        free: names of the parameters to identify; if empty the paper's four, as far as the rig has them, or those of
            another plant of which nothing is known but two bounds.
        orders: highest harmonic order to fit.
        peak_to_peak: fit peak-to-peak values only, as the paper did.
        fixed_tolerances: hold what is known to a tolerance at its value instead of estimating it along.
        max_frequency: leave out faster dwells [Hz].
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for a campaign that cannot be used and for unknown
    parameters.
    """
    settings = FitSettings(
        orders=orders,
        fixed_tolerances=fixed_tolerances,
        quantity="peak_to_peak" if peak_to_peak else "harmonics",
    )
    return fit_with(model, measured, free, settings, max_frequency, progress)


def fit_with(
    model: Model,
    measured: Measurements,
    free: Sequence[str],
    settings: FitSettings,
    max_frequency: float | None,
    progress: Progress = no_progress,
) -> Fit:
    """The same with its settings as one record."""
    use_persistent_cache()
    drawing = model.before
    names = drawing.free(free)
    response = measured_response(measured, model.plant, settings.orders, max_frequency, progress)
    found = fit_least_squares(response, drawing, free=names, settings=settings, progress=progress)
    return replace(found, origin=model.origin(campaign_of(measured), response.warnings))


def demo(progress: Progress = no_progress) -> Fit:
    """Identify the rig that comes with the package from the campaign that comes with it."""
    return fit(load_model(), load_campaign(default_campaign_path()), progress=progress)
