"""Periodic collocation: a plant's equations at time nodes over a period, and Newton steps that close the period.

The implicit residual holds at every node, the trapezoidal rule between nodes. Unknowns at a node are x = (q, qd, s)
and y = (qdd, sd): m = 2 n + s and k = n + s numbers for a plant with n coordinates and s internal states. The plant
asks for r(x, y) = 0 at every node; between nodes

    x_{n+1} = x_n + h ((1 - g) xd_n + g xd_{n+1}),      xd = (qd, y),

with g = 1/2, or g = 1 for states that slip, where backward Euler is the exact play operator. A Newton step
(:func:`linearise`) eliminates y at each node, dy = J dx + e, and what is left is

    A_{n+1} dx_{n+1} = B_n dx_n + d_n,    A_n = I - h_{n-1} g F_n,    B_n = I + h_n (1 - g) F_n,

with F = d(xd)/dx. In terms of A_n dx_n it is an affine recurrence whose matrices M_n = B_n A_n^-1 need one node only:

    x_{n+1} = M_n x_n + d_n,    x_N = x_0.

Such recurrences are solved dwell by dwell (:func:`factorise_recurrence`, :func:`solve_recurrence`). Eliminating from
node to node is stable because a rig forgets its past (the products of M_n shrink). Products are formed in chunks, all
chunks of all dwells at a time, then over the chunks of a dwell; the period closes with
(I - M_{N-1} ... M_0) x_0 = d. A window that begins with a given state does not close: with M_{N-1} = 0 and
d_{N-1} = 0 its first state stays as it is. The factorisation serves any number of right sides, which is what makes
sensitivities cheap.

Arrays are laid out with the matrix indices first and the nodes of all dwells last, so that every operation is
a long vector.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant, Motion
from savgs_ident.simulate.mesh import CHUNK, Layout, NodeOrder

Matrices = Float[Array, "m k P"]
Vectors = Float[Array, "m P"]


def multiply_nodes(left: Matrices, right: Matrices) -> Matrices:
    """Matrix products at every node, of any units.

    Term by term: as a sum over an axis that is not the last one the compiler makes no vectors of it, and it takes
    fifteen times as long.
    """
    return reduce(jnp.add, [left[:, j, None] * right[None, j] for j in range(left.shape[1])])


def apply_nodes(left: Matrices, right: Vectors) -> Vectors:
    """Matrix times vector at every node, of any units."""
    return reduce(jnp.add, [left[:, j] * right[j] for j in range(left.shape[1])])


def invert_nodes(matrix: Matrices) -> Matrices:
    """Inverses of small matrices of any units at every node, by blocks and without pivoting.

    For matrices with a dominant diagonal (mass matrices; I - h J with a small step h). Of products of blocks the
    compiler makes long vectors; an elimination row by row takes more than twice as long.
    """
    size = matrix.shape[0]
    if size == 1:
        return 1.0 / matrix
    if size == 2:
        (a, b), (c, d) = matrix
        return jnp.stack([jnp.stack([d, -b]), jnp.stack([-c, a])]) / (a * d - b * c)
    half = size // 2
    first = invert_nodes(matrix[:half, :half])
    left = multiply_nodes(matrix[half:, :half], first)
    last = invert_nodes(matrix[half:, half:] - multiply_nodes(left, matrix[:half, half:]))
    right = -multiply_nodes(multiply_nodes(first, matrix[:half, half:]), last)
    upper = jnp.concatenate([first - multiply_nodes(right, left), right], axis=1)
    return jnp.concatenate([upper, jnp.concatenate([-multiply_nodes(last, left), last], axis=1)])


class CyclicFactors(NamedTuple):
    """Factorised recurrence: step matrices, products over chunks, inverses of I - (product of a period).

    Entries are in the units of the states per those of the states.
    """

    steps: Float[Array, "m m P"]
    chunks: Float[Array, "m m C"]
    closing: Float[Array, "D m m"]


def by_chunks(array: Float[Array, "*k P"]) -> Float[Array, "L *k C"]:
    """Numbers at all nodes, of any units, by their place in a chunk."""
    return jnp.moveaxis(array.reshape(*array.shape[:-1], -1, CHUNK), -1, 0)


def _over_chunks(layout: NodeOrder, array: Float[Array, "*k C"], absent: Array) -> Float[Array, "most *k D"]:
    padded = jnp.concatenate([array, absent[..., None]], axis=-1)
    return jnp.moveaxis(padded[..., layout.chunk_table], -1, 0)


def _opened(layout: NodeOrder, values: Float[Array, "*k P"]) -> Float[Array, "*k P"]:
    """Nothing leads from the last node of a window that begins with a given state to its first."""
    return values if layout.loose is None else jnp.where(layout.loose, 0.0, values)


def factorise_recurrence(layout: NodeOrder, steps: Float[Array, "m m P"]) -> CyclicFactors:
    """Factorise the recurrence with step matrices M_n [units of the states per those of the states]."""

    def compose(matrices: Array) -> Array:
        total, _ = jax.lax.scan(
            lambda done, step: (multiply_nodes(step, done), None), matrices[0], matrices[1:]
        )
        return total

    steps, eye = _opened(layout, steps), jnp.eye(steps.shape[0])
    chunks = compose(by_chunks(steps))
    period = compose(_over_chunks(layout, chunks, eye))
    closing = jnp.linalg.inv(jnp.moveaxis(eye[:, :, None] - period, -1, 0))
    return CyclicFactors(steps, chunks, closing)


def solve_recurrence(
    layout: NodeOrder, factors: CyclicFactors, right: Float[Array, "m P"]
) -> Float[Array, "m P"]:
    """The periodic x_n for right sides d_n, which belong to the step from node n to the next.

    States keep the units of the right sides.
    """
    return _solve_opened(layout, factors, _opened(layout, right))


def _solve_opened(
    layout: NodeOrder, factors: CyclicFactors, right: Float[Array, "m P"]
) -> Float[Array, "m P"]:
    """The same, where what stands at the last node of a window that does not close is how it begins."""

    def end(x: Array, step: tuple[Array, Array]) -> tuple[Array, None]:
        return apply_nodes(step[0], x) + step[1], None

    def pass_on(x: Array, step: tuple[Array, Array]) -> tuple[Array, Array]:
        return apply_nodes(step[0], x) + step[1], x

    size = right.shape[0]
    inside = (by_chunks(factors.steps), by_chunks(right))
    sides, _ = jax.lax.scan(end, jnp.zeros_like(inside[1][0]), inside)
    over = (
        _over_chunks(layout, factors.chunks, jnp.eye(size)),
        _over_chunks(layout, sides, jnp.zeros(size)),
    )
    period_side, _ = jax.lax.scan(end, jnp.zeros_like(over[1][0]), over)
    start = jnp.einsum("dij,jd->id", factors.closing, period_side)
    _, starts = jax.lax.scan(pass_on, start, over)
    begins = jnp.moveaxis(starts, 0, -1).reshape(size, -1)[:, layout.chunk_place]
    _, nodes = jax.lax.scan(pass_on, begins, inside)
    return jnp.moveaxis(nodes, 0, -1).reshape(right.shape)


Nodes = Float[Array, "k P"]


class Trajectory(NamedTuple):
    """States x = (q, qd, s), (m, P), and the algebraic unknowns y = (qdd, sd), (k, P)."""

    x: Nodes
    y: Nodes


class Linearised(NamedTuple):
    """A trajectory's linearisation, ready to solve for any right side.

    ``imbalance`` is -(dr/dy)^-1 r, (k, P); ``slope`` is dy/dx, (k, m, P); ``per_residual`` (dr/dy)^-1;
    ``inverse`` A^-1. Residuals, x and y are in SI.
    """

    imbalance: Nodes
    slope: Float[Array, "k m P"]
    per_residual: Float[Array, "k k P"]
    inverse: Float[Array, "m m P"]
    factors: CyclicFactors


def blank_linearised(model: AbstractPlant, layout: NodeOrder) -> Linearised:
    """Zeros of the shapes that :func:`linearise` gives."""
    n, nodes, dwells = len(model.coordinates), layout.dwell.size, len(layout.chunk_table)
    inner = n + len(model.states)
    size = n + inner
    return Linearised(
        imbalance=jnp.zeros((inner, nodes)),
        slope=jnp.zeros((inner, size, nodes)),
        per_residual=jnp.zeros((inner, inner, nodes)),
        inverse=jnp.zeros((size, size, nodes)),
        factors=CyclicFactors(
            steps=jnp.zeros((size, size, nodes)),
            chunks=jnp.zeros((size, size, nodes // CHUNK)),
            closing=jnp.zeros((dwells, size, size)),
        ),
    )


def node_motion(model: AbstractPlant, parts: tuple[Array, ...]) -> tuple[Motion, Array, Array]:
    """Motion, internal states (s,) and their rates (s,) at one node from its scalar unknowns (x then y), in SI."""
    n, size = len(model.coordinates), len(model.states)
    inner, end = 2 * n, 2 * n + size
    states = jnp.stack(parts[inner:end]) if size else jnp.zeros(0)
    rates = jnp.stack(parts[end + n :]) if size else jnp.zeros(0)
    motion = Motion(*(model.coordinate_type(*parts[i : i + n]) for i in (0, n, end)))
    return motion, states, rates


def residual_at_nodes(
    model: AbstractPlant, p: Values, prepared: Any, parts: tuple[Array, ...], u: Any
) -> Nodes:
    """The residual at all nodes of all dwells, (k, P), in SI."""

    def one(u: Any, *parts: Array) -> Array:
        motion, states, rates = node_motion(model, parts)
        return model.residual(p, motion, states, rates, u, prepared)

    return jax.vmap(one, in_axes=0, out_axes=-1)(u, *parts)


def _residual_and_columns(function: Callable[..., Array], parts: tuple[Array, ...]) -> tuple[Array, Array]:
    """A residual and its derivatives in each of its scalar arguments.

    One pass a column through the linear part lets each column compute only what that unknown touches.
    """
    residual, linear = jax.linearize(function, *parts)
    still = [jnp.zeros_like(part) for part in parts]

    def column(i: int) -> Array:
        def along(moved: Array) -> Array:
            change: Array = linear(*still[:i], moved, *still[i + 1 :])
            return change

        return jax.jvp(along, (still[i],), (jnp.ones_like(still[i]),))[1]

    return residual, jnp.stack([column(i) for i in range(len(parts))], axis=1)


def implicitness(model: AbstractPlant) -> Float[Array, "m 1"]:
    """Weight g [1] of the far end of a step for each state."""
    slips = jnp.asarray([False] * (2 * len(model.coordinates)) + [state.slips for state in model.states])
    return jnp.where(slips, 1.0, 0.5)[:, None]


def linearise(
    model: AbstractPlant,
    p: Values,
    prepared: Any,
    at: Trajectory,
    u: Any,
    layout: NodeOrder,
    steps: Float[Array, " P"],
) -> Linearised:
    """Linearise residual and steps about a trajectory; ``steps`` [s] from each node to the next."""
    parts = (*at.x, *at.y)
    residual, jacobian = _residual_and_columns(lambda *z: residual_at_nodes(model, p, prepared, z, u), parts)
    size, n = at.x.shape[0], len(model.coordinates)
    per_residual = invert_nodes(jacobian[:, size:])
    slope = -multiply_nodes(per_residual, jacobian[:, :size])
    imbalance = -apply_nodes(per_residual, residual)
    weight, before = implicitness(model)[:, None], steps[layout.preceding]
    inverse = _inverse_of_step(before * weight, slope, n)
    # B_n is A_n but for the step and its share: B_n A_n^-1 follows without a product.
    ratio = steps * (1.0 - weight) / (before * weight)
    matrices = inverse + ratio * (inverse - jnp.eye(size)[:, :, None])
    return Linearised(imbalance, slope, per_residual, inverse, factorise_recurrence(layout, matrices))


def _inverse_of_step(share: Float[Array, "m 1 P"], slope: Float[Array, "k m P"], n: int) -> Matrices:
    """A^-1 for steps times the weight of their far end [s], of a plant with n coordinates.

    The rate of a coordinate is a speed: only the other k rows are inverted.
    """
    inner = slope.shape[0]
    late, eye = share[n:], jnp.eye(inner)[:, :, None]
    by_place, by_rest = late * slope[:, :n], late * slope[:, n:]
    through = jnp.concatenate([share[:n, 0] * by_place, jnp.zeros_like(by_rest[:, n:])], axis=1)
    rest = invert_nodes(eye - by_rest - through)
    by_place = multiply_nodes(rest, by_place)
    places = jnp.eye(n)[:, :, None] + share[:n] * by_place[:n]
    upper = jnp.concatenate([places, share[:n] * rest[:n]], axis=1)
    return jnp.concatenate([upper, jnp.concatenate([by_place, rest], axis=1)])


def step_defects(
    model: AbstractPlant, at: Trajectory, rate: Nodes, layout: NodeOrder, steps: Float[Array, " P"]
) -> Nodes:
    """By how much x_n plus its step misses x_{n+1}, for rates xd = ``rate``, in SI; ``steps`` [s]."""
    weight = implicitness(model)
    step = steps * ((1.0 - weight) * rate + weight * rate[:, layout.following])
    return at.x - at.x[:, layout.following] + step


def solve_linearised(layout: NodeOrder, lin: Linearised, defects: Nodes, imbalance: Nodes) -> Trajectory:
    """Changes (dx, dy) that cancel step defects given that dy = slope dx + imbalance at the nodes, all in SI."""
    dx = apply_nodes(lin.inverse, solve_recurrence(layout, lin.factors, defects))
    return Trajectory(dx, imbalance + apply_nodes(lin.slope, dx))


def changed_initial_states(layout: Layout, lin: Linearised, change: Float[Array, "m D"]) -> Trajectory:
    """Changes (dx, dy) of windows that begin with a given state, by a ``change`` of that state [SI]; others stay."""
    opened, first = list(layout.opened), layout.starts[list(layout.opened)]
    inverse = jnp.moveaxis(lin.inverse[:, :, first], -1, 0)
    begun = jnp.linalg.solve(inverse, change[:, opened].T[..., None])[..., 0].T
    right = jnp.zeros((change.shape[0], layout.total)).at[:, layout.loose_ends].set(begun)
    dx = apply_nodes(lin.inverse, _solve_opened(layout, lin.factors, right))
    return Trajectory(dx, apply_nodes(lin.slope, dx))
