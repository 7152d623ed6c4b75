"""The design as a whole: from an identified rig to a controller that runs, with the evidence for it.

:func:`design_controller` synthesises, checks and discretises a controller and tries it on other rigs.
:func:`controller_record` and :func:`read_controller` are the controller as a file: everything that a computer
needs to run it, with units, as JSON.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import control
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.generalised_plant import (
    COMMAND,
    MEASUREMENTS,
    design_loop,
    driven_loop,
    generalised_plant,
)
from savgs_ident.control.linear_equivalent import (
    AlphaMap,
    TwoMasses,
    alpha_map,
    paper_masses,
    quarter_car_space,
)
from savgs_ident.control.margins import Margins, Robustness, assess_robustness, compute_margins
from savgs_ident.control.rigs import Rigs
from savgs_ident.control.synthesis import (
    RATE,
    Synthesis,
    discretise,
    reduce_order,
    sampled_plant,
    synthesise_hinf,
)
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Result
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar

REGULARISATION = ("noise_accel", "noise_deflection", "noise_position", "drift")
"""The weights that regularise the problem."""
FACTORS = (0.1, 0.3, 1.0, 3.0, 10.0)
"""Factors on them that show their effect [1]."""
SCHEMA = 1
MEASUREMENT_UNITS = ("m/s^2", "m", "m")
COMMAND_UNIT = "m/s"


@dataclass(frozen=True)
class DigitalController:
    """A sampled controller with its map from the equivalent actuator to the link.

    Attributes:
        space: discrete, from measurements (acceleration, deflection, z_lin) to the command (velocity of z_lin).
        alpha: map from the command to a velocity of the link.
    """

    space: control.StateSpace
    alpha: AlphaMap

    @property
    def rate(self) -> float:
        """Samples per second [1/s]."""
        return 1.0 / float(self.space.dt)


@dataclass(frozen=True)
class RegularisationEffect:
    """The effect of a regularising weight: the design with it times ``factor``; NaN where there is none.

    ``factor`` and ``gamma_least`` have no dimension [1], ``fastest_pole`` is in [rad/s].
    """

    weight: str
    factor: float
    gamma_least: float
    fastest_pole: float
    phase_deg: float


@dataclass(frozen=True)
class Design(Result):
    """A controller with the checks of it.

    Attributes:
        masses: the parameters of eq. (8) of the design.
        bandwidth: of the actuator [Hz].
        weights: the weights.
        synthesis: the H-infinity controller, gamma and its check.
        controller: continuous, as it is used: that of the synthesis, or one of lower order.
        margins: of that controller.
        digital: the same, sampled.
        digital_margins: of the sampled controller on the sampled rig, with a delay of one sample for the computation.
        rigs: the rigs of the robustness check.
        robustness: the results there.
        regularisation: the effect of the regularising weights.
    """

    presenter: ClassVar[str] = "DESIGN"

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
    regularisation: tuple[RegularisationEffect, ...]
    model: RigModel | None = field(default=None, kw_only=True)

    @property
    def plant(self) -> control.StateSpace:
        """From command to measurements."""
        return design_loop(quarter_car_space(self.masses), self.bandwidth)

    @property
    def sampled_plant(self) -> control.StateSpace:
        """From command to measurements for the computer: sampled, held, delayed by a sample."""
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
        """Whether gamma was confirmed, and the loop is stable, also sampled and on every rig."""
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
    """The H-infinity controller of a rig, checked on ``rigs``; reduced to ``order`` states if given.

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
    progress(f"robustness on {len(rigs.values)} rigs")
    robustness = assess_robustness(
        controller, (paper_masses(model, as_values(each)) for each in rigs.values), bandwidth, weights
    )
    progress("effect of the regularising weights")
    return Design(
        masses,
        bandwidth,
        weights,
        synthesis,
        controller,
        compute_margins(plant, controller),
        DigitalController(sampled, alpha_map(model, p)),
        compute_margins(sampled_plant(plant, rate), sampled),
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
) -> RegularisationEffect:
    changed = weights.with_values({name: factor * weights[name].value})
    try:
        found = synthesise_hinf(generalised_plant(space, bandwidth, changed))
    except InputError:
        return RegularisationEffect(name, factor, float("nan"), float("nan"), float("nan"))
    fastest = float(np.max(np.abs(found.controller.poles())))
    phase = compute_margins(design_loop(space, bandwidth), found.controller).phase_deg
    return RegularisationEffect(name, factor, found.gamma_least, fastest, phase)


def controller_for(
    model: QuarterCar, p: Values, weights: ParameterTable, rate: float = RATE
) -> DigitalController:
    """The sampled H-infinity controller of a rig, sampled at ``rate`` [Hz], without the checks.

    Raises as :func:`design_controller` does.
    """
    space = quarter_car_space(paper_masses(model, p))
    synthesis = synthesise_hinf(generalised_plant(space, float(p["motor_reference_bandwidth"]), weights))
    return DigitalController(discretise(synthesis.controller, rate), alpha_map(model, p))


def controller_record(controller: DigitalController) -> dict[str, object]:
    """The controller as values of JSON: x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k]."""
    space, alpha = controller.space, controller.alpha
    return {
        "schema": SCHEMA,
        "law": "x[k+1] = A x[k] + B y[k], u[k] = C x[k] + D y[k], thetadot_SL = u / alpha(theta_SL)",
        "rate_hz": controller.rate,
        "measurements": dict(zip(MEASUREMENTS, MEASUREMENT_UNITS, strict=True)),
        "command": {COMMAND: COMMAND_UNIT},
        "A": space.A.tolist(),
        "B": space.B.tolist(),
        "C": space.C.tolist(),
        "D": space.D.tolist(),
        "alpha_m_per_rad": {
            "nominal_angle_rad": float(alpha.nominal),
            "powers_of_angle_from_nominal": np.asarray(alpha.coefficients).tolist(),
        },
    }


def read_controller(path: Path) -> DigitalController:
    """Read the controller from a file that ``design`` wrote.

    Raises :class:`InputError` if it cannot be read or contains no controller.
    """
    remedy = "give the controller.json that `savgs-ident design` wrote"
    try:
        document = json.loads(path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", source=path, remedy=remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError("is not JSON", source=path, remedy=remedy) from error
    try:
        return _controller(document)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InputError(f"holds no controller: {error}", source=path, remedy=remedy) from error


def _controller(document: Mapping[str, object]) -> DigitalController:
    if document["schema"] != SCHEMA or isinstance(document["schema"], bool):
        raise ValueError(f"its schema is {document['schema']!r}, not {SCHEMA}")
    a, b, c, d = (_numbers(document[name]) for name in "ABCD")
    rate, alpha = document["rate_hz"], document["alpha_m_per_rad"]
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < np.inf:
        raise ValueError("rate_hz is no positive number")
    if 1.0 / rate == np.inf:
        raise ValueError("rate_hz is too small")
    if not isinstance(alpha, dict):
        raise TypeError("alpha_m_per_rad is no table")
    powers = _numbers(alpha["powers_of_angle_from_nominal"])
    nominal = _numbers(alpha["nominal_angle_rad"])
    order = len(a)
    shapes = (a.shape, b.shape, c.shape, d.shape, nominal.shape)
    if shapes != ((order, order), (order, 3), (1, order), (1, 3), ()) or powers.ndim != 1 or not powers.size:
        raise ValueError("its matrices do not fit together")
    if not all(np.isfinite(each).all() for each in (a, b, c, d, powers, nominal)):
        raise ValueError("a number is not finite")
    space = control.ss(a, b, c, d, 1.0 / rate, inputs=MEASUREMENTS, outputs=[COMMAND], name="controller")
    return DigitalController(space, AlphaMap(jnp.asarray(nominal), jnp.asarray(powers)))


def _numbers(value: object) -> NDArray[np.float64]:
    found = np.array(value)
    if found.dtype.kind not in "if":
        raise TypeError("what should be numbers is something else")
    return found.astype(np.float64)
