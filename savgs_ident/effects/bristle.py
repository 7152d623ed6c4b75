"""Contacts that stick before they slide: an elasto-plastic bristle.

A bristle of stiffness k and damping c, anchored at w, gives

    f = k x + c v held within -G_down .. G_up,      x = z - w,

opposing the motion, with limits of friction G in both directions; the anchor is dragged along so that the spring
stays within them (Dupont et al. 2002). A contact has one for the sum of all limits there
(:class:`savgs_ident.effects.base.AbstractFrictionLimitLaw`), with the presliding of the sheet.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.effects.base import FrictionLimit, PortSignals

DRAG_TIME = 2e-4
"""How fast the anchor follows an over-stretched bristle [s]: short beside the 4 ms of a reversal, and
without effect on the force, which is held meanwhile."""

CREEP = 1e-2
"""Creep of a stuck bristle [1/s]. Without it a rig that never slides has as many periodic motions as places
to stick; over the tenths of a second of a stick it moves the anchor by less than a hundredth of the stretch.
"""


class Presliding(NamedTuple):
    """Stiffness [N/m] and damping [N s/m] of a contact that sticks."""

    stiffness: Float[Array, ""]
    damping: Float[Array, ""]


class Bristle(NamedTuple):
    """Force on what slides [N], along its displacement, and velocity of the anchor [m/s]."""

    force: Float[Array, ""]
    rate: Float[Array, ""]


def held_within(x: Float[Array, ""], lower: Float[Array, ""], upper: Float[Array, ""]) -> Float[Array, ""]:
    """``x`` held within lower..upper. ``jnp.clip`` halves the slope in limits of zero, at the null.

    All are in the same unit.
    """
    return jnp.where(x > upper, upper, jnp.where(x < lower, lower, x))


def _not_below_zero(x: Float[Array, ""]) -> Float[Array, ""]:
    """``jnp.maximum`` halves the slope at zero, at the null."""
    return jnp.where(x < 0.0, 0.0, x)


def bristle(
    stick: Presliding, signals: PortSignals, limit: FrictionLimit, anchor: Float[Array, ""]
) -> Bristle:
    """The bristle's force and how fast its ``anchor`` [m] is dragged."""
    up, down = _not_below_zero(limit.against_up), -_not_below_zero(limit.against_down)
    stretch = signals.displacement - anchor
    resisting = held_within(stick.stiffness * stretch + stick.damping * signals.velocity, down, up)
    over = stretch - held_within(stretch, down / stick.stiffness, up / stick.stiffness)
    return Bristle(-resisting, over / DRAG_TIME + CREEP * stretch)
