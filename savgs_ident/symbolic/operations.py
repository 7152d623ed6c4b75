"""Operations on arrays of CasADi scalars: element by element, and many elements to one.

What is known while translating stays a NumPy array and is computed at once; what depends on the inputs is a
:class:`Grid` of scalar expressions.

Another elementwise operation is one more line of :data:`ELEMENTWISE`: the name that JAX gives it, and a function of
CasADi scalars. An operation that depends on its parameters or on the type of its numbers goes into
:data:`BY_EQUATION`, where a function of the equation returns the function of scalars. Sums, extremes, running sums
and products of matrices are in :data:`REDUCTIONS`, :data:`RUNNING` and :func:`multiply`.

CasADi differentiates ``if_else`` branch by branch and keeps the condition outermost: a branch that is not taken
adds nothing, even where its slope is infinite.
"""

import operator
from collections.abc import Callable
from functools import reduce
from itertools import accumulate
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from casadi import SX, densify, vertcat
from numpy.typing import NDArray

from savgs_ident.core.errors import SavgsIdentError


class TranslationError(SavgsIdentError):
    """A function that has no translation: ``what`` is the reason, ``place`` where in the source, "" if unknown."""

    def __init__(self, what: str, place: str = "") -> None:
        self.what, self.place = what, place
        super().__init__(f"{what} ({place})" if place else what)


class Grid(NamedTuple):
    """Scalar expressions in an array of ``shape``, last index fastest."""

    items: tuple[SX, ...]
    shape: tuple[int, ...]

    @property
    def places(self) -> NDArray[np.int64]:
        """The place of each entry in ``items``, as an array of the same shape."""
        return np.arange(len(self.items)).reshape(self.shape)


Operand = Grid | NDArray[np.generic]
"""An operand: expressions, or numbers that are known, of any shape and any unit."""


def as_grid(operand: Operand) -> Grid:
    """The operand as expressions, constant ones where it is known."""
    if isinstance(operand, Grid):
        return operand
    return Grid(tuple(SX(float(value)) for value in operand.ravel()), operand.shape)


def as_known(operand: Operand) -> NDArray[np.float64] | None:
    """The values of an operand, of its shape and in its unit, if it does not depend on the inputs.

    None if it does.
    """
    if not isinstance(operand, Grid):
        return np.asarray(operand, np.float64)
    if not all(item.is_constant() for item in operand.items):
        return None
    return np.array([float(item) for item in operand.items]).reshape(operand.shape)


def grid_from_column(column: SX, shape: tuple[int, ...]) -> Grid:
    """The entries of a CasADi column as a grid."""
    return Grid(tuple(column[i] for i in range(column.numel())), shape)


def to_column(operand: Operand) -> SX:
    """A dense CasADi column of all entries, last index fastest."""
    items = as_grid(operand).items
    return densify(vertcat(*items)) if items else SX.zeros(0, 1)


Scalars = Callable[..., SX]


def _cube_root(x: SX) -> SX:
    return ca.sign(x) * ca.fabs(x) ** (1.0 / 3.0)


def _logistic(x: SX) -> SX:
    return 1.0 / (1.0 + ca.exp(-x))


def _clamp(lowest: SX, x: SX, highest: SX) -> SX:
    return ca.fmin(ca.fmax(x, lowest), highest)


def _select(which: SX, *cases: SX) -> SX:
    if len(cases) == 2:
        return ca.if_else(which, cases[1], cases[0])
    return select_case(which, cases)


def select_case(which: SX, cases: tuple[SX, ...] | list[SX]) -> SX:
    """``cases[which]`` for a whole number ``which`` within their range."""
    total = SX(0.0)
    for number, case in enumerate(cases):
        total += ca.if_else(which == number, case, 0.0)
    return total


def _identity(x: SX) -> SX:
    return x


ELEMENTWISE: dict[str, Scalars] = {
    "abs": ca.fabs,
    "acos": ca.acos,
    "acosh": ca.acosh,
    "add": operator.add,
    "add_any": operator.add,
    "asin": ca.asin,
    "asinh": ca.asinh,
    "atan": ca.atan,
    "atan2": ca.atan2,
    "atanh": ca.atanh,
    "cbrt": _cube_root,
    "ceil": ca.ceil,
    "clamp": _clamp,
    "copy": _identity,
    "cos": ca.cos,
    "cosh": ca.cosh,
    "eq": operator.eq,
    "erf": ca.erf,
    "exp": ca.exp,
    "exp2": lambda x: SX(2.0) ** x,
    "expm1": ca.expm1,
    "floor": ca.floor,
    "ge": operator.ge,
    "gt": operator.gt,
    "is_finite": lambda x: ca.fabs(x) < SX(np.inf),
    "le": operator.le,
    "log": ca.log,
    "log1p": ca.log1p,
    "logistic": _logistic,
    "lt": operator.lt,
    "max": ca.fmax,
    "min": ca.fmin,
    "mul": operator.mul,
    "ne": operator.ne,
    "neg": operator.neg,
    "optimization_barrier": _identity,
    "pow": operator.pow,
    "rem": ca.fmod,
    "rsqrt": lambda x: SX(1.0) / ca.sqrt(x),
    "select_n": _select,
    "sign": ca.sign,
    "sin": ca.sin,
    "sinh": ca.sinh,
    "sqrt": ca.sqrt,
    "square": lambda x: x * x,
    "stop_gradient": _identity,
    "sub": operator.sub,
    "tan": ca.tan,
    "tanh": ca.tanh,
}
"""Name of the operation: its function of scalars."""


def _towards_zero(x: SX) -> SX:
    return ca.if_else(x >= 0.0, ca.floor(x), ca.ceil(x))


def _division(equation: Any) -> Scalars:
    if np.issubdtype(equation.outvars[0].aval.dtype, np.integer):
        return lambda x, y: _towards_zero(x / y)
    return operator.truediv


def _whole_power(equation: Any) -> Scalars:
    exponent = int(equation.params["y"])

    def power(x: SX) -> SX:
        result, factor, left = SX(1.0), x, abs(exponent)
        while left:
            result = result * factor if left & 1 else result
            left >>= 1
            factor = factor * factor if left else factor
        return 1.0 / result if exponent < 0 else result

    return power


def _conversion(equation: Any) -> Scalars:
    before, after = equation.invars[0].aval.dtype, equation.outvars[0].aval.dtype
    if after == np.bool_:
        return lambda x: x != 0.0
    if np.issubdtype(after, np.integer) and np.issubdtype(before, np.floating):
        return _towards_zero
    return _identity


def _boolean(function: Scalars) -> Callable[[Any], Scalars]:
    def for_equation(equation: Any) -> Scalars:
        if equation.invars[0].aval.dtype != np.bool_:
            raise TranslationError(f"'{equation.primitive.name}' works on the bits of a number")
        return function

    return for_equation


BY_EQUATION: dict[str, Callable[[Any], Scalars]] = {
    "and": _boolean(ca.logic_and),
    "convert_element_type": _conversion,
    "div": _division,
    "integer_pow": _whole_power,
    "not": _boolean(ca.logic_not),
    "or": _boolean(ca.logic_or),
    "xor": _boolean(lambda x, y: x != y),
}
"""Name of the operation: a function of the equation that returns the function of scalars."""

Fold = Callable[[SX, SX], SX]

REDUCTIONS: dict[str, tuple[Fold, float]] = {
    "reduce_and": (ca.logic_and, 1.0),
    "reduce_max": (ca.fmax, -np.inf),
    "reduce_min": (ca.fmin, np.inf),
    "reduce_or": (ca.logic_or, 0.0),
    "reduce_prod": (operator.mul, 1.0),
    "reduce_sum": (operator.add, 0.0),
}
"""Name of the operation: the combination of two elements, and the value for no elements."""

RUNNING: dict[str, Fold] = {
    "cummax": ca.fmax,
    "cummin": ca.fmin,
    "cumprod": operator.mul,
    "cumsum": operator.add,
}
"""Name of the operation: the combination of two elements, accumulated along one axis."""


def reduce_axes(equation: Any, operands: list[Operand]) -> list[Grid]:
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


def accumulate_along(equation: Any, operands: list[Operand]) -> list[Grid]:
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
