"""The exact log density of points of the posterior."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from savgs_ident.posterior.exact import ExactModel
from savgs_ident.posterior.likelihood import Likelihood
from savgs_ident.posterior.prior import Prior
from savgs_ident.simulate.stored import placed


class Decision(NamedTuple):
    """Log density (W,), minus infinity where the model was not ``solved`` (W,)."""

    log_density: Float[np.ndarray, " W"]
    solved: Bool[np.ndarray, " W"]


def decide(exact: ExactModel, prior: Prior, points: Float[np.ndarray, "W n+2"]) -> Decision:
    """The exact log density at points."""
    rows, solved = exact.rows(points[:, :-2])
    safe = np.where(solved[:, None], rows, 0.0)
    values = np.asarray(
        _densities(exact.likelihood, prior, *placed((jnp.asarray(safe), jnp.asarray(points))))
    )
    return Decision(np.where(solved & np.isfinite(values), values, -np.inf), solved)


@eqx.filter_jit
def _densities(likelihood: Likelihood, prior: Prior, rows: Array, points: Array) -> Array:
    return jax.vmap(lambda row, point: likelihood(row, point) + prior(point))(rows, points)
