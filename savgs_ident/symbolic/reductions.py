"""Operations that fold many elements into one: sums, extremes, running sums, products of matrices."""

import operator
from collections.abc import Callable
from functools import reduce
from itertools import accumulate
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX

from savgs_ident.symbolic.grid import Grid, Operand, as_grid

Fold = Callable[[SX, SX], SX]

REDUCTIONS: dict[str, tuple[Fold, float]] = {
    "reduce_and": (ca.logic_and, 1.0),
    "reduce_max": (ca.fmax, -np.inf),
    "reduce_min": (ca.fmin, np.inf),
    "reduce_or": (ca.logic_or, 0.0),
    "reduce_prod": (operator.mul, 1.0),
    "reduce_sum": (operator.add, 0.0),
}
"""Name of the operation to how two elements become one, and what nothing at all becomes."""

RUNNING: dict[str, Fold] = {
    "cummax": ca.fmax,
    "cummin": ca.fmin,
    "cumprod": operator.mul,
    "cumsum": operator.add,
}
"""Name of the operation to how two elements become one, along one axis, all steps kept."""


def fold(equation: Any, operands: list[Operand]) -> list[Grid]:
    """The result of an operation in :data:`REDUCTIONS`."""
    combine, empty = REDUCTIONS[equation.primitive.name]
    grid = as_grid(operands[0])
    axes = equation.params["axes"]
    kept = [axis for axis in range(len(grid.shape)) if axis not in axes]
    shape = tuple(grid.shape[axis] for axis in kept)
    together = int(np.prod([grid.shape[axis] for axis in axes]))
    rows = np.transpose(grid.places, (*kept, *axes)).reshape(-1, together)
    return [Grid(tuple(_folded(combine, empty, [grid.items[i] for i in row]) for row in rows), shape)]


def _folded(combine: Fold, empty: float, items: list[SX]) -> SX:
    return reduce(combine, items) if items else SX(empty)


def run_along(equation: Any, operands: list[Operand]) -> list[Grid]:
    """The result of an operation in :data:`RUNNING`."""
    combine = RUNNING[equation.primitive.name]
    grid, axis = as_grid(operands[0]), equation.params["axis"]
    places = np.moveaxis(grid.places, axis, -1)
    order = slice(None, None, -1) if equation.params["reverse"] else slice(None)
    items = list(grid.items)
    for row in places.reshape(-1, grid.shape[axis]):
        for place, value in zip(
            row[order], accumulate((grid.items[i] for i in row[order]), combine), strict=True
        ):
            items[place] = value
    return [Grid(tuple(items), grid.shape)]


def multiply(equation: Any, operands: list[Operand]) -> list[Grid]:
    """The result of ``dot_general``."""
    (left_over, right_over), (left_batch, right_batch) = equation.params["dimension_numbers"]
    left, right = (as_grid(operand) for operand in operands)
    left_rows, left_kept = _matrices(left, left_batch, left_over)
    right_rows, right_kept = _matrices(right, right_batch, right_over)
    items = [
        _folded(
            operator.add,
            0.0,
            [left.items[i] * right.items[j] for i, j in zip(row, column, strict=True)],
        )
        for batch in range(left_rows.shape[0])
        for row in left_rows[batch]
        for column in right_rows[batch]
    ]
    batch_shape = tuple(left.shape[axis] for axis in left_batch)
    return [Grid(tuple(items), (*batch_shape, *left_kept, *right_kept))]


def _matrices(
    grid: Grid, batch: tuple[int, ...], over: tuple[int, ...]
) -> tuple[np.ndarray[Any, np.dtype[np.int64]], tuple[int, ...]]:
    """Places as (batch, kept, summed over), and the shape of what is kept."""
    kept = [axis for axis in range(len(grid.shape)) if axis not in (*batch, *over)]
    shape = tuple(grid.shape[axis] for axis in kept)
    sizes = [int(np.prod([grid.shape[axis] for axis in axes])) for axes in (batch, kept, over)]
    return np.transpose(grid.places, (*batch, *kept, *over)).reshape(sizes), shape
