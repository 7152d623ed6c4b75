"""Profiles of the posterior: how high it gets with one parameter held.

They are those of the surrogate, which is exact at its centre and of second order about it.
"""

import equinox as eqx
import numpy as np

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.posterior.ascend import ascend
from savgs_ident.posterior.result import ProfileLine
from savgs_ident.posterior.shear import no_shear
from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.posterior.values import values_of

SPAN = 3.0
"""How far profiles reach to either side [standard deviations]."""

STEPS = 6
"""Points of a profile to either side."""


def profile_of(free: FreeVector, surrogate: Surrogate, name: str) -> ProfileLine:
    """The profile of a parameter, each point from its neighbour, outwards from the top.

    A point at which the search failed is left out.
    """
    # Without the shear a held parameter is a plane.
    flat = eqx.tree_at(lambda each: each.shear, surrogate, no_shear(len(free.names)))
    place = free.names.index(name)
    row, centre = np.asarray(flat.scale)[place], float(np.asarray(flat.centre)[place])
    top = ascend(flat, flat.start)
    middle = float(flat.points(top.t)[place])
    found = {middle: 0.0}
    for reach in (-SPAN, SPAN):
        at = top.t
        for share in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
            level = middle + share * reach * float(np.linalg.norm(row))
            held = ascend(flat, at, row, level - centre)
            if held.found:
                found[level], at = 2.0 * (top.value - held.value), held.t
    levels = np.array(sorted(found))
    points = np.tile(flat.points(top.t), (levels.size, 1))
    points[:, place] = levels
    return ProfileLine(
        values_of(free, flat.likelihood.scales, points)[name], np.array([found[each] for each in levels])
    )
