"""Linear algebra of periodic solutions: affine recurrences that close after one period.

Newton's method in the time domain leads, dwell by dwell, to

    x_{n+1} = M_n x_n + d_n,    x_N = x_0,

with small matrices M_n. Eliminating from node to node is stable because a rig forgets its past (the products
of M_n shrink). Products are formed in chunks, all chunks of all dwells at a time, then over the chunks of a
dwell; the period closes with (I - M_{N-1} ... M_0) x_0 = d. The factorisation serves any number of right
sides, which is what makes sensitivities cheap.

Arrays are laid out with the matrix indices first and (dwell, node) last, so that every operation is a long
vector.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

CHUNK = 16
"""Nodes in a chunk; the number of nodes in a period is a multiple of it."""

Matrices = Float[Array, "m k *nodes"]
Vectors = Float[Array, "m *nodes"]


def product(left: Matrices, right: Matrices) -> Matrices:
    """Matrix products at every node."""
    return jnp.sum(left[:, :, None] * right[None], axis=1)


def apply(left: Matrices, right: Vectors) -> Vectors:
    """Matrix times vector at every node."""
    return jnp.sum(left * right[None], axis=1)


def solve_nodes(matrix: Matrices, right: Matrices) -> Matrices:
    """Solve small systems at every node by Gaussian elimination without pivoting.

    For matrices with a dominant diagonal (mass matrices; I - h J with a small step h).
    """
    size = matrix.shape[0]
    rows = [jnp.concatenate([matrix[i], right[i]], axis=0) for i in range(size)]
    for i in range(size):
        pivot = rows[i] / rows[i][i]
        rows = [pivot if j == i else rows[j] - rows[j][i] * pivot for j in range(size)]
    return jnp.stack([row[size:] for row in rows])


class CyclicFactors(NamedTuple):
    """Factorised recurrence: step matrices, products over chunks, inverse of I - (period's product)."""

    steps: Float[Array, "m m D N"]
    chunks: Float[Array, "m m D c"]
    closing: Float[Array, "D m m"]


def _inside_chunks(array: Float[Array, "*k D N"]) -> Float[Array, "L *k D c"]:
    split = array.reshape(*array.shape[:-1], -1, CHUNK)
    return jnp.moveaxis(split, -1, 0)


def _over_chunks(array: Float[Array, "*k D c"]) -> Float[Array, "c *k D"]:
    return jnp.moveaxis(array, -1, 0)


def factorise(steps: Float[Array, "m m D N"]) -> CyclicFactors:
    """Factorise the recurrence with step matrices M_n."""

    def compose(matrices: Array) -> Array:
        total, _ = jax.lax.scan(lambda done, step: (product(step, done), None), matrices[0], matrices[1:])
        return total

    chunks = compose(_inside_chunks(steps))
    period = compose(_over_chunks(chunks))
    closing = jnp.linalg.inv(jnp.moveaxis(jnp.eye(steps.shape[0])[:, :, None] - period, -1, 0))
    return CyclicFactors(steps, chunks, closing)


def solve(factors: CyclicFactors, right: Float[Array, "m D N"]) -> Float[Array, "m D N"]:
    """The periodic x_n for right sides d_n, which belong to the step from node n to the next."""

    def end(x: Array, step: tuple[Array, Array]) -> tuple[Array, None]:
        return apply(step[0], x) + step[1], None

    def pass_on(x: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        return apply(step[0], x) + step[1], x

    inside = (_inside_chunks(factors.steps), _inside_chunks(right))
    chunk_sides, _ = jax.lax.scan(end, jnp.zeros_like(inside[1][0]), inside)
    over = (_over_chunks(factors.chunks), _over_chunks(chunk_sides))
    period_side, _ = jax.lax.scan(end, jnp.zeros_like(over[1][0]), over)
    start = jnp.einsum("dij,jd->id", factors.closing, period_side)
    _, chunk_starts = jax.lax.scan(pass_on, start, over)
    _, nodes = jax.lax.scan(pass_on, jnp.moveaxis(chunk_starts, 0, -1), inside)
    return jnp.moveaxis(nodes, 0, -1).reshape(right.shape)
