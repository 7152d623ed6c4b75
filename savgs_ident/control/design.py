"""The design as a whole: from an identified rig to a controller that runs, with the evidence for it.

:func:`design_controller` synthesises, checks and discretises a controller and tries it on other rigs (:class:`Rigs`):
parameter sets that are compatible with the recordings, drawn from the samples of a posterior, or from the covariance
of an identified rig, or, for a drawing, from its tolerances. :func:`controller_record` and :func:`read_controller`
are the controller as a file: everything that a computer needs to run it, with units, as JSON.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
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
from savgs_ident.control.synthesis import (
    RATE,
    Margins,
    Robustness,
    Synthesis,
    assess_robustness,
    compute_margins,
    discretise,
    reduce_order,
    sampled_plant,
    synthesise_hinf,
)
from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.presentation import Origin, Progress, Result
from savgs_ident.core.values import Values, as_values
from savgs_ident.inference.draws import (
    FAR,
    REMEDY,
    DrawSource,
    far_from_draws,
    read_draws,
    source_name,
    thin_draws,
)
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar

SEED = 20170701
"""Seed of the draws: the same rigs every time."""
ROUNDING = 1e-6
"""Tolerance for asymmetry and negative eigenvalues of a correlation matrix [1]."""


@dataclass(frozen=True)
class Rigs:
    """Parameter sets of rigs: ``source`` describes their origin; ``values`` are whole sets by name, SI."""

    source: str
    values: tuple[Mapping[str, float], ...]


def rigs_from_posterior(table: ParameterTable, path: DrawSource, count: int) -> Rigs:
    """``count`` rigs evenly spread over the draws of a posterior.

    Raises :class:`InputError` if the file cannot be read, holds no draws of the rig's parameters, or those of another
    rig.
    """
    every = read_draws(path, tuple(table))
    far = far_from_draws(table.as_dict(), every)
    if far:
        raise InputError(
            f"is the posterior of another rig: {far[0]} of this one is more than {FAR:g} standard deviations off it",
            source=source_name(path),
            remedy=REMEDY,
        )
    draws = thin_draws(every, count)
    matrix = np.stack(list(draws.values()), axis=1)
    return _rigs(table, f"{len(matrix)} samples of {source_name(path)}", tuple(draws), matrix)


def rigs_from_covariance(
    table: ParameterTable, provenance: Mapping[str, object], count: int, source: object = ""
) -> Rigs:
    """``count`` rigs from the covariance of an identified rig; from the tolerances of a drawing.

    Raises :class:`InputError`, which names the rig's file ``source``, if its covariance is invalid.
    """
    carried = provenance.get("covariance")
    if carried is None:
        known = [entry for entry in table.entries if entry.tolerance > 0.0]
        names = tuple(entry.name for entry in known)
        covariance = np.diag([entry.tolerance**2 for entry in known])
        origin = f"{count} rigs within the tolerances of the drawing"
    else:
        names, covariance = _covariance(carried, table, source)
        origin = f"{count} rigs from the covariance of the fit"
    centre = np.array(table.values_of(names))
    lower = np.array([table[name].lower for name in names])
    upper = np.array([table[name].upper for name in names])
    # In units of their standard deviations: 1e7 N/m beside 1e-4 m would leave no digits for a check.
    spread = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(spread, spread)
    zero = np.zeros(len(names))
    random = np.random.default_rng(SEED)
    drawn = centre + spread * random.multivariate_normal(zero, correlation, count, method="eigh")
    return _rigs(table, origin, names, np.clip(drawn, lower, upper))


def _covariance(
    carried: object, table: ParameterTable, source: object
) -> tuple[tuple[str, ...], NDArray[np.float64]]:
    wrong = InputError(
        "provenance.covariance is no covariance of the rig's parameters",
        source=source,
        remedy="identify the rig again",
    )
    if not isinstance(carried, Mapping):
        raise wrong
    names, matrix = carried.get("names"), carried.get("matrix")
    try:
        covariance = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        raise wrong from None
    if not isinstance(names, list | tuple) or not all(
        isinstance(name, str) and name in table for name in names
    ):
        raise wrong
    if covariance.shape != (len(names), len(names)) or not np.isfinite(covariance).all():
        raise wrong
    if not (np.diag(covariance) > 0.0).all():
        raise wrong
    size = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(size, size)
    asymmetry = np.max(np.abs(correlation - correlation.T))
    if asymmetry > ROUNDING or np.min(np.linalg.eigvalsh(correlation)) < -ROUNDING:
        raise wrong
    return tuple(names), covariance


def _rigs(table: ParameterTable, source: str, names: tuple[str, ...], matrix: NDArray[np.float64]) -> Rigs:
    base = table.as_dict()
    return Rigs(source, tuple(base | dict(zip(names, map(float, row), strict=True)) for row in matrix))


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
        model: what it was designed for.
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

    model: RigModel
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
    model: RigModel,
    rigs: Rigs,
    weights: ParameterTable,
    origin: Origin,
    progress: Progress,
    order: int | None = None,
    rate: float = RATE,
) -> Design:
    """The H-infinity controller of a rig, checked on ``rigs``; reduced to ``order`` states if given.

    ``rate`` [1/s] is that of the computer. Raises :class:`InputError` where the weights admit no controller or the
    order is not possible.
    """
    plant, p = model.build(), as_values(model.table.as_dict())
    masses, bandwidth = paper_masses(plant, p), float(p["motor_reference_bandwidth"])
    space = quarter_car_space(masses)
    progress("H-infinity synthesis")
    synthesis = synthesise_hinf(generalised_plant(space, bandwidth, weights))
    controller = synthesis.controller if order is None else reduce_order(synthesis.controller, order)
    loop = design_loop(space, bandwidth)
    sampled = discretise(controller, rate)
    progress(f"robustness on {len(rigs.values)} rigs")
    robustness = assess_robustness(
        controller, (paper_masses(plant, as_values(each)) for each in rigs.values), bandwidth, weights
    )
    progress("effect of the regularising weights")
    regularisation = tuple(
        _regularised(space, bandwidth, weights, name, factor) for name in REGULARISATION for factor in FACTORS
    )
    return Design(
        model=model,
        masses=masses,
        bandwidth=bandwidth,
        weights=weights,
        synthesis=synthesis,
        controller=controller,
        margins=compute_margins(loop, controller),
        digital=DigitalController(sampled, alpha_map(plant, p)),
        digital_margins=compute_margins(sampled_plant(loop, rate), sampled),
        rigs=rigs,
        robustness=robustness,
        regularisation=regularisation,
        origin=origin,
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
