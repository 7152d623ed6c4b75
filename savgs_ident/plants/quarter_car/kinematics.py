"""Planar double wishbone and single link in closed form.

Axes: y outward from the rail to the wheel, z up, roll counter-clockwise from +y to +z. All points are given
in the frame of the sprung mass, whose origin is where it was in the nominal state (link at 90 deg, static
load), so that the drawing's hardpoints are the positions at ``theta_LW = 0``.

The lower wishbone turns about A by ``theta_LW``, which carries its ball joint C and the strut's eye E. The
upper ball joint D lies where the circle about B meets the circle about C: two circles meet in closed form,
so no iteration is needed and everything is smooth and differentiable, in the hardpoints too. The upright is
the rigid body that carries C and D; the single link carries the strut's upper end F about G.

    B ---------- D
                 |  upright, wheel centre W
    A ---------- C
         E
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values

Point = Float[Array, "2"]
"""Lateral and vertical coordinate (y, z)."""

Pair = tuple[Float[Array, ""], Float[Array, ""]]
"""The same as two scalars."""


class Linkage(NamedTuple):
    """Where the unsprung bodies are, in the frame of the sprung mass.

    Points [m] as (y, z): wheel centre ``W``, strut eye ``E``, centres of gravity of the lower wishbone,
    upper wishbone and upright; their rolls from the nominal state [rad].
    """

    W: Point
    E: Point
    cg_L: Point
    cg_U: Point
    cg_K: Point
    roll_L: Float[Array, ""]
    roll_U: Float[Array, ""]
    roll_K: Float[Array, ""]


def point(p: Values, name: str) -> Point:
    """The hardpoint or centre of gravity ``name`` [m] as (y, z)."""
    return jnp.stack([p[f"{name}_y"], p[f"{name}_z"]])


def _turn(cosine: Array, sine: Array, vector: Array) -> Array:
    return jnp.stack([cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]])


def _across(vector: Array) -> Array:
    """``vector`` turned by a right angle, counter-clockwise."""
    return jnp.stack([-vector[1], vector[0]])


def _rotation_between(start: Array, end: Array) -> tuple[Array, Array]:
    """Cosine and sine of the rotation that takes direction ``start`` to ``end`` (equal lengths)."""
    square = start @ start
    return (start @ end) / square, (start[0] * end[1] - start[1] * end[0]) / square


def _circles_meet(centre_1: Array, square_1: Array, centre_2: Array, square_2: Array, side: Array) -> Array:
    """The crossing of two circles (centres [m], squared radii [m^2]) on the given side (+1 or -1)."""
    line = centre_2 - centre_1
    square = line @ line
    along = (square_1 - square_2 + square) / (2.0 * square)
    across = jnp.sqrt(square_1 / square - along**2)
    return centre_1 + along * line + side * across * _across(line)


class _ClosedLoop(NamedTuple):
    """The ball joints [m] where the wishbones meet the upright; cosine and sine of its roll and the upper one's."""

    C: Point
    D: Point
    upright: Pair
    upper: Pair


def _lower_wishbone(p: Values, theta_LW: Array, name: str) -> Point:
    """Where a point of the lower wishbone is."""
    a = point(p, "A")
    return a + _turn(jnp.cos(theta_LW), jnp.sin(theta_LW), point(p, name) - a)


def _closed_loop(p: Values, theta_LW: Array) -> _ClosedLoop:
    b, c, d = (point(p, name) for name in "BCD")
    c_now = _lower_wishbone(p, theta_LW, "C")
    crank, coupler = d - b, d - c
    side = jnp.sign((c - b)[0] * crank[1] - (c - b)[1] * crank[0])
    d_now = _circles_meet(b, crank @ crank, c_now, coupler @ coupler, side)
    upright, upper = _rotation_between(coupler, d_now - c_now), _rotation_between(crank, d_now - b)
    return _ClosedLoop(c_now, d_now, upright, upper)


def _upright(p: Values, loop: _ClosedLoop, name: str) -> Point:
    """Where a point of the upright is."""
    return loop.C + _turn(*loop.upright, point(p, name) - point(p, "C"))


def _upper_wishbone(p: Values, loop: _ClosedLoop, name: str) -> Point:
    """Where a point of the upper wishbone is."""
    b = point(p, "B")
    return b + _turn(*loop.upper, point(p, name) - b)


def linkage(p: Values, theta_LW: Float[Array, ""]) -> Linkage:
    """The pose of the double wishbone at lower-wishbone angle ``theta_LW`` [rad] from the nominal state.

    Outside the travel in which the upright can be assembled the result is NaN, which the solvers report.
    """
    loop = _closed_loop(p, theta_LW)
    (cos_k, sin_k), (cos_u, sin_u) = loop.upright, loop.upper
    return Linkage(
        W=_upright(p, loop, "W"),
        E=_lower_wishbone(p, theta_LW, "E"),
        cg_L=_lower_wishbone(p, theta_LW, "cg_L"),
        cg_U=_upper_wishbone(p, loop, "cg_U"),
        cg_K=_upright(p, loop, "cg_K"),
        roll_L=theta_LW,
        roll_U=jnp.arctan2(sin_u, cos_u),
        roll_K=jnp.arctan2(sin_k, cos_k),
    )


def linkage_slope(p: Values, theta_LW: Float[Array, ""]) -> Linkage:
    """Slopes of the pose in ``theta_LW``: of points [m/rad], of rolls [1].

    Every body turns about its pivot or carries on what moves at its end; the velocity of D is the same along C D for
    both of its bodies.
    """
    a, b, loop = point(p, "A"), point(p, "B"), _closed_loop(p, theta_LW)
    crank, coupler, moved_c = loop.D - b, loop.D - loop.C, _across(loop.C - a)
    turn_u = (coupler @ moved_c) / (coupler @ _across(crank))
    turn_k = _across(coupler) @ (turn_u * _across(crank) - moved_c) / (coupler @ coupler)

    def on_upright(name: str) -> Point:
        return moved_c + turn_k * _across(_upright(p, loop, name) - loop.C)

    def on_lower(name: str) -> Point:
        return _across(_lower_wishbone(p, theta_LW, name) - a)

    return Linkage(
        W=on_upright("W"),
        E=on_lower("E"),
        cg_L=on_lower("cg_L"),
        cg_U=turn_u * _across(_upper_wishbone(p, loop, "cg_U") - b),
        cg_K=on_upright("cg_K"),
        roll_L=jnp.ones_like(turn_u),
        roll_U=turn_u,
        roll_K=turn_k,
    )


def crank_pin(p: Values, theta_SL: Float[Array, ""]) -> Point:
    """The strut's upper end F [m] at link angle ``theta_SL`` [rad] (0: link and strut in line)."""
    angle = p["theta_0"] + theta_SL
    return point(p, "G") + p["l_SL"] * jnp.stack([jnp.cos(angle), jnp.sin(angle)])


def strut_length(p: Values, theta_LW: Float[Array, ""], theta_SL: Float[Array, ""]) -> Float[Array, ""]:
    """The strut's length l_SD [m] between its eye on the lower wishbone and the crank pin."""
    span = crank_pin(p, theta_SL) - _lower_wishbone(p, theta_LW, "E")
    return jnp.sqrt(span @ span)


def suspension_travel(p: Values, theta_LW: Float[Array, ""]) -> Float[Array, ""]:
    """Wheel travel relative to the sprung mass from the drawing's nominal state [m], bump positive."""
    return _upright(p, _closed_loop(p, theta_LW), "W")[1] - p["W_z"]


def installation_ratio(p: Values, theta_LW: Float[Array, ""], theta_SL: Float[Array, ""]) -> Float[Array, ""]:
    """R = -dl_SD/dl_s [1] at the given angles [rad]: strut compression per suspension deflection (eq. 4)."""
    length_slope = jax.grad(strut_length, argnums=1)(p, theta_LW, theta_SL)
    travel_slope = jax.grad(suspension_travel, argnums=1)(p, theta_LW)
    return -length_slope / travel_slope
