"""The equations told to CasADi: functions of x, u and p with named inputs and outputs."""

from collections.abc import Callable
from typing import Any

import numpy as np
from casadi import Function

from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.symbolic.translate import to_casadi


def casadi_functions(model: ExportedModel) -> dict[str, Function]:
    """``rates`` (x, u, p) to dx/dt, ``outputs`` (x, u, p), ``residual`` (x, y, u, p); columns in the order of names.

    Raises :class:`TranslationError` for an effect whose law has no translation.
    """
    equations = model.equations
    x, u = np.zeros(len(equations.states)), np.zeros(len(equations.inputs))
    given = {"x": x, "u": u, "p": np.array(model.table.values_of(equations.parameters))}
    implicit = {"x": x, "y": np.zeros(x.size - 2)} | given
    told: tuple[tuple[str, Callable[..., Any], dict[str, np.ndarray], str], ...] = (
        ("rates", equations.rates, given, "dx"),
        ("outputs", equations.read, given, "outputs"),
        ("residual", equations.residual, implicit, "residual"),
    )
    return {name: to_casadi(name, function, inputs, [result]) for name, function, inputs, result in told}
