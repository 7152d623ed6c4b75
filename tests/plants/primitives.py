"""Which operations a computation consists of, and which of them can be translated."""

from collections.abc import Callable, Iterator
from typing import Any

import jax

from savgs_ident.symbolic.translate import NESTING, RULES

TABLE_LOOK_UP = frozenset({"dynamic_slice"})
"""Reads the piece of the damper's table: a translation makes a chain of conditions of it."""

MAPPABLE = frozenset({*RULES, *NESTING})
"""Every primitive that can be translated."""


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
