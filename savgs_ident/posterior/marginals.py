"""Marginals of the draws beside what was known before, the Laplace approximation, and profiles of the density."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from scipy.special import ndtri

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.posterior.ascend import Top, ascend
from savgs_ident.posterior.chains import Chains
from savgs_ident.posterior.diagnostics import Mixing
from savgs_ident.posterior.mode import Case
from savgs_ident.posterior.profile import profile_of
from savgs_ident.posterior.result import Marginal, Role
from savgs_ident.posterior.scales import NUISANCE
from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.posterior.values import values_of

_ABOUT = {
    "noise_scale": "factor on the measured noise",
    "discrepancy": "relative rms by which the model misses, beyond the noise",
}

_STEP = 1e-5
"""Step of a coordinate for the slope of a value."""


def names_by_role(free: FreeVector) -> dict[str, Role]:
    """All names with their roles: identified, nuisance, tolerated."""
    roles: dict[str, Role] = dict.fromkeys(free.identified, "identified")
    roles |= dict.fromkeys(NUISANCE, "nuisance")
    return roles | dict.fromkeys(free.tolerated, "tolerated")


def marginals_of(
    case: Case, surrogate: Surrogate, chains: Chains, mixing: Mapping[str, Mixing]
) -> tuple[Marginal, ...]:
    """The marginal of every parameter, identified ones with their profiles."""
    free, scales = case.problem.free, case.likelihood.scales
    draws = values_of(free, scales, chains.points)
    low, high = (_prior_values(case, share) for share in (0.025, 0.975))
    top = ascend(surrogate, surrogate.start)
    mode = values_of(free, scales, surrogate.points(top.t)[None])
    laplace = _laplace_sd(case, surrogate, top)
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
                laplace_value=float(mode[name][0]),
                laplace_sd=laplace[name],
                **mixing[name]._asdict(),
                profile=profile_of(case.problem.free, surrogate, name) if role == "identified" else None,
            )
        )
    return tuple(found)


def _prior_values(case: Case, share: float) -> dict[str, float]:
    """The value of every parameter below which ``share`` of its prior lies."""
    normal = float(ndtri(share))
    # The discrepancy is half-normal: its quantile is one of the upper half of the normal.
    half = float(ndtri(0.5 + 0.5 * share))
    point = np.concatenate([case.prior.quantile(share), [normal, half]])
    return {
        name: float(value[0])
        for name, value in values_of(case.problem.free, case.likelihood.scales, point[None]).items()
    }


def _laplace_sd(case: Case, surrogate: Surrogate, top: Top) -> dict[str, float]:
    """Standard deviations from the curvature at the surrogate's top, each in its unit."""
    information = -np.asarray(_hessian(surrogate, jnp.asarray(top.t)))
    slopes = np.asarray(_point_slopes(surrogate, jnp.asarray(top.t)))
    sizes, axes = np.linalg.eigh(information)
    spread = slopes @ (axes / np.sqrt(np.where(sizes > 0.0, sizes, np.nan)))
    deviation = np.sqrt(np.sum(spread**2, axis=1))
    point = surrogate.points(top.t)
    found = {}
    for place, name in enumerate((*case.problem.free.names, *NUISANCE)):
        # Away from zero, where the discrepancy, a magnitude, has a kink.
        step = np.copysign(_STEP, point[place]) * np.eye(1, point.size, place)
        moved = values_of(
            case.problem.free, case.likelihood.scales, np.concatenate([point[None], point + step])
        )
        found[name] = float(abs(np.diff(moved[name])[0]) / _STEP * deviation[place])
    return found


@eqx.filter_jit
def _hessian(surrogate: Surrogate, t: Array) -> Array:
    return jax.hessian(surrogate)(t)


@eqx.filter_jit
def _point_slopes(surrogate: Surrogate, t: Array) -> Array:
    return jax.jacfwd(surrogate.point)(t)
