"""Operations that move elements: reshape, slice, concatenate, pad, gather, ...

JAX itself moves them. It is given an array of whole numbers, the index of each element, and the result shows where
each element went. So none of these operations is written a second time, and another one is one more name in
:data:`MOVING`.

An index that depends on the inputs (the piece of a table that an input falls into) has a few possible values: the
operation is done for each of them, and the result is selected among theirs.
"""

from typing import Any

import casadi as ca
import numpy as np
from casadi import SX
from jax.lax import GatherScatterMode
from numpy.typing import NDArray

from savgs_ident.symbolic.operations import Grid, Operand, TranslationError, as_grid, as_known, select_case

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
