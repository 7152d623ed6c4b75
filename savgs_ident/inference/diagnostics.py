"""Whether chains have converged, and what their draws say beside what was known before.

R-hat and effective sample sizes are rank-normalised (Vehtari, Gelman, Simpson, Carpenter and Buerkner, Bayesian
Analysis 16, 2021); the autocorrelation time is emcee's, of all chains together; the Pareto index of the weights shows
whether the surrogate covers the posterior. Beside the marginals of the draws stand the prior, the Laplace
approximation and the profile of the density, both of the surrogate, which is exact at its centre and of second order
about it.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from arviz_stats.base.array import array_stats
from emcee.autocorr import integrated_time
from jaxtyping import Float
from scipy.special import logsumexp, ndtri

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.posterior_mode import PosteriorDensity
from savgs_ident.inference.prior import NUISANCE
from savgs_ident.inference.result import Convergence, Marginal, Role
from savgs_ident.inference.samplers.chains import Chains
from savgs_ident.inference.surrogate_shape import Shape

LEAST_DRAWS = 8
"""Steps of a chain below which nothing can be said."""

TAILS = (0.05, 0.95)
"""Quantiles of which the tail's effective sample size is the lesser."""

R_HAT = 1.01
"""R-hat up to which an identified parameter counts as mixed."""

R_HAT_OTHERS = 1.05
"""The same for the tolerated parameters and the nuisance scales, of which nobody reads quantiles."""

PRECISE = 0.025
"""Monte-Carlo error of a median, in standard deviations of the posterior, below which more draws are no use."""

PARETO_K = 0.7
"""Pareto index of the weights up to which the surrogate covers the posterior."""

EVEN = 1.1
"""Largest weight over the mean up to which the index says nothing: it measures the shape of a tail, whatever the
tail's size, and no state holds a chain for longer than so many steps."""

DIVERGING = 0.01
"""Share of trajectories that may diverge."""


class Mixing(NamedTuple):
    """How well one parameter's draws mix.

    NaN where chains are too short or do not move; all in draws or without dimension [1].
    """

    ess_bulk: float
    ess_tail: float
    r_hat: float
    autocorrelation: float


def mixing_of(draws: Float[np.ndarray, "S C"]) -> Mixing:
    """The mixing of one parameter's draws [its unit], steps by chains."""
    if draws.shape[0] < LEAST_DRAWS or np.ptp(draws) == 0.0:
        return Mixing(np.nan, np.nan, np.nan, np.nan)
    axes = {"chain_axis": 1, "draw_axis": 0}
    bulk = float(array_stats.ess(draws, method="bulk", **axes))
    tail = float(array_stats.ess(draws, method="tail", prob=TAILS, **axes))
    return Mixing(bulk, tail, float(array_stats.rhat(draws, **axes)), _autocorrelation(draws))


def least_ess(mixing: Sequence[Mixing]) -> float:
    """The least effective sample size of bulk and tail over several parameters; 0 where nothing can be said."""
    # NumPy's minimum is NaN if one of them is; Python's depends on their order.
    least = np.min([(each.ess_bulk, each.ess_tail) for each in mixing]) if mixing else np.nan
    return float(least) if np.isfinite(least) else 0.0


def enough(mixing: Sequence[Mixing], target: float) -> bool:
    """Whether identified parameters have mixed and reached the effective sample size asked for."""
    return least_ess(mixing) >= target and all(each.r_hat <= R_HAT for each in mixing)


def mixing_of_identified(chains: Chains, count: int) -> list[Mixing]:
    """The mixing of the first ``count`` coordinates, those of the identified parameters."""
    return [mixing_of(each) for each in np.moveaxis(chains.points[:, :, :count], 2, 0)]


def mixing_of_others(chains: Chains, count: int) -> list[Mixing]:
    """The mixing of the other coordinates."""
    # The discrepancy is the size of the last coordinate, whose sign means nothing.
    sized = np.concatenate([chains.points[:, :, count:-1], np.abs(chains.points[:, :, -1:])], axis=2)
    return [mixing_of(each) for each in np.moveaxis(sized, 2, 0)]


def others_mixed(others: Sequence[Mixing]) -> bool:
    """Whether what is not identified has mixed."""
    return all(each.r_hat <= R_HAT_OTHERS for each in others)


def precise(mixing: Sequence[Mixing]) -> bool:
    """Whether medians are known to :data:`PRECISE`: that of a normal has the error sqrt(pi / 2) / sqrt(ess)."""
    return least_ess(mixing) >= 0.5 * np.pi / PRECISE**2


def assess_convergence(
    chains: Chains,
    identified: Sequence[Mixing],
    others: Sequence[Mixing],
    target: float,
    doubts: Sequence[str],
) -> Convergence:
    """Whether the draws may be used; ``doubts`` are reasons against it that are known already.

    ``target`` is the effective sample size asked for.
    """
    ess = least_ess(identified)
    r_hat = _greatest_r_hat(identified) if identified else np.nan
    r_hat_others = _greatest_r_hat(others) if others else 1.0
    # ArviZ takes log likelihoods, of which the logarithms of the weights are the negatives.
    k = float(array_stats.psislw(-chains.log_ratio)[1]) if chains.log_ratio.size > 20 else np.nan
    heaviest = _heaviest(chains.log_ratio)
    diverging = chains.divergences / max(chains.evaluations, 1)
    acceptance = float(np.mean(chains.accepted)) if chains.accepted.size else 0.0
    reasons = list(doubts)
    if not ess >= target:
        reasons.append(f"the least effective sample size is {ess:.0f}, {target:.0f} were asked for")
    if not r_hat <= R_HAT:
        reasons.append(f"the chains disagree: R-hat is {r_hat:.3f}, above {R_HAT}")
    if not r_hat_others <= R_HAT_OTHERS:
        reasons.append(
            f"the chains disagree in a tolerated parameter: R-hat is {r_hat_others:.3f}, above {R_HAT_OTHERS}"
        )
    if k > PARETO_K and heaviest > EVEN:
        reasons.append(
            f"the surrogate does not cover the posterior: Pareto k is {k:.2f}, above {PARETO_K}, and a draw weighs up"
            f" to {heaviest:.3g} times the mean"
        )
    if diverging > DIVERGING:
        reasons.append(f"{chains.divergences} trajectories diverged")
    return Convergence(
        converged=not reasons,
        reasons=tuple(reasons),
        target_ess=target,
        ess_min=ess,
        r_hat_max=float(np.fmax(r_hat, r_hat_others)),
        acceptance=acceptance,
        divergences=chains.divergences,
        pareto_k=k,
        heaviest_weight=heaviest,
        evaluations=chains.evaluations,
        unsolved=chains.unsolved,
    )


def _heaviest(log_ratio: Float[np.ndarray, " W"]) -> float:
    """The largest weight over the mean; NaN without any."""
    return (
        float(np.exp(log_ratio.max() - logsumexp(log_ratio)) * log_ratio.size) if log_ratio.size else np.nan
    )


def _greatest_r_hat(mixing: Sequence[Mixing]) -> float:
    """NaN if one of them is."""
    return float(np.max([each.r_hat for each in mixing]))


def _autocorrelation(draws: Float[np.ndarray, "S C"]) -> float:
    # Short chains are said to be so by the effective sample size; a warning here would only repeat it. One that
    # has not moved has no autocorrelation.
    with np.errstate(invalid="ignore"):
        return float(integrated_time(draws[:, :, None], tol=0, quiet=True)[0])


_ABOUT = {
    "noise_scale": "factor on the measured noise",
    "discrepancy": "size of the small errors of the model, relative to the response or the force",
}


def names_by_role(free: FreeVector) -> dict[str, Role]:
    """All names with their roles: identified, nuisance, what was known beforehand."""
    roles: dict[str, Role] = dict.fromkeys(free.identified, "identified")
    roles |= dict.fromkeys(NUISANCE, "nuisance")
    known = {each.name: each for each in free.parameters if each.name in free.tolerated}
    return roles | {name: "typical" if each.is_typical else "tolerated" for name, each in known.items()}


def marginals_of(
    posterior: PosteriorDensity, shape: Shape, chains: Chains, mixing: Mapping[str, Mixing]
) -> tuple[Marginal, ...]:
    """The marginal of every parameter, identified ones with their profiles."""
    free, scales = posterior.problem.free, posterior.likelihood.scales
    draws = values_of(free, scales, chains.points)
    low, high = (_prior_values(posterior, share) for share in (0.025, 0.975))
    about = {each.name: (each.unit, each.about) for each in free.parameters}
    about |= {name: ("1", text) for name, text in _ABOUT.items()}
    found = []
    for name, role in names_by_role(free).items():
        q025, median, q975 = np.quantile(draws[name], [0.025, 0.5, 0.975])
        unit, text = about[name]
        found.append(
            Marginal(
                name=name,
                unit=unit,
                about=text,
                role=role,
                median=float(median),
                sd=float(np.std(draws[name], ddof=1)),
                q025=float(q025),
                q975=float(q975),
                prior=(low[name], high[name]),
                contraction=float(1.0 - (q975 - q025) / (high[name] - low[name])),
                laplace_value=shape.values[name],
                laplace_sd=shape.sd[name],
                **mixing[name]._asdict(),
                profile=shape.profiles.get(name),
            )
        )
    return tuple(found)


def _prior_values(posterior: PosteriorDensity, share: float) -> dict[str, float]:
    """The value of every parameter below which ``share`` of its prior lies."""
    normal = float(ndtri(share))
    # The discrepancy is half-normal: its quantile is one of the upper half of the normal.
    half = float(ndtri(0.5 + 0.5 * share))
    point = np.concatenate([posterior.prior.quantile(share), [normal, half]])
    return {
        name: float(value[0])
        for name, value in values_of(posterior.problem.free, posterior.likelihood.scales, point[None]).items()
    }
