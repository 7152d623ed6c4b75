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
    return centre_1 + along * line + side * across * jnp.stack([-line[1], line[0]])


def linkage(p: Values, theta_LW: Float[Array, ""]) -> Linkage:
    """The pose of the double wishbone at lower-wishbone angle ``theta_LW`` [rad] from the nominal state.

    Outside the travel in which the upright can be assembled the result is NaN, which the solvers report.
    """
    a, b, c, d = (point(p, name) for name in "ABCD")
    cosine, sine = jnp.cos(theta_LW), jnp.sin(theta_LW)
    c_now = a + _turn(cosine, sine, c - a)
    crank, coupler = d - b, d - c
    side = jnp.sign((c - b)[0] * crank[1] - (c - b)[1] * crank[0])
    d_now = _circles_meet(b, crank @ crank, c_now, coupler @ coupler, side)
    cos_k, sin_k = _rotation_between(coupler, d_now - c_now)
    cos_u, sin_u = _rotation_between(crank, d_now - b)
    return Linkage(
        W=c_now + _turn(cos_k, sin_k, point(p, "W") - c),
        E=a + _turn(cosine, sine, point(p, "E") - a),
        cg_L=a + _turn(cosine, sine, point(p, "cg_L") - a),
        cg_U=b + _turn(cos_u, sin_u, point(p, "cg_U") - b),
        cg_K=c_now + _turn(cos_k, sin_k, point(p, "cg_K") - c),
        roll_L=theta_LW,
        roll_U=jnp.arctan2(sin_u, cos_u),
        roll_K=jnp.arctan2(sin_k, cos_k),
    )


def crank_pin(p: Values, theta_SL: Float[Array, ""]) -> Point:
    """The strut's upper end F [m] at link angle ``theta_SL`` [rad] (0: link and strut in line)."""
    angle = p["theta_0"] + theta_SL
    return point(p, "G") + p["l_SL"] * jnp.stack([jnp.cos(angle), jnp.sin(angle)])


def strut_length(p: Values, theta_LW: Float[Array, ""], theta_SL: Float[Array, ""]) -> Float[Array, ""]:
    """The strut's length l_SD [m] between its eye on the lower wishbone and the crank pin."""
    a = point(p, "A")
    eye = a + _turn(jnp.cos(theta_LW), jnp.sin(theta_LW), point(p, "E") - a)
    span = crank_pin(p, theta_SL) - eye
    return jnp.sqrt(span @ span)


def suspension_travel(p: Values, theta_LW: Float[Array, ""]) -> Float[Array, ""]:
    """Wheel travel relative to the sprung mass from the drawing's nominal state [m], bump positive."""
    return linkage(p, theta_LW).W[1] - p["W_z"]


def installation_ratio(p: Values, theta_LW: Float[Array, ""], theta_SL: Float[Array, ""]) -> Float[Array, ""]:
    """R = -dl_SD/dl_s [1] at the given angles [rad]: strut compression per suspension deflection (eq. 4)."""
    length_slope = jax.grad(strut_length, argnums=1)(p, theta_LW, theta_SL)
    travel_slope = jax.grad(suspension_travel, argnums=1)(p, theta_LW)
    return -length_slope / travel_slope
