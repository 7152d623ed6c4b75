"""Linear algebra of periodic solutions: affine recurrences that close after one period.

Newton's method in the time domain leads, dwell by dwell, to

    x_{n+1} = M_n x_n + d_n,    x_N = x_0,

with small matrices M_n. Eliminating from node to node is stable because a rig forgets its past (the products
of M_n shrink). Products are formed in chunks, all chunks of all dwells at a time, then over the chunks of a
dwell; the period closes with (I - M_{N-1} ... M_0) x_0 = d. The factorisation serves any number of right
sides, which is what makes sensitivities cheap.

Arrays are laid out with the matrix indices first and the nodes of all dwells last, so that every operation is
a long vector.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.simulate.mesh import CHUNK, Layout

Matrices = Float[Array, "m k P"]
Vectors = Float[Array, "m P"]


def product(left: Matrices, right: Matrices) -> Matrices:
    """Matrix products at every node, of any units."""
    return jnp.sum(left[:, :, None] * right[None], axis=1)


def apply(left: Matrices, right: Vectors) -> Vectors:
    """Matrix times vector at every node, of any units."""
    return jnp.sum(left * right[None], axis=1)


def solve_nodes(matrix: Matrices, right: Matrices) -> Matrices:
    """Solve small systems of any units at every node by Gaussian elimination without pivoting.

    For matrices with a dominant diagonal (mass matrices; I - h J with a small step h).
    """
    size = matrix.shape[0]
    rows = [jnp.concatenate([matrix[i], right[i]], axis=0) for i in range(size)]
    for i in range(size):
        pivot = rows[i] / rows[i][i]
        rows = [pivot if j == i else rows[j] - rows[j][i] * pivot for j in range(size)]
    return jnp.stack([row[size:] for row in rows])


class CyclicFactors(NamedTuple):
    """Factorised recurrence: step matrices, products over chunks, inverses of I - (product of a period).

    Entries are in the units of the states per those of the states.
    """

    steps: Float[Array, "m m P"]
    chunks: Float[Array, "m m C"]
    closing: Float[Array, "D m m"]


def _inside_chunks(array: Float[Array, "*k P"]) -> Float[Array, "L *k C"]:
    return jnp.moveaxis(array.reshape(*array.shape[:-1], -1, CHUNK), -1, 0)


def _over_chunks(layout: Layout, array: Float[Array, "*k C"], absent: Array) -> Float[Array, "most *k D"]:
    padded = jnp.concatenate([array, absent[..., None]], axis=-1)
    return jnp.moveaxis(padded[..., layout.chunk_table], -1, 0)


def factorise(layout: Layout, steps: Float[Array, "m m P"]) -> CyclicFactors:
    """Factorise the recurrence with step matrices M_n [units of the states per those of the states]."""

    def compose(matrices: Array) -> Array:
        total, _ = jax.lax.scan(lambda done, step: (product(step, done), None), matrices[0], matrices[1:])
        return total

    eye = jnp.eye(steps.shape[0])
    chunks = compose(_inside_chunks(steps))
    period = compose(_over_chunks(layout, chunks, eye))
    closing = jnp.linalg.inv(jnp.moveaxis(eye[:, :, None] - period, -1, 0))
    return CyclicFactors(steps, chunks, closing)


def solve(layout: Layout, factors: CyclicFactors, right: Float[Array, "m P"]) -> Float[Array, "m P"]:
    """The periodic x_n for right sides d_n, which belong to the step from node n to the next.

    States keep the units of the right sides.
    """

    def end(x: Array, step: tuple[Array, Array]) -> tuple[Array, None]:
        return apply(step[0], x) + step[1], None

    def pass_on(x: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        return apply(step[0], x) + step[1], x

    size = right.shape[0]
    inside = (_inside_chunks(factors.steps), _inside_chunks(right))
    sides, _ = jax.lax.scan(end, jnp.zeros_like(inside[1][0]), inside)
    over = (
        _over_chunks(layout, factors.chunks, jnp.eye(size)),
        _over_chunks(layout, sides, jnp.zeros(size)),
    )
    period_side, _ = jax.lax.scan(end, jnp.zeros_like(over[1][0]), over)
    start = jnp.einsum("dij,jd->id", factors.closing, period_side)
    _, starts = jax.lax.scan(pass_on, start, over)
    present = layout.chunk_table < factors.chunks.shape[-1]
    _, nodes = jax.lax.scan(pass_on, jnp.moveaxis(starts, 0, -1)[:, present], inside)
    return jnp.moveaxis(nodes, 0, -1).reshape(right.shape)
