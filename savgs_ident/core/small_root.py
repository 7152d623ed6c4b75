"""Newton's method for the roots of small systems of equations, a few unknowns each, inside larger computations.

    >>> root = find_root(lambda x: x**2 - 2.0, jnp.ones(1), jnp.ones(1))
    >>> round(float(root.x[0]), 9), root.status().name
    (1.414213562, 'CONVERGED')

The Jacobian is exact. The forces of the rig are piecewise smooth in the unknowns (a friction changes sign), so a
step may land on another piece: steps are repeated until the next one is negligible. How it ended is a status of the
:class:`Root`. A root that was not found is NaN besides: a compiled program cannot ask for the status, and must not go
on with a plausible number. Derivatives, of any order and in either direction, come from the implicit function theorem
at the root, not from the iterations.
"""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from savgs_ident.core.status import Status

PRECISION = 1e-11
"""Largest remaining Newton step at a root, relative to the typical size of its unknown, or to it where it is larger.

Origin: rounding leaves some 1e-14 of an unknown, and an acceleration may be a thousand times the typical one.
"""

LIMIT = 30
"""Most iterations."""

Vector = Float[Array, " n"]


class Root(eqx.Module):
    """What Newton's method found, or several roots with a leading axis each.

    Attributes:
        x: the root, (n,), each in the unit of its unknown; NaN where it was not found.
        step_left: the Newton step that remains there, relative to the sizes of the unknowns [1], ().
        precision: the largest one at a root [1].
    """

    x: Vector
    step_left: Float[Array, ""]
    precision: float = eqx.field(static=True)

    def status(self) -> Status:
        """How it ended; of several roots, how the worst did. To be asked outside of compiled programs."""
        left = float(np.max(np.asarray(self.step_left)))
        if not np.isfinite(left):
            return Status.NOT_FINITE
        return Status.CONVERGED if left <= self.precision else Status.MAX_ITERATIONS


class _NewtonState(NamedTuple):
    root: Vector
    step_left: Float[Array, ""]
    iterations: Array


def _columns(slope: Callable[[Vector], Array], like: Vector) -> Float[Array, "k n"]:
    """The matrix of a linear function, column by column: for few unknowns cheaper than all at once."""
    return jnp.stack([slope(unit) for unit in jnp.unstack(jnp.eye(like.shape[0]))], axis=1)


def jacobian(function: Callable[[Vector], Array], at: Vector) -> tuple[Array, Float[Array, "k n"]]:
    """The value (k,) of ``function`` and its derivatives in each of a few unknowns (n,), in its units."""
    value, slope = jax.linearize(function, at)
    return value, _columns(slope, at)


def solve_dense(matrix: Float[Array, "n n"], right: Vector) -> Vector:
    """Solve a small linear system by Gaussian elimination with scalars, unrolled.

    Rows are taken in the order given: for matrices whose leading minors do not vanish, such as mass
    matrices. Numbers are in scaled coordinates or in any consistent units of SI.
    """
    size = matrix.shape[0]
    rows = [[*jnp.unstack(matrix[i]), right[i]] for i in range(size)]
    for i in range(size):
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for j in range(size):
            if j != i:
                factor = rows[j][i]
                rows[j] = [mine - factor * other for mine, other in zip(rows[j], rows[i], strict=True)]
    return jnp.stack([row[size] for row in rows])


LinearSolver = Callable[[Float[Array, "n n"], Vector], Vector]
"""Solves a matrix for a right side."""


def find_root(
    function: Callable[[Vector], Vector],
    start: Vector,
    scale: Vector,
    precision: float = PRECISION,
    solve: LinearSolver = solve_dense,
) -> Root:
    """The root (n,) of ``function`` to which Newton's method converges from ``start``, and whether it converges.

    ``scale`` (n,) is the typical size of each unknown [its unit], ``precision`` [1] that of the root in it, or in
    itself where it is larger; ``solve`` must suit the function's Jacobian. The function may be closed over traced
    values; derivatives with respect to these are exact.
    """

    def newton(function: Callable[[Vector], Vector], start: Vector) -> tuple[Vector, Float[Array, ""]]:
        def advance(now: _NewtonState) -> _NewtonState:
            residual, matrix = jacobian(function, now.root)
            root = now.root - solve(matrix, residual)
            # Where the same piece holds at the new point, the old matrix gives the remaining step.
            size = jnp.maximum(scale, jnp.abs(root))
            step_left = jnp.max(jnp.abs(solve(matrix, function(root))) / size)
            return _NewtonState(root, step_left, now.iterations + 1)

        def unfinished(now: _NewtonState) -> Array:
            return (now.step_left > precision) & (now.iterations < LIMIT)

        begin = _NewtonState(start, jnp.asarray(jnp.inf, start.dtype), jnp.asarray(0))
        end = jax.lax.while_loop(unfinished, advance, begin)
        return jnp.where(end.step_left <= precision, end.root, jnp.nan), end.step_left

    def linear(function: Callable[[Vector], Vector], right: Vector) -> Vector:
        return solve(_columns(function, right), right)

    x, step_left = jax.lax.custom_root(function, start, newton, linear, has_aux=True)
    return Root(x, step_left, precision)
