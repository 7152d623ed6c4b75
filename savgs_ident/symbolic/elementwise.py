"""Operations that work on each element by itself.

To teach the translation another one, add its line: the name that JAX gives it, and a function of CasADi
scalars. An operation that depends on its parameters or on the kind of its numbers goes into ``BY_EQUATION``,
where a function of the equation gives the function of scalars.

CasADi differentiates ``if_else`` branch by branch and keeps the condition outermost: a branch that is not taken
adds nothing, even where its slope is infinite.
"""

import operator
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from casadi import SX

from savgs_ident.symbolic.grid import TranslationError

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
    return chosen(which, cases)


def chosen(which: SX, cases: tuple[SX, ...] | list[SX]) -> SX:
    """``cases[which]`` for a whole number ``which`` within their range."""
    total = SX(0.0)
    for number, case in enumerate(cases):
        total += ca.if_else(which == number, case, 0.0)
    return total


def _same(x: SX) -> SX:
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
    "copy": _same,
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
    "optimization_barrier": _same,
    "pow": operator.pow,
    "rem": ca.fmod,
    "rsqrt": lambda x: SX(1.0) / ca.sqrt(x),
    "select_n": _select,
    "sign": ca.sign,
    "sin": ca.sin,
    "sinh": ca.sinh,
    "sqrt": ca.sqrt,
    "square": lambda x: x * x,
    "stop_gradient": _same,
    "sub": operator.sub,
    "tan": ca.tan,
    "tanh": ca.tanh,
}
"""Name of the operation to a function of scalars."""


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
    return _same


def _of_truths(function: Scalars) -> Callable[[Any], Scalars]:
    def for_equation(equation: Any) -> Scalars:
        if equation.invars[0].aval.dtype != np.bool_:
            raise TranslationError(f"'{equation.primitive.name}' works on the bits of a number")
        return function

    return for_equation


BY_EQUATION: dict[str, Callable[[Any], Scalars]] = {
    "and": _of_truths(ca.logic_and),
    "convert_element_type": _conversion,
    "div": _division,
    "integer_pow": _whole_power,
    "not": _of_truths(ca.logic_not),
    "or": _of_truths(ca.logic_or),
    "xor": _of_truths(lambda x, y: x != y),
}
"""Name of the operation to a function that gives, for an equation, the function of scalars."""
