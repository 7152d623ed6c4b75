"""Which operations a computation is made of, and which of them other languages can be told."""

from collections.abc import Callable, Iterator
from typing import Any

import jax

ARITHMETIC = frozenset(
    [
        "abs",
        "add",
        "add_any",
        "atan2",
        "cos",
        "div",
        "dot_general",
        "exp",
        "integer_pow",
        "log",
        "max",
        "min",
        "mul",
        "neg",
        "pow",
        "sign",
        "sin",
        "sqrt",
        "square",
        "sub",
        "tanh",
    ]
)
COMPARISON = frozenset(["and", "eq", "ge", "gt", "le", "lt", "ne", "not", "or", "select_n"])
SHAPE = frozenset(
    [
        "broadcast_in_dim",
        "concatenate",
        "convert_element_type",
        "expand_dims",
        "pad",
        "reduce_sum",
        "reshape",
        "rev",
        "slice",
        "split",
        "squeeze",
        "stack",
        "transpose",
        "unstack",
    ]
)
NESTING = frozenset({"jit", "pjit"})

TABLE_LOOK_UP = frozenset({"dynamic_slice"})
"""Reads the piece of the damper's table: a translation makes a chain of conditions of it."""

MAPPABLE = ARITHMETIC | COMPARISON | SHAPE | NESTING | TABLE_LOOK_UP
"""Everything a symbolic translation, primitive by primitive, has to know. No loop, no sort, no gather."""


def _inner(value: Any) -> Iterator[Any]:
    for item in value if isinstance(value, tuple | list) else [value]:
        found = getattr(item, "jaxpr", item)
        if hasattr(found, "eqns"):
            yield found


def _equations(jaxpr: Any) -> Iterator[Any]:
    for equation in jaxpr.eqns:
        yield equation
        for value in equation.params.values():
            for inner in _inner(value):
                yield from _equations(inner)


def primitives_of(function: Callable[..., Any], *arguments: Any) -> list[str]:
    """Names of all primitives of a function, nested ones included, in order, with repetitions."""
    closed = jax.make_jaxpr(function)(*arguments)
    return [equation.primitive.name for equation in _equations(closed.jaxpr)]
