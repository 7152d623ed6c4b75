"""A traced function evaluated on CasADi scalars, equation by equation.

Each equation applies one primitive. What it works on either depends on the inputs, and then a rule by the
primitive's name says what CasADi is told, or is known already, and then JAX computes it on the spot.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from casadi import SX
from jax.extend import source_info_util
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

from savgs_ident.symbolic.elementwise import BY_EQUATION, ELEMENTWISE, Scalars, chosen
from savgs_ident.symbolic.grid import Grid, Operand, TranslationError, as_grid
from savgs_ident.symbolic.reductions import REDUCTIONS, RUNNING, fold, multiply, run_along
from savgs_ident.symbolic.structure import MOVING, move

Rule = Callable[[Any, list[Operand]], list[Grid]]

NESTING: dict[str, str] = {
    "checkpoint": "jaxpr",
    "custom_jvp_call": "call_jaxpr",
    "custom_vjp_call": "call_jaxpr",
    "jit": "jaxpr",
    "pjit": "jaxpr",
    "remat2": "jaxpr",
}
"""Primitives that apply another function, in the names of all versions of JAX, and under which parameter they
hold it."""

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
    """All branches evaluated, one of them chosen."""
    which, *arguments = operands
    index = as_grid(which).items[0]
    ends = [evaluate(branch, arguments) for branch in equation.params["branches"]]
    results = []
    for candidates in zip(*ends, strict=True):
        grids = [as_grid(candidate) for candidate in candidates]
        columns = zip(*(grid.items for grid in grids), strict=True)
        results.append(Grid(tuple(chosen(index, column) for column in columns), grids[0].shape))
    return results


RULES: dict[str, Rule] = {
    **dict.fromkeys([*ELEMENTWISE, *BY_EQUATION], _elementwise),
    **dict.fromkeys(MOVING, move),
    **dict.fromkeys(REDUCTIONS, fold),
    **dict.fromkeys(RUNNING, run_along),
    "dot_general": multiply,
    "cond": _conditional,
}
"""Every primitive that can be translated, but for those in :data:`NESTING`."""


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
        # What was traced inside a library says nothing of its place: then that of its use is told.
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
