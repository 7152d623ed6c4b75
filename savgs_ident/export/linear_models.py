"""The linear models in an export: equation (8) of the paper, and the exact linearisation without friction.

Both are linearised at the nominal link angle. The exact one keeps what a diagnosis added except friction: a compliant
mount is in it, with its state, and of a learned force the stiffness and the damping. In a JSON document a state space
is its matrices, and its signals with their units in order.
"""

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control import linearisation
from savgs_ident.control.linear_equivalent import (
    Equivalent,
    nominal_equivalent,
    paper_masses,
    quarter_car_space,
)
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import AbstractInputLaw, Family
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce
from savgs_ident.effects.learned_functions import frictions_at
from savgs_ident.export.document import JsonValue
from savgs_ident.export.exported_model import ExportedModel, check_rest
from savgs_ident.plants.quarter_car.plant import QuarterCar

EQUIVALENT_UNITS = {"k_eq": "N/m", "c_eq": "N s/m", "alpha": "m/rad", "ratio": "1"}
"""Units of the linear equivalent."""

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
    """A state space with its description.

    Attributes:
        about: description, one sentence.
        space: with named signals.
        units: of all its signals by name.
    """

    about: str
    space: control.StateSpace
    units: dict[str, str]

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Frequency response (outputs, inputs, F) at frequencies [Hz], (F,)."""
        return np.asarray(self.space(2j * np.pi * frequency, squeeze=False), np.complex128)


def is_friction(effect: Effect) -> bool:
    """Whether an effect is dry friction, which a linearisation at rest would show as a spring or a stiff damper.

    A learned force is not, although it may contain some: see :func:`values_without_friction`.
    """
    return effect.law.family is Family.FRICTION


def without_friction(model: QuarterCar) -> QuarterCar:
    """The model without dry friction, and without the faults of its cam."""
    kept = [
        each for each in model.effects if not is_friction(each) and not isinstance(each.law, AbstractInputLaw)
    ]
    return QuarterCar(model.damper, effects=tuple(kept))


def values_without_friction(model: ExportedModel) -> Values:
    """All parameters [SI], the weights of the frictions within a learned force set to zero."""
    learned = [each for each in model.plant.effects if isinstance(each.law, LearnedForce)]
    frictions = [name for effect in learned for name in frictions_at(effect.port)]
    return as_values(model.table.as_dict() | dict.fromkeys(frictions, 0.0))


def linear_equivalent(model: ExportedModel) -> Equivalent:
    """k_eq, c_eq, alpha and R in the nominal state; see :data:`EQUIVALENT_UNITS`."""
    return nominal_equivalent(model.plant, as_values(model.table.as_dict()))


def equation_8(model: ExportedModel) -> LinearModel:
    """Equation (8) with the model's numbers."""
    p = as_values(model.table.as_dict())
    space = quarter_car_space(paper_masses(model.plant, p))
    about = "equation (8): two masses, the linear equivalent between them, the link as an actuator in series"
    return _linear(about, space, {})


def exact(model: ExportedModel) -> LinearModel:
    """The exact linearisation at rest, the link at its nominal angle, without friction.

    Raises :class:`InputError` where the rig has none, or no static equilibrium.
    """
    p, bare = values_without_friction(model), without_friction(model.plant)
    at = linearisation.nominal_rest(bare, p)
    check_rest(at.root, model)
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


LAW = "dx/dt = A x + B u, y = C x + D u"
"""The meaning of the matrices."""

_KINDS = ("states", "inputs", "outputs")


def space_record(linear: LinearModel) -> dict[str, object]:
    """A linear model as values of JSON."""
    space, units = linear.space, linear.units
    labels = dict(zip(_KINDS, (space.state_labels, space.input_labels, space.output_labels), strict=True))
    signals = {kind: {name: units[name] for name in labels[kind]} for kind in _KINDS}
    matrices = {name: np.asarray(getattr(space, name)).tolist() for name in "ABCD"}
    return {"about": linear.about, "law": LAW, **signals, **matrices}


def parse_space(place: JsonValue, name: str) -> control.StateSpace:
    """The state space at a place, called ``name``; raises :class:`InputError` for an invalid one."""
    fields = place.table(("about", "law", *_KINDS, *"ABCD"))
    fields["law"].text((LAW,))
    labels = {kind: _signals(fields[kind]) for kind in _KINDS}
    n, m, k = (len(labels[kind]) for kind in _KINDS)
    shapes = {"A": (n, n), "B": (n, m), "C": (k, n), "D": (k, m)}
    matrices = [fields[matrix].matrix(*shape) for matrix, shape in shapes.items()]
    try:
        return control.ss(*matrices, **labels, name=name)
    except (ValueError, TypeError) as error:
        raise InputError(f"{place.where} is no state space: {error}") from error


def _signals(place: JsonValue) -> list[str]:
    """The names of the signals, after a check that their units are texts."""
    found = place.entries()
    for unit in found.values():
        unit.text()
    if not found:
        raise place.wrong("a table of signals")
    return list(found)
