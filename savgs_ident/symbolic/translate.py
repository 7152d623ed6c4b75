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
equation by equation. Each equation applies one primitive. If its operands are known, JAX computes the value
immediately; if they depend on the inputs, the rule of the primitive's name builds the expressions. Rules that compute
are in :mod:`savgs_ident.symbolic.operations`.

Operations that move elements (reshape, slice, concatenate, pad, gather, ...) are left to JAX itself: it is given an
array of whole numbers, the index of each element, and the result shows where each element went. So none of them is
written a second time, and another one is one more name in :data:`MOVING`. An index that depends on the inputs (the
piece of a table that an input falls into) has a few possible values: the operation is done for each of them, and the
result is selected among theirs.

In the result arrays are columns, last index fastest; integers and booleans are numbers. CasADi differentiates what is
computed: derivatives that were overridden in JAX (``stop_gradient``, ``custom_jvp``) are not carried over, and where
JAX gives the mean of two slopes at a kink, CasADi gives one of them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import jax
import numpy as np
from casadi import SX, Function
from jax.extend import source_info_util
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal
from jax.lax import GatherScatterMode
from numpy.typing import NDArray

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
    as_known,
    grid_from_column,
    multiply,
    reduce_axes,
    select_case,
    to_column,
)

EVERY = None
_NOWHERE = -1
"""The index of what lies outside: the last of the pool."""

MOVING: dict[str, tuple[int, ...] | None] = {
    "broadcast_in_dim": EVERY,
    "concatenate": EVERY,
    "dynamic_slice": (0,),
    "dynamic_update_slice": (0, 1),
    "gather": (0,),
    "pad": EVERY,
    "reshape": EVERY,
    "rev": EVERY,
    "scatter": (0, 2),
    "slice": EVERY,
    "split": EVERY,
    "squeeze": EVERY,
    "stack": EVERY,
    "transpose": EVERY,
    "unstack": EVERY,
}
"""Name of the operation: which of its operands are elements that move; the others are indices."""


def move(equation: Any, operands: list[Operand]) -> list[Grid]:
    """The results of an operation in :data:`MOVING`."""
    name = equation.primitive.name
    moving = MOVING[name]
    carried = range(len(operands)) if moving is None else moving
    resolved: list[Operand] = list(operands)
    for i, operand in enumerate(operands):
        if i in carried:
            continue
        known = as_known(operand)
        if known is None:
            return _move_to_unknown(equation, resolved, i)
        resolved[i] = known.astype(equation.invars[i].aval.dtype)
    return _move_to_known(equation, resolved, tuple(carried))


def _move_to_known(equation: Any, operands: list[Operand], carried: tuple[int, ...]) -> list[Grid]:
    pool: list[SX] = []
    arguments: list[Any] = list(operands)
    for i in carried:
        grid = as_grid(operands[i])
        arguments[i] = grid.places + len(pool)
        pool.extend(grid.items)
    parameters = equation.params | ({"fill_value": _NOWHERE} if "fill_value" in equation.params else {})
    found = equation.primitive.bind(*arguments, **parameters)
    pool.append(SX(_filling(equation)))
    results = [np.asarray(each) for each in (found if equation.primitive.multiple_results else [found])]
    return [Grid(tuple(pool[place] for place in result.ravel()), result.shape) for result in results]


def _filling(equation: Any) -> float:
    """The value of elements outside the array, where those are filled."""
    filling = equation.params.get("fill_value")
    return float("nan") if filling is None else float(filling)


def _move_to_unknown(equation: Any, operands: list[Operand], unknown: int) -> list[Grid]:
    name = equation.primitive.name
    if name == "dynamic_slice":
        return _slice_from_unknown(equation, operands, unknown)
    if name == "gather":
        return _gather_from_unknown(equation, operands)
    raise TranslationError(f"'{name}' moves elements to places that depend on the inputs")


def _slice_from_unknown(equation: Any, operands: list[Operand], unknown: int) -> list[Grid]:
    axis = unknown - 1
    last = operands[0].shape[axis] - equation.params["slice_sizes"][axis]
    start = as_grid(operands[unknown]).items[0]
    nearest = ca.fmin(ca.fmax(start, 0.0), float(last))
    return [
        _one_of(nearest, [_moved_with(equation, operands, unknown, np.array(k)) for k in range(last + 1)])
    ]


def _gather_from_unknown(equation: Any, operands: list[Operand]) -> list[Grid]:
    dimensions, mode = equation.params["dimension_numbers"], equation.params["mode"]
    indices = as_grid(operands[1])
    if indices.shape[-1] != 1:
        raise TranslationError("'gather' has several indices that depend on the inputs")
    axis = dimensions.start_index_map[0]
    last = operands[0].shape[axis] - equation.params["slice_sizes"][axis]
    at = [_moved_with(equation, operands, 1, np.full(indices.shape, k)) for k in range(last + 1)]
    rows = np.expand_dims(indices.places[..., 0], dimensions.offset_dims)
    row_of: NDArray[np.int64] = np.broadcast_to(rows, at[0].shape).ravel()
    fills = mode == GatherScatterMode.FILL_OR_DROP
    items = []
    for place, row in enumerate(row_of):
        index = indices.items[row]
        nearest = ca.fmin(ca.fmax(index, 0.0), float(last))
        value = select_case(nearest, [each.items[place] for each in at])
        items.append(ca.if_else(index == nearest, value, _filling(equation)) if fills else value)
    return [Grid(tuple(items), at[0].shape)]


def _moved_with(equation: Any, operands: list[Operand], which: int, value: NDArray[np.int64]) -> Grid:
    tried = list(operands)
    tried[which] = value
    return move(equation, tried)[0]


def _one_of(which: SX, grids: list[Grid]) -> Grid:
    columns = zip(*(grid.items for grid in grids), strict=True)
    return Grid(tuple(select_case(which, column) for column in columns), grids[0].shape)


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
