"""Marginals of draws whose distribution is known, and the curvature's standard deviations beside them."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from savgs_ident.core.transforms import WIDTH
from savgs_ident.inference.diagnostics import marginals_of, mixing_of, names_by_role
from savgs_ident.inference.likelihood import values_of
from savgs_ident.inference.prior import NUISANCE
from savgs_ident.inference.result import Marginal
from savgs_ident.inference.samplers.chains import Chains
from savgs_ident.inference.surrogate_shape import shape_of

from .toy import FIXED_SCALES, FREE, PARAMETERS, Toy, straight_toy
from .toy_surrogate import density_of, mode_of, normal_covariance, stand_for


def _normal_chains(toy: Toy, mode: np.ndarray) -> Chains:
    """Independent draws of the parameters' normal posterior and of the scales' priors."""
    random = np.random.default_rng(2)
    u = random.multivariate_normal(mode[:-2], normal_covariance(toy), size=(2000, 4))
    points = np.concatenate([u, random.standard_normal((2000, 4, 2))], axis=2)
    nothing = np.zeros((2000, 4))
    return Chains(points, nothing, nothing > -1.0, np.zeros(0), 0, 8000, 0)


def _marginals(toy: Toy) -> Mapping[str, Marginal]:
    stand = stand_for(toy)
    chains = _normal_chains(toy, stand.point)
    draws = values_of(FREE, toy.likelihood.scales, chains.points)
    mixing = {name: mixing_of(each) for name, each in draws.items()}
    shape = shape_of(stand.posterior, stand.surrogate)
    return {each.name: each for each in marginals_of(stand.posterior, shape, chains, mixing)}


@pytest.fixture(scope="module")
def strong() -> Toy:
    """Data so strong that values are linear in coordinates and priors are flat, with known scales."""
    return straight_toy(scales=FIXED_SCALES, strength=300.0)


@pytest.fixture(scope="module")
def marginals(strong: Toy) -> Mapping[str, Marginal]:
    return _marginals(strong)


def _true(toy: Toy) -> tuple[np.ndarray, np.ndarray]:
    """Means and standard deviations of the values."""
    mode = mode_of(toy)[:-2]
    mean = np.array([float(each) for each in FREE.to_constrained(jnp.asarray(mode)).values()])
    return mean, np.asarray(FREE.jacobian_diag(jnp.asarray(mode))) * np.sqrt(np.diag(normal_covariance(toy)))


def test_order_and_roles(marginals: Mapping[str, Marginal]) -> None:
    assert [each.role for each in marginals.values()] == [*["identified"] * 2, *["nuisance"] * 2, "tolerated"]
    assert list(marginals) == list(names_by_role(FREE)) == ["friction", "damping", *NUISANCE, "spring"]
    assert [each.unit for each in marginals.values()] == ["1", "N s/m", "1", "1", "N/m"]
    assert marginals["friction"].about == "of the rail"
    assert [each.profile is not None for each in marginals.values()] == [True, True, False, False, False]


def test_draws_and_curvature_give_the_analytic_posterior(
    strong: Toy, marginals: Mapping[str, Marginal]
) -> None:
    for name, mean, sd in zip(FREE.names, *_true(strong), strict=True):
        found = marginals[name]
        assert found.laplace_sd == pytest.approx(sd, rel=2e-3)
        assert abs(found.laplace_value - mean) < 0.01 * sd
        error = 4.0 * sd / np.sqrt(8000)
        assert abs(found.median - mean) < 1.25 * error
        assert abs(found.sd - sd) < error / np.sqrt(2.0)
        for value, share in ((found.q025, -1.96), (found.q975, 1.96)):
            assert abs(value - mean - share * sd) < 2.7 * error


def test_a_profile_stands_on_its_top(strong: Toy, marginals: Mapping[str, Marginal]) -> None:
    for place, name in enumerate(("friction", "damping")):
        profile, (mean, sd) = marginals[name].profile, (each[place] for each in _true(strong))
        assert profile is not None
        np.testing.assert_allclose(profile.rise, ((profile.values - mean) / sd) ** 2, atol=0.05)


def test_what_was_known_before(marginals: Mapping[str, Marginal]) -> None:
    spring, damping = PARAMETERS["spring"], PARAMETERS["damping"]
    known = {
        "damping": stats.lognorm(WIDTH, scale=damping.value),
        "spring": stats.norm(spring.value, spring.tolerance),
        "noise_scale": stats.lognorm(FIXED_SCALES.noise_trust),
        "discrepancy": stats.halfnorm(scale=FIXED_SCALES.discrepancy),
    }
    for name, prior in known.items():
        assert marginals[name].prior == pytest.approx(prior.ppf([0.025, 0.975]), rel=1e-9)


def test_contraction_is_the_share_by_which_the_interval_shrank(marginals: Mapping[str, Marginal]) -> None:
    for name in FREE.names:
        found = marginals[name]
        low, high = found.prior
        assert found.contraction == pytest.approx(1.0 - (found.q975 - found.q025) / (high - low))
        assert found.contraction > 0.9
    # The scales were drawn from their priors: nothing was learnt.
    for name in NUISANCE:
        assert abs(marginals[name].contraction) < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("miss", [0.0, 0.05], ids=["no discrepancy", "discrepancy"])
def test_the_curvature_is_that_of_the_exact_density_at_its_mode(miss: float) -> None:
    """Without a discrepancy its density is highest at zero, on the symmetry plane of its coordinate."""
    toy = straight_toy(miss=miss)
    posterior, mode = density_of(toy), mode_of(toy)
    base, slope = jnp.asarray(toy.base), jnp.asarray(toy.slope)
    assert (mode[-1] > 0.3) == (miss > 0.0)
    # The magnitude has no second derivative at zero, the square of it has.
    at = jnp.asarray(np.append(mode[:-1], max(mode[-1], 1e-6)))

    def density(point: jax.Array) -> jax.Array:
        return posterior.likelihood(base + slope @ point[:-2], point) + posterior.prior(point)

    deviation = np.sqrt(np.diag(np.linalg.inv(-np.asarray(jax.hessian(density)(at)))))
    scales = toy.likelihood.scales
    stretch = [
        *np.asarray(FREE.jacobian_diag(at[:-2])),
        scales.noise_trust * np.exp(scales.noise_trust * mode[-2]),
        scales.discrepancy,
    ]
    found = _marginals(toy)
    for name, sd, factor in zip((*FREE.names, *NUISANCE), deviation, stretch, strict=True):
        assert found[name].laplace_sd == pytest.approx(factor * sd, rel=0.02), name
