"""A model held against a campaign: with its effects and without, at the measured dwells and between them."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.core.status import Status
from savgs_ident.fit.residuals import comparable
from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.sensors import RESPONSE_CHANNELS
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.frequency_response import (
    SimulatedResponse,
    disable_effects,
    simulate_between,
    simulate_response,
)
from savgs_ident.simulate.program_cache import use_persistent_cache


@dataclass(frozen=True)
class Comparison(Result):
    """A model and the same without its effects (SimQC), held against D measured dwells.

    Attributes:
        rig_model: the model.
        measured: what it is held against.
        model: its response.
        frictionless: its response without effects.
        used: which entries are compared, (D, 2, orders + 1): only dwells that the model solved.
    """

    presenter: ClassVar[str] = "COMPARISON"

    rig_model: RigModel
    measured: HarmonicResponse
    model: SimulatedResponse
    frictionless: SimulatedResponse
    used: NDArray[np.bool_]

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.rig_model.effects

    @property
    def trusted(self) -> bool:
        """Whether all periodic motions were found."""
        return self.model.trusted and self.frictionless.trusted

    def between(self) -> tuple[SimulatedResponse, SimulatedResponse]:
        """Both responses at the dwells and at as many frequencies between them, for smooth curves.

        The second is the first where the model has no effects.
        """
        rig, effects = self.rig_model.rig, self.effects
        if not effects:
            found = simulate_between(rig, effects, self.model)
            return found, found
        # A solver needs one core and leaves Python free: both take the time of one.
        with ThreadPoolExecutor(1) as pool:
            other = pool.submit(simulate_between, disable_effects(rig, effects), effects, self.frictionless)
            return simulate_between(rig, effects, self.model), other.result()


def compare(
    model: RigModel, campaign: Campaign, orders: int = 9, progress: Progress = no_progress
) -> Comparison:
    """Hold a model against a campaign, harmonic orders up to ``orders``, without fitting anything.

    Raises :class:`InputError` for a campaign that cannot be used.
    """
    use_persistent_cache()
    progress("estimating responses")
    measured = estimate_response(campaign, orders)
    excitation = measured_excitation(QuarterCar, measured, model.rig.parameters)
    progress("solving the model at the dwells")
    with_effects = simulate_response(model.rig, model.effects, excitation, measured.orders)
    progress("solving SimQC at the dwells")
    bare = disable_effects(model.rig, model.effects)
    frictionless = simulate_response(bare, model.effects, excitation, measured.orders)
    used = comparable(measured, RESPONSE_CHANNELS, measured.orders) & with_effects.ok[:, None, None]
    origin = model.origin(campaign, measured.warnings)
    return Comparison(model, measured, with_effects, frictionless, used, origin=origin)


def comparison_of(fit: Fit) -> Comparison:
    """The identified model of a fit held against what it was fitted to; nothing is solved anew."""
    excitation = measured_excitation(QuarterCar, fit.measured, fit.rig.parameters)
    status = tuple(
        Status.CONVERGED if np.isfinite(each).all() else Status.STALLED for each in fit.frictionless
    )
    return Comparison(
        fit.model,
        fit.measured,
        SimulatedResponse(excitation, fit.predicted, fit.dwell_status),
        SimulatedResponse(excitation, fit.frictionless, status),
        fit.used,
        origin=replace(fit.origin, effects=fit.effects),
    )
