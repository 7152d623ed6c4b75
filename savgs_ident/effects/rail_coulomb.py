"""Friction of the railway carriages, eqs. (1)-(2) of the paper, with its presliding.

The carriages carry |F_Nt| + |F_Nb| and slide with F_c = mu_r (|F_Nt| + |F_Nb|). They stick before they slide:
an elasto-plastic bristle of stiffness k_pre and damping c_pre, anchored at w, gives

    f = clip(k_pre x + c_pre v, -F_c, F_c),      x = z_s - w,

opposing the motion, and the anchor is dragged along so that |x| stays within F_c / k_pre.
"""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.model.effect import AbstractEffect, InternalState, Port, PortSignals
from savgs_ident.model.values import Values

DRAG_TIME = 2e-4
"""How fast the anchor follows an over-stretched bristle [s]: short beside the 4 ms of a reversal, and
without effect on the force, which is clipped meanwhile."""


CREEP = 1e-2
"""Creep of a stuck bristle [1/s]. Without it a rig that never slides has as many periodic motions as places
to stick; over the tenths of a second of a stick it moves the anchor by less than a hundredth of the stretch.
"""


def _held_within(x: Float[Array, ""], limit: Float[Array, ""]) -> Float[Array, ""]:
    """``x`` held within -limit..limit. ``jnp.clip`` halves the slope in a limit of zero, at the null."""
    return jnp.where(x > limit, limit, jnp.where(x < -limit, -limit, x))


class RailCoulomb(AbstractEffect):
    """Load-dependent Coulomb friction of the rail with elasto-plastic presliding."""

    name: ClassVar[str] = "rail_coulomb"
    port: ClassVar[Port] = Port.RAIL
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("mu_r", 0.03, "1", lower=0.0, upper=0.5, about="rail friction coefficient"),
        Parameter("k_pre", 1e7, "N/m", tolerance=1e6, lower=1e5, about="presliding stiffness of the rail"),
        Parameter("c_pre", 3e4, "N s/m", tolerance=3e3, lower=0.0, about="presliding damping of the rail"),
    )
    null: ClassVar[Mapping[str, float]] = {"mu_r": 0.0}
    states: ClassVar[tuple[InternalState, ...]] = (InternalState("anchor", "m", 1e-2, slips=True),)
    symptom: ClassVar[str] = "the sprung mass sticks at each reversal and odd orders of its acceleration grow"
    reference: ClassVar[str] = "Yu et al. 2017, eqs. (1)-(2); Dupont et al. 2002 for the bristle"

    def force(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, ""]:
        """The friction on the sprung mass [N], up positive."""
        slide = p["mu_r"] * signals.load
        stretch = signals.displacement - state[0]
        return -_held_within(p["k_pre"] * stretch + p["c_pre"] * signals.velocity, slide)

    def rate(self, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Float[Array, " s"]:
        """The anchor's velocity [m/s]."""
        limit = p["mu_r"] * signals.load / p["k_pre"]
        stretch = signals.displacement - state[0]
        dragged = (stretch - _held_within(stretch, limit)) / DRAG_TIME
        return jnp.stack([dragged + CREEP * stretch])
