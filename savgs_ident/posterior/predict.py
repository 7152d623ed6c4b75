"""What the posterior predicts for a repetition of the campaign, and whether the campaign itself looks like one."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Complex, Float

from savgs_ident.posterior.chains import Chains
from savgs_ident.posterior.exact import ExactModel
from savgs_ident.posterior.result import Predictive

WITHIN = 0.95
"""Share of repetitions that the band holds."""


def predict(exact: ExactModel, chains: Chains, count: int, seed: int) -> Predictive:
    """The prediction at ``count`` draws, evenly spaced along the chains; unsolved ones are left out."""
    flat = chains.points.reshape(-1, chains.points.shape[-1])
    points = flat[np.unique(np.linspace(0, len(flat) - 1, count).astype(int))]
    found = exact.responses(points[:, :-2])
    points, model = points[found.solved], found.harmonics[found.solved]
    likelihood, shape = exact.likelihood, model.shape[1:]
    spread = np.asarray(jax.vmap(likelihood.spread)(jnp.asarray(points)))
    errors = np.random.default_rng(seed).standard_normal(spread.shape) * np.sqrt(spread)
    replicated = model + likelihood.harmonics(errors, shape)
    measured = likelihood.harmonics(np.asarray(likelihood.measured)[None], shape)[0]
    used = np.asarray(exact.problem.target.used)
    return Predictive(model, np.where(used, replicated, 0.0), used, _inside(measured, replicated, used))


def _inside(
    measured: Complex[np.ndarray, "D C K"], replicated: Complex[np.ndarray, "S D C K"], used: np.ndarray
) -> Bool[np.ndarray, "D C K"]:
    """Whether a phasor is no further from the repetitions' mean than 95 % of them, in their covariance."""
    middle = replicated.mean(axis=0)
    off = _parts(replicated - middle)
    covariance = np.einsum("sdcki,sdckj->dckij", off, off) / len(off)
    precision = np.linalg.inv(np.where(used[..., None, None], covariance, np.eye(2)))

    def distance(parts: Float[np.ndarray, "... 2"]) -> Float[np.ndarray, "..."]:
        return np.asarray(np.einsum("...i,...ij,...j->...", parts, precision, parts))

    return np.asarray(
        used & (distance(_parts(measured - middle)) <= np.quantile(distance(off), WITHIN, axis=0))
    )


def _parts(values: np.ndarray) -> np.ndarray:
    return np.stack([values.real, values.imag], axis=-1)
