"""The linear models in an export: the exact linearisation without friction, and of the rig equation (8), too.

They are of the nominal state. The exact one keeps what a diagnosis added except friction: a compliant
mount is in it, with its state, and of a learned force the stiffness and the damping. In a JSON document a state space
is its matrices, and its signals with their units in order.
"""

from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from savgs_ident.control.linear_equivalent import (
    UNITS,
    Equivalent,
    nominal_equivalent,
    paper_masses,
    quarter_car_space,
)
from savgs_ident.control.linearisation import linear_signals
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import AbstractInputLaw, Family
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce
from savgs_ident.effects.learned_functions import frictions_at
from savgs_ident.export.document import JsonValue
from savgs_ident.export.exported_model import ExportedModel, check_rest
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.simulate.linearisation import linearise_plant, nominal_rest

EQUIVALENT_UNITS = {"k_eq": "N/m", "c_eq": "N s/m", "alpha": "m/rad", "ratio": "1"}
"""Units of the linear equivalent."""

EQUATION_8 = "equation_8"
"""Name of the paper's model."""
EXACT = "exact"
"""Name of the exact linearisation."""


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


def without_friction(model: AbstractPlant) -> AbstractPlant:
    """The plant without dry friction, and without what its inputs are beside what is recorded of them."""
    kept = [
        each for each in model.effects if not is_friction(each) and not isinstance(each.law, AbstractInputLaw)
    ]
    return replace(model, effects=tuple(kept))


def values_without_friction(model: ExportedModel) -> Values:
    """All parameters [SI], the weights of the frictions within a learned force set to zero."""
    learned = [each for each in model.plant.effects if isinstance(each.law, LearnedForce)]
    frictions = [name for effect in learned for name in frictions_at(effect.port)]
    return as_values(model.table.as_dict() | dict.fromkeys(frictions, 0.0))


def linear_equivalent(model: RigModel) -> Equivalent:
    """k_eq, c_eq, alpha and R in the nominal state; see :data:`EQUIVALENT_UNITS`."""
    return nominal_equivalent(model.build(), as_values(model.table.as_dict()))


def equation_8(model: RigModel) -> LinearModel:
    """Equation (8) with the model's numbers."""
    space = quarter_car_space(paper_masses(model.build(), as_values(model.table.as_dict())))
    about = "equation (8): two masses, the linear equivalent between them, the link as an actuator in series"
    return LinearModel(about, space, dict(UNITS))


def exact(model: ExportedModel) -> LinearModel:
    """The exact linearisation at rest in the nominal state, without friction.

    Raises :class:`InputError` where the plant has none, or no rest.
    """
    p, bare = values_without_friction(model), without_friction(model.plant)
    at, signals = nominal_rest(bare, p), linear_signals(bare)
    check_rest(at.root, model)
    found = linearise_plant(bare, p, at, signals)
    about = f"exact linearisation of the rig at rest, {signals.nominal}, without friction"
    return LinearModel(about, found.space, found.units)


def linear_names(model: ExportedModel) -> tuple[str, ...]:
    """Names of the linear models of a plant."""
    return (EXACT,) if model.quarter_car is None else (EQUATION_8, EXACT)


def linear_models(model: ExportedModel) -> dict[str, LinearModel]:
    """All of them by name."""
    car = model.quarter_car
    found = (exact(model),) if car is None else (equation_8(car), exact(model))
    return dict(zip(linear_names(model), found, strict=True))


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
