"""What is exported: an identified rig with all that is known about it, and its equations as CasADi functions.

Every export takes one :class:`ExportedModel` and a folder, and writes files there. The posterior and the
diagnosis are included as far as a format can hold them. Formats with equations share the values at rest, where a
simulation begins, the record of the signals (names, units, nominal values) and :func:`casadi_functions`,
functions of x, u and p.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import Any

import numpy as np
from casadi import Function
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.export.equations import Equations, Signal, build_equations
from savgs_ident.plants.base import find_rest, nominal_inputs
from savgs_ident.plants.quarter_car.catalogue import build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.symbolic.translate import to_casadi


@dataclass(frozen=True)
class ExportedModel:
    """An identified rig to be exported.

    Attributes:
        rig: the rig, as drawn or identified.
        effects: names of the effects in the model besides the frictionless rig, a diagnosed effect included.
        samples: draws of a posterior by parameter, each (n,), SI; empty without a posterior.
        diagnosis: the document of a diagnosis; empty without one.
    """

    rig: Rig
    effects: tuple[str, ...]
    samples: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    diagnosis: Mapping[str, object] = field(default_factory=dict)

    @property
    def table(self) -> ParameterTable:
        """All parameters of the model."""
        return model_parameters(self.rig, self.effects)

    @property
    def plant(self) -> QuarterCar:
        """The rig with its effects."""
        return build_model(self.rig, self.effects)

    @property
    def equations(self) -> Equations:
        """The model's equations."""
        return build_equations(self.plant, self.table)

    @property
    def covariance(self) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Names and covariance [products of their units], (n, n), of the estimated parameters.

        Empty for a drawing.
        """
        carried = self.rig.provenance.get("covariance")
        if not isinstance(carried, Mapping):
            return (), np.zeros((0, 0))
        return tuple(carried["names"]), np.array(carried["matrix"], dtype=np.float64)


def resting_state(model: ExportedModel) -> list[float]:
    """x [SI] at rest in the nominal state: the initial state of a simulation.

    Raises :class:`InputError` if the rig finds no rest there.
    """
    p = as_values(model.table.as_dict())
    plant = model.plant
    rest = find_rest(plant, p, nominal_inputs(plant, p))
    x = [*map(float, rest.q), *(0.0 for _ in rest.q), *map(float, rest.s)]
    check_rest(x, model)
    return x


def check_rest(found: Iterable[float], model: ExportedModel) -> None:
    """Raise :class:`InputError` unless the ``found`` rest [SI] in the nominal state is finite."""
    if not all(isfinite(value) for value in found):
        nominal = [
            f"{each.about} {model.table[each.rest].value:.4g} {each.unit}"
            for each in model.plant.inputs
            if each.rest
        ]
        raise InputError(
            f"the rig finds no rest in its nominal state ({', '.join(nominal)})",
            remedy="mend its spring (k_sd, l_free), masses or hardpoints",
        )


def resting_inputs(model: ExportedModel) -> list[float]:
    """u [SI] at rest: zero except for inputs that rest at a value of their own."""
    equations, table = model.equations, model.table
    rest = {each.name: table[each.rest].value for each in equations.model.inputs if each.rest}
    return [rest.get(signal.name, 0.0) for signal in equations.inputs]


def signals_record(model: ExportedModel) -> dict[str, object]:
    """Names and units of x, u, the outputs and p in their order, with values at rest and of the parameters.

    Raises :class:`InputError` if the rig finds no rest.
    """
    equations, table = model.equations, model.table
    return {
        "x": _at_rest(equations.states, resting_state(model)),
        "u": _at_rest(equations.inputs, resting_inputs(model)),
        "outputs": [_signal_record(signal) for signal in equations.outputs],
        "p": [
            {"name": name, "unit": table[name].unit, "about": table[name].about, "value": table[name].value}
            for name in equations.parameters
        ],
    }


def _signal_record(signal: Signal) -> dict[str, object]:
    return {"name": signal.name, "unit": signal.unit, "about": signal.about}


def _at_rest(signals: Sequence[Signal], values: Sequence[float]) -> list[dict[str, object]]:
    return [
        _signal_record(signal) | {"at_rest": value} for signal, value in zip(signals, values, strict=True)
    ]


def casadi_functions(model: ExportedModel) -> dict[str, Function]:
    """``rates`` (x, u, p) to dx/dt, ``outputs`` (x, u, p), ``residual`` (x, y, u, p); columns in the order of names.

    Raises :class:`TranslationError` for an effect whose law has no translation.
    """
    equations = model.equations
    x, u = np.zeros(len(equations.states)), np.zeros(len(equations.inputs))
    given = {"x": x, "u": u, "p": np.array(model.table.values_of(equations.parameters))}
    implicit = {"x": x, "y": np.zeros(x.size - 2)} | given
    translations: tuple[tuple[str, Callable[..., Any], dict[str, np.ndarray], str], ...] = (
        ("rates", equations.rates, given, "dx"),
        ("outputs", equations.read, given, "outputs"),
        ("residual", equations.residual, implicit, "residual"),
    )
    return {
        name: to_casadi(name, function, inputs, [result]) for name, function, inputs, result in translations
    }
