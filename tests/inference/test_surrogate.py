"""The surrogate is the model to second order, and what it leaves out is said."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.inference.expansion import linear_surrogate
from savgs_ident.inference.near_mode import SHAPES, LinearisationPoint, bend_of

from .toy import Toy, bent_toy
from .toy_surrogate import Stand, density_of, mode_of, stand_for


@pytest.fixture(scope="module")
def quadratic() -> Toy:
    toy = bent_toy()
    return replace(toy, cubic=np.zeros_like(toy.cubic))


def _off(toy: Toy, stand: Stand, t: np.ndarray) -> float:
    """How far the surrogate's rows are from the model's at t [noise sd]."""
    point = stand.surrogate.points(t[None])[0]
    true = toy.rows(point[None, :-2])[0][0]
    spread = np.sqrt(np.asarray(toy.likelihood.spread(stand.surrogate.centre)))
    return float(np.linalg.norm((np.asarray(stand.surrogate.predicted(jnp.asarray(t))) - true) / spread))


def test_a_quadratic_model_is_reported_exactly(quadratic: Toy) -> None:
    stand = stand_for(quadratic)
    for t in np.random.default_rng(0).uniform(-3.0, 3.0, (10, 5)):
        assert _off(quadratic, stand, t) < 1e-9
    # Without its bend it would not be.
    assert _off(quadratic, stand_for(quadratic, bend_share=0.0), np.full(5, 2.0)) > 0.1


def test_what_is_left_out_of_the_bend_is_the_least_there_is() -> None:
    """No other products of so many shapes come nearer (Eckart and Young)."""
    random = np.random.default_rng(1)
    count, rows = 14, 90
    sizes = np.geomspace(10.0, 1e-4, rows)
    shapes, _ = np.linalg.qr(random.standard_normal((rows, rows)))
    second = random.standard_normal((count, count, rows)) * sizes @ shapes.T
    weight = np.exp(random.standard_normal(rows))
    bend = bend_of(second / weight, weight)
    symmetric = 0.5 * (second + np.swapaxes(second, 0, 1))
    halves = np.where(bend.first == bend.second, 0.5, 1.0)[:, None]
    true = symmetric[bend.first, bend.second] * halves
    kept = np.asarray(bend.share @ bend.shape) * weight
    least = np.sqrt(np.sum(np.linalg.svd(true, compute_uv=False)[SHAPES:] ** 2))
    assert bend.shape.shape == (SHAPES, rows)
    assert np.linalg.norm(true - kept) == pytest.approx(least, rel=1e-6)
    assert least > 0.0


def test_the_error_of_a_cubic_model_is_of_third_order(bent: Toy) -> None:
    stand = stand_for(bent)
    direction = np.append(np.random.default_rng(2).standard_normal(3), [0.0, 0.0])
    far, near = (_off(bent, stand, size * direction) for size in (4.0, 2.0))
    assert far > 0.05
    assert far / near == pytest.approx(8.0, rel=0.25)


def test_points_and_coordinates_are_one_to_one(rough: Stand) -> None:
    ts = np.random.default_rng(3).standard_normal((50, 5)) * 2.0
    points = rough.surrogate.points(ts)
    np.testing.assert_allclose(rough.surrogate.coordinates(points), ts, atol=1e-9)
    np.testing.assert_array_equal(rough.surrogate.points(ts.reshape(5, 10, 5)), points.reshape(5, 10, 5))


def test_its_density_over_t_has_the_volume_of_its_points(bent: Toy) -> None:
    posterior, point = density_of(bent), mode_of(bent)
    rows, slopes = bent.rows(point[None, :-2])[0][0], bent.slopes(point[:-2])
    straight = linear_surrogate(posterior, LinearisationPoint(point, rows, slopes, None, 0.0))  # type: ignore[arg-type]

    def volume(t: np.ndarray) -> float:
        return float(np.linalg.slogdet(np.asarray(jax.jacfwd(straight.point)(jnp.asarray(t))))[1])

    ts = np.random.default_rng(4).standard_normal((5, 5))
    found = [volume(t) - volume(np.zeros(5)) for t in ts]
    assert np.max(np.abs(found)) > 1e-3
    np.testing.assert_allclose(straight.log_volumes(ts), found, atol=1e-9)
    for t, each in zip(ts, found, strict=True):
        assert float(straight(jnp.asarray(t)) - straight.of_point(jnp.asarray(t))) == pytest.approx(each)


def test_its_density_is_that_of_its_rows(rough: Stand, bent: Toy) -> None:
    surrogate, posterior = rough.surrogate, rough.posterior
    t = jnp.asarray([0.3, -1.0, 0.2, 0.5, 1.2])
    point = surrogate.points(np.asarray(t)[None])[0]
    assert float(surrogate.of_point(t)) == pytest.approx(
        posterior.density(np.asarray(surrogate.predicted(t)), point)
    )


def test_its_coordinates_may_be_those_of_its_draws(rough: Stand) -> None:
    ts = np.random.default_rng(6).standard_normal((200, 5)) * [0.5, 1.0, 2.0, 3.0, 1.5] + 0.3
    points = rough.surrogate.points(ts)
    about = rough.surrogate.with_draws(ts)
    found = about.coordinates(points)
    np.testing.assert_allclose(found.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(found.std(axis=0), 1.0, atol=1e-9)
    np.testing.assert_allclose(about.points(found), points, atol=1e-9)
    for old, new in zip(ts[:3], found[:3], strict=True):
        here, there = rough.surrogate.of_point(jnp.asarray(old)), about.of_point(jnp.asarray(new))
        assert float(here) == pytest.approx(float(there))
