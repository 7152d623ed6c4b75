"""python-control: the linear models as state spaces, the nonlinear one as a system of differential equations.

    systems = si.load_python_control("model-control.json")
    systems["exact"]                                 # control.StateSpace; of the rig "equation_8", too
    rig = systems["nonlinear"]                       # control.NonlinearIOSystem, friction included
    x0, u0 = si.resting_point("model-control.json")
    control.input_output_response(rig, t, u, x0, params={"k_t": 2.6e5})

The file holds numbers and names, no code: the equations are those of this package, compiled by JAX, with the
parameters and the effects that the file names. Another plant than the quarter car is given to the call as a model of
it. Every parameter can be changed through ``params``.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import control
import jax
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.export.document import JsonValue, read_document, write_json_text
from savgs_ident.export.exported_model import ExportedModel, resting_inputs, resting_state
from savgs_ident.export.json_export import model_record, parse_model
from savgs_ident.export.linear_models import linear_models, linear_names, parse_space, space_record
from savgs_ident.plants.model import Model

SCHEMA = 1
"""The version of the file; another one is refused."""

KIND = "savgs_ident python-control"
"""Identifies the file."""

NAME = "model-control.json"
"""The name of the file."""

NONLINEAR = "nonlinear"
"""The name of the system with all effects."""

REMEDY = "give the model-control.json that `savgs-ident export --to python-control` wrote"

_KEYS = ("schema", "kind", "model", "state_spaces", "at_rest")

System: TypeAlias = "control.StateSpace | control.NonlinearIOSystem"
Vector = NDArray[np.float64]


def write_python_control(model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write model-control.json.

    Raises :class:`InputError` if it cannot be written, or the plant finds no rest.
    """
    record = {
        "schema": SCHEMA,
        "kind": KIND,
        "model": model_record(model),
        "state_spaces": {name: space_record(each) for name, each in linear_models(model).items()},
        "at_rest": {"x": resting_state(model), "u": resting_inputs(model)},
    }
    return (write_json_text(folder / NAME, record),)


def load_python_control(path: str | Path, model: Model | None = None) -> dict[str, System]:
    """The systems by name, signals named: those in the file's ``state_spaces``, and ``nonlinear``.

    Args:
        path: the model-control.json that an export to "python-control" wrote.
        model: for a plant other than the quarter car, a model of it, which gets the values of the file.

    Raises :class:`InputError`, with file, place and remedy, for any other file.
    """
    return read_document(Path(path), REMEDY, lambda place: _systems(place, model))


def resting_point(path: str | Path, model: Model | None = None) -> tuple[Vector, Vector]:
    """States (n,) and inputs (k,) [SI] of ``nonlinear`` at rest, inputs nominal: the start of a simulation.

    Takes and raises what :func:`load_python_control` does.
    """
    return read_document(Path(path), REMEDY, lambda place: _at_rest(_fields(place), model))


def nonlinear_system(model: ExportedModel) -> control.NonlinearIOSystem:
    """dx/dt = rates(x, u, p), y = read(x, u, p) of the model's equations, compiled when first used."""
    equations, values = model.equations, model.table.as_dict()
    rates, outputs = jax.jit(equations.rates), jax.jit(equations.read)

    def p(params: Mapping[str, float]) -> Vector:
        if len(params) != len(values):
            unknown = next(name for name in params if name not in values)
            raise InputError(f"there is no parameter '{unknown}'", remedy="choose among the system's params")
        return np.array([params[name] for name in equations.parameters], dtype=np.float64)

    def update(t: float, x: Vector, u: Vector, params: Mapping[str, float]) -> Vector:
        return np.asarray(rates(np.asarray(x, np.float64), np.asarray(u, np.float64), p(params)))

    def output(t: float, x: Vector, u: Vector, params: Mapping[str, float]) -> Vector:
        return np.asarray(outputs(np.asarray(x, np.float64), np.asarray(u, np.float64), p(params)))

    return control.NonlinearIOSystem(
        update,
        output,
        states=[signal.name for signal in equations.states],
        inputs=[signal.name for signal in equations.inputs],
        outputs=[signal.name for signal in equations.outputs],
        params=values,
        name=NONLINEAR,
    )


def _systems(document: JsonValue, known: Model | None) -> dict[str, System]:
    fields = _fields(document)
    model = parse_model(fields["model"], known)
    spaces = fields["state_spaces"].table(linear_names(model))
    systems: dict[str, System] = {name: parse_space(place, name) for name, place in spaces.items()}
    return systems | {NONLINEAR: nonlinear_system(model)}


def _fields(document: JsonValue) -> dict[str, JsonValue]:
    fields = document.table(_KEYS)
    if fields["kind"].value != KIND:
        raise fields["kind"].wrong(f"'{KIND}'")
    if fields["schema"].value != SCHEMA or isinstance(fields["schema"].value, bool):
        raise fields["schema"].wrong(f"the schema {SCHEMA}, which this version reads")
    return fields


def _at_rest(fields: Mapping[str, JsonValue], known: Model | None) -> tuple[Vector, Vector]:
    equations, rest = parse_model(fields["model"], known).equations, fields["at_rest"].table(("x", "u"))
    (x,) = JsonValue([rest["x"].value], rest["x"].where).matrix(1, len(equations.states))
    (u,) = JsonValue([rest["u"].value], rest["u"].where).matrix(1, len(equations.inputs))
    return x, u
