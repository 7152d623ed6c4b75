"""From a function written in JAX to a CasADi function: the same equations, not a copy of them.

    >>> import jax.numpy as jnp
    >>> def energy(mass, velocity):
    ...     return 0.5 * mass * jnp.sum(velocity**2)
    >>> translated = to_casadi("energy", energy, {"mass": np.ones(()), "velocity": np.ones(3)}, ["energy"])
    >>> translated
    Function(energy:(mass,velocity[3])->(energy) SXFunction)
    >>> float(translated(2.0, [1.0, 2.0, 2.0]))
    9.0

The function is traced once, at the shapes of the examples given, and the trace is evaluated on CasADi scalars,
equation by equation. Each equation applies one primitive. If its operands depend on the inputs, the rule of the
primitive's name builds the expressions; if they are known, JAX computes the value immediately.

Arrays become columns, last index fastest. Integers and booleans become numbers. CasADi differentiates what is
computed: derivatives that were overridden in JAX (``stop_gradient``, ``custom_jvp``) are not carried over, and where
JAX gives the mean of two slopes at a kink, CasADi gives one of them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from casadi import SX, Function
from jax.extend import source_info_util
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

from savgs_ident.symbolic.indexing import MOVING, move
from savgs_ident.symbolic.operations import (
    BY_EQUATION,
    ELEMENTWISE,
    REDUCTIONS,
    RUNNING,
    Grid,
    Operand,
    Scalars,
    TranslationError,
    accumulate_along,
    as_grid,
    grid_from_column,
    multiply,
    reduce_axes,
    select_case,
    to_column,
)


def to_casadi(
    name: str,
    function: Callable[..., Any],
    inputs: Mapping[str, Any],
    outputs: Sequence[str],
    options: Mapping[str, Any] | None = None,
) -> Function:
    """``function`` as a CasADi function ``name`` with named inputs and outputs.

    ``inputs`` are names and examples of its arguments, one array each; ``outputs`` names its results, one
    array each; ``options`` are CasADi's. Raises :class:`TranslationError` for an operation that has no
    translation.
    """
    examples = [np.asarray(example) for example in inputs.values()]
    symbols = [SX.sym(key, example.size) for key, example in zip(inputs, examples, strict=True)]
    results = translate(function, *examples)(*symbols)
    return Function(name, symbols, list(results), list(inputs), list(outputs), dict(options or {}))


Translated = Callable[..., tuple[SX, ...]]
"""Takes one column for each array in the arguments, gives one for each array in the results."""


def translate(function: Callable[..., Any], *examples: Any) -> Translated:
    """``function`` as one of CasADi columns, for arguments of the shapes of ``examples``.

    Arguments and results may be trees of arrays: their leaves are taken in JAX's order, dictionaries by sorted
    key. The translation raises :class:`TranslationError`, when called, for an operation without one, or for a
    column of the wrong length.
    """
    closed = jax.make_jaxpr(function)(*examples)
    shapes = [tuple(variable.aval.shape) for variable in closed.jaxpr.invars]

    def translated(*columns: SX) -> tuple[SX, ...]:
        if [column.numel() for column in columns] != [int(np.prod(shape)) for shape in shapes]:
            raise TranslationError(
                f"columns of {[column.numel() for column in columns]} entries given for arrays of {shapes}"
            )
        grids = [grid_from_column(column, shape) for column, shape in zip(columns, shapes, strict=True)]
        return tuple(to_column(result) for result in evaluate(closed, grids))

    return translated


def evaluate(closed: ClosedJaxpr | Jaxpr, operands: Sequence[Operand]) -> list[Operand]:
    """Results of a traced function for operands that are expressions or known.

    Raises :class:`TranslationError` for a primitive that has no rule.
    """
    jaxpr, constants = (closed, ()) if isinstance(closed, Jaxpr) else (closed.jaxpr, closed.consts)
    values: dict[Any, Operand] = dict(zip(jaxpr.invars, operands, strict=True))
    values |= {v: np.asarray(c) for v, c in zip(jaxpr.constvars, constants, strict=True)}

    def value_of(atom: Any) -> Operand:
        return np.asarray(atom.val, _kind(atom)) if isinstance(atom, Literal) else values[atom]

    for equation in jaxpr.eqns:
        results = _apply(equation, [value_of(atom) for atom in equation.invars])
        values |= dict(zip(equation.outvars, results, strict=True))
    return [value_of(atom) for atom in jaxpr.outvars]


def _kind(variable: Any) -> np.dtype[np.generic]:
    """The kind of a variable's numbers."""
    kind: np.dtype[np.generic] = variable.aval.dtype
    return kind


def _apply(equation: Any, operands: list[Operand]) -> Sequence[Operand]:
    try:
        return _results(equation, operands)
    except TranslationError as error:
        if error.place:
            raise
        # An equation traced inside a library has no place of its own: the place of the call is given.
        raise TranslationError(error.what, source_info_util.summarize(equation.source_info)) from None


def _results(equation: Any, operands: list[Operand]) -> Sequence[Operand]:
    name = equation.primitive.name
    if name in NESTING:
        return evaluate(equation.params[NESTING[name]], operands)
    if not any(isinstance(operand, Grid) for operand in operands):
        found = equation.primitive.bind(*operands, **equation.params)
        return [np.asarray(each) for each in (found if equation.primitive.multiple_results else [found])]
    if name not in RULES:
        raise TranslationError(f"'{name}' has no translation to CasADi")
    for variable in equation.outvars:
        if not any(np.issubdtype(_kind(variable), kind) for kind in _EXACT):
            raise TranslationError(
                f"'{name}' gives {_kind(variable)} numbers, CasADi knows double precision only"
            )
    return RULES[name](equation, operands)


Rule = Callable[[Any, list[Operand]], list[Grid]]

NESTING: dict[str, str] = {
    "checkpoint": "jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "remat2": "jaxpr",
}
"""Primitives that apply another function, by the names of all versions of JAX, and the parameter that holds it."""

_EXACT = (np.bool_, np.integer, np.float64)


def _elementwise(equation: Any, operands: list[Operand]) -> list[Grid]:
    name = equation.primitive.name
    function = ELEMENTWISE[name] if name in ELEMENTWISE else BY_EQUATION[name](equation)
    return [_each(function, [as_grid(operand) for operand in operands])]


def _each(function: Scalars, grids: list[Grid]) -> Grid:
    """``function`` on the elements of grids, an axis of length one serving for all along it."""
    shape = np.broadcast_shapes(*(grid.shape for grid in grids))
    places = [np.broadcast_to(grid.places, shape).ravel() for grid in grids]
    columns = [[grid.items[i] for i in row] for grid, row in zip(grids, places, strict=True)]
    return Grid(tuple(SX(function(*items)) for items in zip(*columns, strict=True)), shape)


def _conditional(equation: Any, operands: list[Operand]) -> list[Grid]:
    """All branches evaluated, one of them selected."""
    which, *arguments = operands
    index = as_grid(which).items[0]
    ends = [evaluate(branch, arguments) for branch in equation.params["branches"]]
    results = []
    for candidates in zip(*ends, strict=True):
        grids = [as_grid(candidate) for candidate in candidates]
        columns = zip(*(grid.items for grid in grids), strict=True)
        results.append(Grid(tuple(select_case(index, column) for column in columns), grids[0].shape))
    return results


RULES: dict[str, Rule] = {
    **dict.fromkeys([*ELEMENTWISE, *BY_EQUATION], _elementwise),
    **dict.fromkeys(MOVING, move),
    **dict.fromkeys(REDUCTIONS, reduce_axes),
    **dict.fromkeys(RUNNING, accumulate_along),
    "dot_general": multiply,
    "cond": _conditional,
}
"""Every primitive that can be translated, except those in :data:`NESTING`."""
