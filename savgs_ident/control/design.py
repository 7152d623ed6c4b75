"""The design as a whole: from an identified rig to a controller that runs, and the evidence for it."""

from collections.abc import Callable
from dataclasses import dataclass

import control
import numpy as np

from savgs_ident.control.alpha_map import alpha_map
from savgs_ident.control.controller_file import DigitalController
from savgs_ident.control.digital import RATE, discretise, reduce_order, sampled_plant
from savgs_ident.control.generalised_plant import design_loop, driven_loop, generalised_plant
from savgs_ident.control.margins import Margins, margins_of
from savgs_ident.control.quarter_car_space import TwoMasses, quarter_car_space
from savgs_ident.control.rigs import Rigs
from savgs_ident.control.robustness import Robustness, examine
from savgs_ident.control.synthesis import Synthesis, synthesise_hinf
from savgs_ident.control.two_masses import paper_masses
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values

REGULARISATION = ("noise_accel", "noise_deflection", "noise_position", "drift")
"""The weights that keep the problem regular."""

FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""By how much they are changed to show what they do."""


def controller_for(
    model: QuarterCar, p: Values, weights: ParameterTable, rate: float = RATE
) -> DigitalController:
    """The sampled H-infinity controller of a rig, sampled at ``rate`` [Hz], without the evidence.

    Raises as :func:`design_controller` does.
    """
    space = quarter_car_space(paper_masses(model, p))
    synthesis = synthesise_hinf(generalised_plant(space, float(p["motor_reference_bandwidth"]), weights))
    return DigitalController(discretise(synthesis.controller, rate), alpha_map(model, p))


@dataclass(frozen=True)
class Regularised:
    """What a regularising weight does: the design with it times ``factor``; no gamma where there is no design.

    ``factor`` and ``gamma_least`` have no dimension [1], ``fastest_pole`` is in [rad/s].
    """

    weight: str
    factor: float
    gamma_least: float
    fastest_pole: float
    phase_deg: float


@dataclass(frozen=True)
class Design:
    """A controller with the evidence.

    Attributes:
        masses: the numbers of eq. (8) that it was made for.
        bandwidth: of the actuator [Hz].
        weights: the weights.
        synthesis: the H-infinity controller, gamma and its check.
        controller: continuous, as it is used: that of the synthesis, or one of lower order.
        margins: of that controller.
        digital: the same, sampled.
        digital_margins: of the sampled controller on the sampled rig, with the sample that the computer needs.
        rigs: what it was tried on.
        robustness: how it did.
        regularisation: what the regularising weights do.
    """

    masses: TwoMasses
    bandwidth: float
    weights: ParameterTable
    synthesis: Synthesis
    controller: control.StateSpace
    margins: Margins
    digital: DigitalController
    digital_margins: Margins
    rigs: Rigs
    robustness: Robustness
    regularisation: tuple[Regularised, ...]

    @property
    def plant(self) -> control.StateSpace:
        """From command to measurements."""
        return design_loop(quarter_car_space(self.masses), self.bandwidth)

    @property
    def sampled_plant(self) -> control.StateSpace:
        """From command to measurements as the computer meets it: sampled, held, and a sample late."""
        return sampled_plant(self.plant, self.digital.rate)

    @property
    def closed(self) -> control.StateSpace:
        """From disturbances to penalties with the controller as it is used, continuous."""
        return generalised_plant(quarter_car_space(self.masses), self.bandwidth, self.weights).lft(
            self.controller
        )

    @property
    def ride(self) -> control.StateSpace:
        """From the road's velocity [m/s] to the outputs of eq. (8), with the controller as it is used, continuous."""
        rig = quarter_car_space(self.masses)
        found = driven_loop(rig, self.bandwidth).lft(self.controller)
        found.update_names(inputs=["road_velocity"], outputs=rig.output_labels)
        return found

    @property
    def trusted(self) -> bool:
        """Whether gamma was confirmed, and the loop is stable, sampled too, and on every rig."""
        both = self.margins.stable and self.digital_margins.stable
        return self.synthesis.holds and both and self.robustness.stable


def design_controller(
    model: QuarterCar,
    p: Values,
    rigs: Rigs,
    weights: ParameterTable,
    progress: Callable[[str], None],
    order: int | None = None,
    rate: float = RATE,
) -> Design:
    """The H-infinity controller of a rig, checked on ``rigs``; of ``order`` states if that is given.

    ``rate`` [1/s] is that of the computer. Raises :class:`InputError` where the weights admit no controller or the
    order is not possible.
    """
    masses, bandwidth = paper_masses(model, p), float(p["motor_reference_bandwidth"])
    space = quarter_car_space(masses)
    progress("H-infinity synthesis")
    synthesis = synthesise_hinf(generalised_plant(space, bandwidth, weights))
    controller = synthesis.controller if order is None else reduce_order(synthesis.controller, order)
    plant = design_loop(space, bandwidth)
    sampled = discretise(controller, rate)
    progress(f"trying it on {len(rigs.values)} rigs")
    robustness = examine(
        controller, (paper_masses(model, as_values(each)) for each in rigs.values), bandwidth, weights
    )
    progress("what the regularising weights do")
    return Design(
        masses,
        bandwidth,
        weights,
        synthesis,
        controller,
        margins_of(plant, controller),
        DigitalController(sampled, alpha_map(model, p)),
        margins_of(sampled_plant(plant, rate), sampled),
        rigs,
        robustness,
        tuple(
            _regularised(space, bandwidth, weights, name, factor)
            for name in REGULARISATION
            for factor in FACTORS
        ),
    )


def _regularised(
    space: control.StateSpace, bandwidth: float, weights: ParameterTable, name: str, factor: float
) -> Regularised:
    changed = weights.with_values({name: factor * weights[name].value})
    try:
        found = synthesise_hinf(generalised_plant(space, bandwidth, changed))
    except InputError:
        return Regularised(name, factor, float("nan"), float("nan"), float("nan"))
    fastest = float(np.max(np.abs(found.controller.poles())))
    phase = margins_of(design_loop(space, bandwidth), found.controller).phase_deg
    return Regularised(name, factor, found.gamma_least, fastest, phase)
