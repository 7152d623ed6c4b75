"""A model held against a campaign: with its effects and without, at the measured dwells and between them."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Progress, Result, no_progress
from savgs_ident.fit.residuals import comparable
from savgs_ident.fit.result import Fit
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Measurements, campaign_of, measured_excitation, measured_response
from savgs_ident.simulate.frequency_response import (
    SimulatedResponse,
    disable_effects,
    simulate_between,
    simulate_response,
)
from savgs_ident.simulate.program_cache import use_persistent_cache


@dataclass(frozen=True)
class Comparison(Result):
    """A model and the same without its effects, held against D measured dwells.

    Attributes:
        measured: what it is held against.
        model: the response of the model.
        frictionless: that without its effects.
        used: which entries are compared, (D, C, orders + 1): only dwells that the model solved.
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

    def between(self) -> tuple[SimulatedResponse, SimulatedResponse]:
        """Both responses at the dwells and at as many frequencies between them, for smooth curves.

        The second is the first where the model has no effects.
        """
        if not self.effects:
            found = simulate_between(self.model)
            return found, found
        # A solver needs one core and leaves Python free: both take the time of one.
        with ThreadPoolExecutor(1) as pool:
            other = pool.submit(simulate_between, self.frictionless)
            return simulate_between(self.model), other.result()


def compare(
    model: Model, measured: Measurements, orders: int = 9, progress: Progress = no_progress
) -> Comparison:
    """Hold a model against a campaign or the response of its dwells, orders up to ``orders``; nothing is fitted.

    Raises :class:`InputError` for a campaign that cannot be used.
    """
    use_persistent_cache()
    response = measured_response(measured, model.plant, orders, None, progress)
    excitation = measured_excitation(model.plant, response, model.table)
    progress("solving the model at the dwells")
    with_effects = simulate_response(model, excitation, response.orders)
    progress("solving it without effects at the dwells")
    frictionless = simulate_response(disable_effects(model), excitation, response.orders)
    names = [each.name for each in model.channels]
    used = comparable(response, names, response.orders) & with_effects.ok[:, None, None]
    origin = model.origin(campaign_of(measured), response.warnings)
    return Comparison(response, with_effects, frictionless, used, origin=origin)


def comparison_of(fit: Fit) -> Comparison:
    """The identified model of a fit held against what it was fitted to; nothing is solved anew."""
    model: Model = fit.model
    excitation = measured_excitation(model.plant, fit.measured, model.table)
    return Comparison(
        fit.measured,
        SimulatedResponse(model, excitation, fit.predicted, fit.dwell_status),
        SimulatedResponse(disable_effects(model), excitation, fit.frictionless, fit.frictionless_status),
        fit.used,
        origin=replace(fit.origin, effects=fit.effects),
    )
