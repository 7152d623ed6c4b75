"""Periodic collocation: a plant's equations at time nodes over a period, and Newton steps that close the period.

The implicit residual holds at every node, the trapezoidal rule between nodes. Unknowns at a node are x = (q, qd, s)
and y = (qdd, sd): m = 2 n + s and k = n + s numbers for a plant with n coordinates and s internal states. The plant
asks for r(x, y) = 0 at every node; between nodes

    x_{n+1} = x_n + h ((1 - g) xd_n + g xd_{n+1}),      xd = (qd, y),

with g = 1/2, or g = 1 for states that slip, where backward Euler is the exact play operator. A Newton step
(:func:`linearise`) eliminates y at each node, dy = J dx + e, and what is left is

    A_{n+1} dx_{n+1} = B_n dx_n + d_n,    A_n = I - h_{n-1} g F_n,    B_n = I + h_n (1 - g) F_n,

with F = d(xd)/dx. In terms of a_n = A_n dx_n it is an affine recurrence whose matrices M_n = B_n A_n^-1 need one node
only:

    a_{n+1} = M_n a_n + d_n,    a_N = a_0.

M_n is never formed (``_one_step``). A_n and B_n are the same but for the time step, so that dx_n, which is wanted
anyway, gives M_n a_n = dx_n + r_n (dx_n - a_n) with r_n = h_n (1 - g) / (h_{n-1} g); and the rate of a coordinate is
a speed, so that of A_n^-1 only the k rows of speeds and internal states are multiplied. The recurrence is solved
dwell by dwell (:func:`factorise_steps`, :func:`solve_steps`). Eliminating from node to node is stable because a rig
forgets its past (the products of M_n shrink). Products are formed in chunks, all chunks of all dwells at a time, then
over the chunks of a dwell; the period closes with (I - M_{N-1} ... M_0) a_0 = d. A window that begins with a given
state does not close: with M_{N-1} = 0 and d_{N-1} = 0 its first state stays as it is. The factorisation serves any
number of right sides, which is what makes sensitivities cheap.

Arrays are laid out with the matrix indices first and the nodes of all dwells last, so that every operation is
a long vector.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

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


class Steps(NamedTuple):
    """Steps from node to node, whose matrices are M_n = B_n A_n^-1.

    Attributes:
        lower: the last k rows of A^-1, in the units of the states per those of the states, (k, m, P).
        before: time from the node before [s], (P,).
        ratio: time to the next node over that [1], (P,).
    """

    lower: Float[Array, "k m P"]
    before: Float[Array, " P"]
    ratio: Float[Array, " P"]


class CyclicFactors(NamedTuple):
    """Factorised steps of C chunks of L nodes.

    Attributes:
        steps: the steps by place in a chunk, arrays with a leading axis (L,) and the chunks last.
        weight: weight g of the far end of a step for each state [1], (m, 1).
        chunks: products of their matrices over chunks, (m, m, C).
        closing: inverses of I - (product of a period), (D, m, m).
    """

    steps: Steps
    weight: Float[Array, "m 1"]
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


class _Stepped(NamedTuple):
    """What one step makes of a_n, (m, j, P): dx_n, J dx_n, (k, j, P), and M_n a_n."""

    change: Array
    rate: Array
    ahead: Array


def _one_step(steps: Steps, weight: Float[Array, "m 1"], a: Float[Array, "m j P"]) -> _Stepped:
    """The last k rows of dx are those of A^-1 a, the first dq = a_q + h g dqd; and J dx = (dx - a) / (h g)."""
    rows, size = steps.lower.shape[:2]
    n, late = size - rows, weight[:, None] * steps.before
    rest = multiply_nodes(steps.lower, a)
    change = jnp.concatenate([a[:n] + late[:n] * rest[:n], rest])
    through = (1.0 / weight - 1.0)[:, None] * steps.ratio
    return _Stepped(change, (rest - a[n:]) / late[n:], change + through * (change - a))


def step_matrices(steps: Steps, weight: Float[Array, "m 1"]) -> Float[Array, "m m P"]:
    """The matrices M_n [units of the states per those of the states]."""
    size, nodes = steps.lower.shape[1:]
    return _one_step(steps, weight, _identities(size, nodes)).ahead


def _identities(size: int, nodes: int) -> Matrices:
    return jnp.broadcast_to(jnp.eye(size)[:, :, None], (size, size, nodes))


def factorise_steps(layout: NodeOrder, steps: Steps, weight: Float[Array, "m 1"]) -> CyclicFactors:
    """Factorise the recurrence that goes on by these steps, with the ``weight`` [1] of their far ends."""

    def pass_on(done: Array, given: tuple[Steps, Array | None]) -> tuple[Array, None]:
        step, loose = given
        ahead = _one_step(step, weight, done).ahead
        return ahead if loose is None else jnp.where(loose, 0.0, ahead), None

    def compose(done: Array, matrices: Array) -> tuple[Array, None]:
        return multiply_nodes(matrices, done), None

    size, inside = steps.lower.shape[1], Steps(*map(by_chunks, steps))
    begin = _identities(size, inside.before.shape[-1])
    chunks, _ = jax.lax.scan(pass_on, begin, (inside, _loose_chunks(layout)))
    over, eye = _over_chunks(layout, chunks, jnp.eye(size)), jnp.eye(size)
    period, _ = jax.lax.scan(compose, over[0], over[1:])
    closing = jnp.linalg.inv(jnp.moveaxis(eye[:, :, None] - period, -1, 0))
    return CyclicFactors(inside, weight, chunks, closing)


def _loose_chunks(layout: NodeOrder) -> Array | None:
    return None if layout.loose is None else by_chunks(jnp.asarray(layout.loose))


class Changes(NamedTuple):
    """dx_n at the nodes, (m, P), and J dx_n, which is dy_n less its imbalance, (k, P); SI."""

    x: Float[Array, "m P"]
    rate: Float[Array, "k P"]


def solve_steps(layout: NodeOrder, factors: CyclicFactors, right: Float[Array, "m P"]) -> Changes:
    """The periodic dx_n for right sides d_n [units of the states], of the step from node n to the next."""
    return _solve_opened(layout, factors, _opened(layout, right))


def _solve_opened(layout: NodeOrder, factors: CyclicFactors, right: Float[Array, "m P"]) -> Changes:
    """The same, where what stands at the last node of a window that does not close is how it begins."""

    def pass_on(a: Array, given: tuple[Steps, Array, Array | None]) -> tuple[Array, Changes]:
        step, side, loose = given
        change, rate, ahead = (each[:, 0] for each in _one_step(step, factors.weight, a[:, None]))
        ahead = ahead if loose is None else jnp.where(loose, 0.0, ahead)
        return ahead + side, Changes(change, rate)

    def end(a: Array, given: tuple[Steps, Array, Array | None]) -> tuple[Array, None]:
        return pass_on(a, given)[0], None

    def over_chunk(a: Array, given: tuple[Array, Array]) -> tuple[Array, Array]:
        return apply_nodes(given[0], a) + given[1], a

    size = right.shape[0]
    given = (factors.steps, by_chunks(right), _loose_chunks(layout))
    sides, _ = jax.lax.scan(end, jnp.zeros_like(given[1][0]), given)
    over = (
        _over_chunks(layout, factors.chunks, jnp.eye(size)),
        _over_chunks(layout, sides, jnp.zeros(size)),
    )
    period_side, _ = jax.lax.scan(over_chunk, jnp.zeros_like(over[1][0]), over)
    start = jnp.einsum("dij,jd->id", factors.closing, period_side)
    _, starts = jax.lax.scan(over_chunk, start, over)
    begins = jnp.moveaxis(starts, 0, -1).reshape(size, -1)[:, layout.chunk_place]
    _, nodes = jax.lax.scan(pass_on, begins, given)
    return Changes(*(jnp.moveaxis(each, 0, -1).reshape(-1, right.shape[1]) for each in nodes))


Nodes = Float[Array, "k P"]


class Trajectory(NamedTuple):
    """States x = (q, qd, s), (m, P), and the algebraic unknowns y = (qdd, sd), (k, P)."""

    x: Nodes
    y: Nodes


class Linearised(NamedTuple):
    """A trajectory's linearisation, ready to solve for any right side.

    ``imbalance`` is -(dr/dy)^-1 r, (k, P); ``per_residual`` (dr/dy)^-1, (k, k, P). Residuals, x and y are in SI.
    """

    imbalance: Nodes
    per_residual: Float[Array, "k k P"]
    factors: CyclicFactors


def blank_linearised(model: AbstractPlant, layout: NodeOrder) -> Linearised:
    """Zeros of the shapes that :func:`linearise` gives."""
    n, nodes, dwells = len(model.coordinates), layout.dwell.size, len(layout.chunk_table)
    inner, chunks = n + len(model.states), nodes // CHUNK
    size = n + inner
    return Linearised(
        imbalance=jnp.zeros((inner, nodes)),
        per_residual=jnp.zeros((inner, inner, nodes)),
        factors=CyclicFactors(
            steps=Steps(
                lower=jnp.zeros((CHUNK, inner, size, chunks)),
                before=jnp.zeros((CHUNK, chunks)),
                ratio=jnp.zeros((CHUNK, chunks)),
            ),
            weight=jnp.zeros((size, 1)),
            chunks=jnp.zeros((size, size, chunks)),
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
    weight, before = implicitness(model), steps[layout.preceding]
    lower = _lower_inverse(before * weight[:, None], slope, n)
    factors = factorise_steps(layout, Steps(lower, before, steps / before), weight)
    return Linearised(imbalance, per_residual, factors)


def _lower_inverse(share: Float[Array, "m 1 P"], slope: Float[Array, "k m P"], n: int) -> Matrices:
    """The last k rows of A^-1 for steps times the weight of their far end [s], of a plant with n coordinates.

    The rate of a coordinate is a speed: only k rows are inverted.
    """
    late, eye = share[n:], jnp.eye(slope.shape[0])[:, :, None]
    by_place, by_rest = late * slope[:, :n], late * slope[:, n:]
    through = jnp.concatenate([share[:n, 0] * by_place, jnp.zeros_like(by_rest[:, n:])], axis=1)
    rest = invert_nodes(eye - by_rest - through)
    return jnp.concatenate([multiply_nodes(rest, by_place), rest], axis=1)


def step_defects(
    model: AbstractPlant, at: Trajectory, rate: Nodes, layout: NodeOrder, steps: Float[Array, " P"]
) -> Nodes:
    """By how much x_n plus its step misses x_{n+1}, for rates xd = ``rate``, in SI; ``steps`` [s]."""
    weight = implicitness(model)
    step = steps * ((1.0 - weight) * rate + weight * rate[:, layout.following])
    return at.x - at.x[:, layout.following] + step


def solve_linearised(layout: NodeOrder, lin: Linearised, defects: Nodes, imbalance: Nodes) -> Trajectory:
    """Changes (dx, dy) that cancel step defects given that dy = slope dx + imbalance at the nodes, all in SI."""
    change = solve_steps(layout, lin.factors, defects)
    return Trajectory(change.x, imbalance + change.rate)


def changed_initial_states(layout: Layout, lin: Linearised, change: Float[Array, "m D"]) -> Trajectory:
    """Changes (dx, dy) of windows that begin with a given state, by a ``change`` of that state [SI]; others stay."""
    opened = list(layout.opened)
    first = layout.starts[opened]
    begun = undone(steps_at(lin.factors, first), lin.factors.weight, change[:, opened])
    right = jnp.zeros((change.shape[0], layout.total)).at[:, layout.loose_ends].set(begun)
    found = _solve_opened(layout, lin.factors, right)
    return Trajectory(found.x, found.rate)


def steps_at(factors: CyclicFactors, nodes: NDArray[np.intp]) -> Steps:
    """The steps at some of the nodes, one node after the other."""
    chunk, place = np.divmod(nodes, CHUNK)
    return Steps(*(jnp.moveaxis(each[place, ..., chunk], 0, -1) for each in factors.steps))


def undone(steps: Steps, weight: Float[Array, "m 1"], change: Float[Array, "m P"]) -> Float[Array, "m P"]:
    """A_n dx_n for dx_n [units of the states]: what a step divides by undone."""
    rows, size = steps.lower.shape[:2]
    n = size - rows
    places = change[:n] - weight[:n] * steps.before * change[n : 2 * n]
    left = change[n:] - apply_nodes(steps.lower[:, :n], places)
    rest = jnp.linalg.solve(jnp.moveaxis(steps.lower[:, n:], -1, 0), left.T[..., None])[..., 0]
    return jnp.concatenate([places, rest.T])
