"""The public calls ``fit``, ``compare`` and ``demo``: a model identified from a campaign, or held against one.

A comparison shows a model with its effects and without, at the measured dwells and between them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.core.threads import side_by_side
from savgs_ident.fit.along_motion import MotionComparison, MotionFit, compare_along_motion, fit_along_motion
from savgs_ident.fit.least_squares import FitSettings, fit_least_squares
from savgs_ident.fit.result import Fit, comparable
from savgs_ident.inference.initial_states import compared_motion, settle_initial_states
from savgs_ident.inference.port_sizes import sized_to
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.model import Model
from savgs_ident.plants.quarter_car.model import load_model
from savgs_ident.plants.quarter_car.rig import default_campaign_path
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests
from savgs_ident.simulate.compared_tests import Measurements, campaign_of, response_of_tests
from savgs_ident.simulate.driven_plant import held_against, motion_of, origin_along
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.public import (
    SimulatedResponse,
    disable_effects,
    simulate_between,
    simulate_response,
)


def fit(
    model: Model,
    measured: Measurements | DrivenMotion,
    free: Sequence[str] = (),
    *,
    held_out: Campaign | DrivenMotion | None = None,
    orders: int = 9,
    peak_to_peak: bool = False,
    fixed_tolerances: bool = False,
    max_frequency: float | None = None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Fit | MotionFit:
    """Identify a model: parameters with errors, how well they fit, what the data identify.

    Args:
        model: the rig, or another plant, with its effects; the search begins with the values of one that was
            identified before, but its priors are those of what was known then, or the data would count twice.
        measured: the recordings, or the response of their dwells. A road is cut into windows, and without dwells so
            is a sweep; without dwells a plant with one coordinate, driven by its first input, is held against the
            force of its drive along the measured motion, or along one that is given.
        free: names of the parameters to identify; if empty the paper's four, as far as the rig has them, and what its
            further effects bring along; or those of another plant of which nothing is known but two bounds.
        held_out: another motion, that nothing is fitted to: its force is predicted, and compared.
        orders: highest harmonic order to fit.
        peak_to_peak: fit peak-to-peak values only, as the paper did.
        fixed_tolerances: hold what is known to a tolerance at its value instead of estimating it along.
        max_frequency: leave out faster dwells [Hz]; of windows, compare up to this; by default 15 Hz, and 40 Hz at
            most, for a plant as fast as a quarter car.
        command: the command line that the result says it was made by.
        progress: called with a sentence on what is being done.

    Look at ``trusted`` of the result. Raises :class:`InputError` for a campaign that cannot be used and for unknown
    parameters.
    """
    use_persistent_cache()
    measured = held_against(measured, model)
    if isinstance(measured, DrivenMotion):
        if peak_to_peak or max_frequency is not None:
            raise InputError(
                "a force along a measured motion has neither peak-to-peak values nor frequencies",
                remedy="leave out --peak-to-peak and --max-frequency",
            )
        return _fit_motion(model, measured, free, held_out, fixed_tolerances, command, progress)
    if held_out is not None:
        raise InputError(
            "a held-out motion goes with a measured motion alone",
            remedy="fit one campaign, and hold its model.toml against the other by `bode`",
        )
    settings = FitSettings(
        orders=orders,
        fixed_tolerances=fixed_tolerances,
        quantity="peak_to_peak" if peak_to_peak else "harmonics",
    )
    return fit_with(model, measured, free, settings, max_frequency, command, progress)


def _fit_motion(
    model: Model,
    motion: DrivenMotion,
    free: Sequence[str],
    held_out: Campaign | DrivenMotion | None,
    fixed_tolerances: bool,
    command: Sequence[str],
    progress: Progress,
) -> MotionFit:
    """Identify a model by the force of its drive along a measured motion."""
    drawing = model.before
    return fit_along_motion(
        drawing,
        motion,
        free=drawing.free(free),
        fixed_tolerances=fixed_tolerances,
        held_out=motion_of(held_out, model) if isinstance(held_out, Campaign) else held_out,
        origin=origin_along(model, motion, command),
        progress=progress,
    )


def fit_with(
    model: Model,
    measured: Measurements,
    free: Sequence[str],
    settings: FitSettings,
    max_frequency: float | None,
    command: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Fit:
    """The same with its settings as one record."""
    use_persistent_cache()
    drawing = model.before
    names = drawing.free(free)
    if settings.quantity == "peak_to_peak":
        response, motion = _with_peaks(measured, drawing, settings.orders, max_frequency, progress), None
    else:
        response, motion = compared_motion(measured, drawing, settings.orders, max_frequency, progress)
    drawing, resized = sized_to(drawing, response) if drawing.effects else (drawing, ())
    # Beside other programs threads of the linear algebra wait for each other: its largest matrices take thirty times
    # as long, and on cores that are free they gain a tenth of a second.
    with threadpool_limits(1, "blas"):
        values, begin = {} if model.is_drawing else _within_bounds(model.identified[1], drawing), None
        if response.initial_states is not None:
            response, begin = settle_initial_states(
                response, drawing, names, settings.problem, progress, values
            )
        warnings = (*response.warnings, *resized)
        return fit_least_squares(
            response,
            drawing,
            free=names,
            settings=settings,
            origin=model.origin(campaign_of(measured), warnings).with_command(command),
            motion=motion,
            values=values,
            begin=begin,
            progress=progress,
        )


def _within_bounds(values: Mapping[str, float], model: Model) -> dict[str, float]:
    """Values [SI] that were identified from other data, by name, as near as the bounds of a model come to them."""
    table = model.table
    return {
        name: min(max(value, table[name].lower), table[name].upper) if name in table else value
        for name, value in values.items()
    }


def _with_peaks(
    measured: Measurements, model: Model, orders: int, max_frequency: float | None, progress: Progress
) -> HarmonicResponse:
    """The response of the dwells, which have peak-to-peak values, with a warning for what has none.

    Raises :class:`InputError` where there are no dwells.
    """
    response = response_of_tests(measured, model.plant, orders, max_frequency, progress)
    if not response.dwells.size:
        raise InputError(
            "tests that do not repeat have no peak-to-peak values",
            source="--peak-to-peak",
            remedy="leave it out, or record dwells",
        )
    what = "does not repeat, and has no peak-to-peak value: it is not used"
    warnings = tuple(DataWarning("tests_not_used", what, test=response.tests[d]) for d in response.windows)
    return replace(only_tests(response, response.dwells), warnings=(*response.warnings, *warnings))


def demo(progress: Progress = no_progress, *, command: Sequence[str] = ()) -> Fit:
    """Identify the rig that comes with the package from the campaign that comes with it.

    ``progress`` is called with a sentence on what is being done; ``command`` is the command line that the result says
    it was made by.
    """
    path = default_campaign_path()
    progress(f"reading {path}")
    campaign = load_campaign(path)
    return fit_with(load_model(), campaign, (), FitSettings(), None, command, progress)


@dataclass(frozen=True)
class Comparison(Result):
    """A model and the same without its effects, held against D measured tests.

    Attributes:
        measured: what it is held against.
        model: the response of the model.
        frictionless: that without its effects.
        used: which entries are compared, (D, C, orders + 1): only tests that the model solved.
    """

    presenter: ClassVar[str] = "COMPARISON"

    measured: HarmonicResponse
    model: SimulatedResponse
    frictionless: SimulatedResponse
    used: NDArray[np.bool_]

    @property
    def given(self) -> Model:
        """The model."""
        return self.model.model

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.given.effects

    @property
    def trusted(self) -> bool:
        """Whether all periodic motions were found."""
        return self.model.trusted and self.frictionless.trusted

    def of_tests(self, kept: NDArray[np.intp]) -> "Comparison":
        """Of some of the tests."""
        measured = only_tests(self.measured, kept)
        return replace(
            self,
            measured=measured,
            model=self.model.of_tests(kept, measured.orders),
            frictionless=self.frictionless.of_tests(kept, measured.orders),
            used=self.used[kept, :, : measured.orders + 1],
        )

    def between(self) -> tuple[SimulatedResponse, SimulatedResponse]:
        """Both responses at the dwells and at as many frequencies between them, for smooth curves.

        The second is the first where the model has no effects.
        """
        if not self.effects:
            found = simulate_between(self.model)
            return found, found
        # A solver needs one core and leaves Python free: both take the time of one.
        return side_by_side(
            partial(simulate_between, self.model), partial(simulate_between, self.frictionless)
        )


def compare(
    model: Model,
    measured: Measurements | DrivenMotion,
    orders: int = 9,
    progress: Progress = no_progress,
) -> Comparison | MotionComparison:
    """Hold a model against a campaign or the response of its dwells, orders up to ``orders``; nothing is fitted.

    A road is cut into windows, and where there are no dwells a sweep, too. As in a fit, a plant may be held against
    the force of its drive along a measured motion. Raises :class:`InputError` for a campaign
    that cannot be used.
    """
    use_persistent_cache()
    measured = held_against(measured, model)
    if isinstance(measured, DrivenMotion):
        progress("finding the force that the model needs")
        return compare_along_motion(model, measured, origin_along(model, measured))
    response, _ = compared_motion(measured, model.before, orders, None, progress, identified=model)
    excitation = measured_excitation(model.plant, response, model.table)
    names = [each.name for each in model.channels]
    places = [response.channel(name) for name in names if name in response.channels]
    shown = response.orders if response.part is None else response.last_compared(places)
    progress("solving the model")
    with_effects = simulate_response(model, excitation, shown)
    progress("solving it without effects")
    frictionless = simulate_response(disable_effects(model), excitation, shown)
    if response.part is not None and response.part.begins_moving.any():
        target = harmonic_target(response, model.plant.channels, orders)
        with_effects, frictionless = (
            replace(each, harmonics=target.with_nuisances(each.harmonics))
            for each in (with_effects, frictionless)
        )
    used = comparable(response, names, shown) & with_effects.ok[:, None, None]
    origin = model.origin(campaign_of(measured), response.warnings)
    return Comparison(response, with_effects, frictionless, used, origin=origin)


def comparison_of(fit: Fit) -> Comparison:
    """The identified model of a fit held against what it was fitted to; nothing is solved anew."""
    model = fit.model
    excitation = measured_excitation(model.plant, fit.measured, model.table)
    return Comparison(
        fit.measured,
        SimulatedResponse(model, excitation, fit.predicted, fit.dwell_status),
        SimulatedResponse(disable_effects(model), excitation, fit.frictionless, fit.frictionless_status),
        fit.used,
        origin=replace(fit.origin, effects=fit.effects),
    )
