"""The surrogate to second order about the mode, and the exact model that starts from there."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from savgs_ident.posterior.exact import Anchor, ExactModel, anchor_at, in_parallel, rows_and_slopes
from savgs_ident.posterior.mode import Case, Foothold, Progress, linear_surrogate
from savgs_ident.posterior.shear import shear_of
from savgs_ident.posterior.surrogate import Surrogate, bend_of

BENT = 0.5
"""Second derivative [noise sd] beyond which an axis is explored to its other side too."""


class Expansion(NamedTuple):
    """The model about a point: exact near it, and a surrogate to second order."""

    exact: ExactModel
    surrogate: Surrogate


def expand(case: Case, at: Foothold, tell: Progress) -> Expansion:
    """The expansion about a foothold."""
    linear = linear_surrogate(case, at)
    axes = np.asarray(linear.scale)[:-2, :-2]
    weight = 1.0 / np.sqrt(np.asarray(case.likelihood.spread(linear.centre)))
    tell(f"second derivatives of the response along {axes.shape[1]} axes")
    anchor = anchor_at(case.problem, jnp.asarray(at.point[:-2]), at.solution)
    second = _second_derivatives(case, at, anchor, axes, weight)
    bent = (bend_of(second, weight), shear_of(second, np.asarray(linear.slope), weight))
    surrogate = eqx.tree_at(lambda each: (each.bend, each.shear), linear, bent)
    return Expansion(ExactModel(case.problem, case.likelihood, anchor), surrogate)


def _second_derivatives(
    case: Case, at: Foothold, anchor: Anchor, axes: Float[np.ndarray, "n n"], weight: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "n n m"]:
    """Differences of the slopes one standard deviation ahead; of both sides where an axis bends much.

    An axis whose sides were not solved counts as straight: the exact model decides in the end.
    """

    def slopes_at(shift: np.ndarray) -> np.ndarray:
        u = jnp.asarray(at.point[:-2] + shift)
        _, slopes, solution = rows_and_slopes(
            case.problem, case.likelihood, u, at.solution, anchor.predicted(u)
        )
        solved = all(status.ok for status in solution.status())
        return np.asarray((slopes @ axes).T if solved else np.full((axes.shape[1], at.rows.size), np.nan))

    here = (at.slopes @ axes).T
    second = np.stack(in_parallel(slopes_at, axes.T)) - here
    own = np.arange(len(second))
    bent = np.flatnonzero(~(np.linalg.norm(second[own, own] * weight, axis=1) < BENT))
    for axis, behind in zip(bent, in_parallel(slopes_at, -axes.T[bent]), strict=True):
        one_sided = here - behind
        both = 0.5 * (second[axis] + one_sided)
        second[axis] = np.where(np.isfinite(both), both, one_sided)
    return np.nan_to_num(second)
