"""From a function written in JAX to a CasADi function: the same equations, not a copy of them.

    >>> import jax.numpy as jnp
    >>> def energy(mass, velocity):
    ...     return 0.5 * mass * jnp.sum(velocity**2)
    >>> told = to_casadi("energy", energy, {"mass": np.ones(()), "velocity": np.ones(3)}, ["energy"])
    >>> told
    Function(energy:(mass,velocity[3])->(energy) SXFunction)
    >>> float(told(2.0, [1.0, 2.0, 2.0]))
    9.0

The function is traced once, at the shapes of the examples given, and its trace is evaluated on symbols
(:mod:`savgs_ident.symbolic.interpret`). Arrays become columns, last index fastest. Integers and truth values
become numbers. CasADi differentiates what is computed: slopes that JAX was told otherwise (``stop_gradient``,
``custom_jvp``) are not carried over, and where JAX gives the mean of two slopes at a kink, it gives one of them.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from casadi import SX, Function

from savgs_ident.symbolic.grid import TranslationError, column_of, grid_from_column
from savgs_ident.symbolic.interpret import evaluate

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
        return tuple(column_of(result) for result in evaluate(closed, grids))

    return translated


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
