"""The linear models that travel along: equation (8) of the paper, and the exact linearisation without friction.

Both are taken at the nominal link angle. The exact one keeps what a diagnosis added as far as it is no friction: a
mount that gives way is in it, with its state, and of a learned force the stiffness and the damping.
"""

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control import linearisation, quarter_car_space
from savgs_ident.control.linear_equivalent import Equivalent
from savgs_ident.control.two_masses import nominal_equivalent, paper_masses
from savgs_ident.effects.learned.forces import AbstractLearned, frictions_at
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.signals import check_rest
from savgs_ident.model.effect import AbstractEffect, AbstractForce, AbstractGrip, AbstractRoadFault, Port
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values

EQUIVALENT_UNITS = {"k_eq": "N/m", "c_eq": "N s/m", "alpha": "m/rad", "ratio": "1"}
"""Of the parts of the linear equivalent."""

_UNITS = {
    "sprung_velocity": "m/s",
    "unsprung_velocity": "m/s",
    "wishbone_velocity": "rad/s",
    "road_velocity": "m/s",
    "lin_velocity": "m/s",
    "link_velocity": "rad/s",
    "susp_deflection": "m",
    "tyre_deflection": "m",
    "sprung_position": "m",
    "lin_position": "m",
    "road_height": "m",
    "wishbone_angle": "rad",
    "link_angle": "rad",
    "sprung_accel": "m/s^2",
    "tyre_load": "N",
    "link_torque": "N m",
}


LINEAR = ("equation_8", "exact")
"""Names of the linear models."""


@dataclass(frozen=True)
class LinearModel:
    """A state space and what it is.

    Attributes:
        about: in one sentence.
        space: with named signals.
        units: of all its signals by name.
    """

    about: str
    space: control.StateSpace
    units: dict[str, str]

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Frequency response (outputs, inputs, F) at frequencies [Hz], (F,)."""
        return np.asarray(self.space(2j * np.pi * frequency, squeeze=False), np.complex128)


def is_friction(effect: AbstractEffect) -> bool:
    """Whether an effect is dry friction, which a linearisation at rest would show as a spring or a stiff damper.

    A learned force is not, though there may be some in it: see :func:`values_without_friction`.
    """
    if isinstance(effect, AbstractLearned):
        return False
    scrubs = isinstance(effect, AbstractForce) and effect.port is Port.TYRE_LATERAL
    return isinstance(effect, AbstractGrip) or scrubs or any(state.slips for state in effect.states)


def without_friction(model: QuarterCar) -> QuarterCar:
    """The model without dry friction, and without what its cam does behind its encoder."""
    kept = [
        each for each in model.effects if not is_friction(each) and not isinstance(each, AbstractRoadFault)
    ]
    return QuarterCar(model.damper, tuple(kept))


def values_without_friction(model: ExportedModel) -> Values:
    """All parameters [SI], those that weigh the frictions within a learned force at zero."""
    learned = [each for each in model.equations.model.effects if isinstance(each, AbstractLearned)]
    frictions = [name for effect in learned for name in frictions_at(effect.port)]
    return as_values(model.table.as_dict() | dict.fromkeys(frictions, 0.0))


def equivalent_of(model: ExportedModel) -> Equivalent:
    """k_eq, c_eq, alpha and R in the nominal state; see :data:`EQUIVALENT_UNITS`."""
    return nominal_equivalent(model.equations.model, as_values(model.table.as_dict()))


def equation_8(model: ExportedModel) -> LinearModel:
    """Equation (8) with the model's numbers."""
    p = as_values(model.table.as_dict())
    space = quarter_car_space.quarter_car_space(paper_masses(model.equations.model, p))
    about = "equation (8): two masses, the linear equivalent between them, the link as an actuator in series"
    return _linear(about, space, {})


def exact(model: ExportedModel) -> LinearModel:
    """The exact linearisation at rest, the link at its nominal angle, without friction.

    Raises :class:`InputError` where the rig has none, or finds no rest.
    """
    p, bare = values_without_friction(model), without_friction(model.equations.model)
    at = linearisation.resting(bare, p, p["psi_nominal"])
    check_rest(map(float, at.q), model)
    space = linearisation.linearise(bare, p, at)
    internal = {f"{place}_{state.name}": state.unit for place, state in enumerate(bare.states)}
    about = "exact linearisation of the rig at rest, the link at its nominal angle, without friction"
    return _linear(about, space, internal)


def linear_models(model: ExportedModel) -> dict[str, LinearModel]:
    """All of them by name."""
    return dict(zip(LINEAR, (equation_8(model), exact(model)), strict=True))


def _linear(about: str, space: control.StateSpace, internal: dict[str, str]) -> LinearModel:
    known = _UNITS | internal
    names = (*space.state_labels, *space.input_labels, *space.output_labels)
    return LinearModel(about, space, {name: known[name] for name in names})
