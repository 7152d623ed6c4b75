"""Predicted repetitions hold what comes from the same law, and nothing that does not."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.inference.harmonic_question import predict
from savgs_ident.inference.samplers.chains import Chains

from .toy import Toy, straight_toy

DWELLS, REPETITIONS = 15, 20


@pytest.fixture(scope="module")
def toy() -> Toy:
    return straight_toy(dwells=DWELLS)


def _chains(random: np.random.Generator) -> Chains:
    """Draws about the truth, narrow beside the noise, with a discrepancy of a fiftieth."""
    points = 0.02 * random.standard_normal((200, 4, 5))
    points[:, :, 4] += 0.4
    nothing = np.zeros((200, 4))
    return Chains(points, nothing, nothing > -1.0, np.zeros(0), 0, 800, 0)


def _seeing(toy: Toy, rows: np.ndarray) -> Toy:
    likelihood = eqx.tree_at(lambda each: each.measured, toy.likelihood, jnp.asarray(rows))
    return replace(toy, likelihood=likelihood)


def _repetition(toy: Toy, random: np.random.Generator, point: np.ndarray) -> np.ndarray:
    """Rows of a campaign that comes from the model."""
    spread = np.asarray(toy.likelihood.spread(jnp.asarray(point)))
    return toy.rows(point[None, :-2])[0][0] + np.sqrt(spread) * random.standard_normal(spread.size)


def test_nineteen_of_twenty_repetitions_are_inside(toy: Toy) -> None:
    random = np.random.default_rng(1)
    inside, compared = 0, 0
    for seed in range(REPETITIONS):
        chains = _chains(random)
        seen = _seeing(toy, _repetition(toy, random, chains.points[0, 0]))
        found = predict(seen, chains, 400, seed)
        inside, compared = inside + found.count_inside[0], compared + found.count_inside[1]
    assert compared == REPETITIONS * DWELLS * 4
    # The standard error is that of the count and, about as large, that of quantiles of 400 draws.
    assert abs(inside / compared - 0.95) < 4.0 * np.sqrt(2.0 * 0.95 * 0.05 / compared)


def test_what_is_far_off_is_outside(toy: Toy) -> None:
    random = np.random.default_rng(2)
    chains = _chains(random)
    rows = _repetition(toy, random, chains.points[0, 0])
    spread = np.sqrt(np.asarray(toy.likelihood.spread(jnp.asarray(chains.points[0, 0]))))
    found = predict(_seeing(toy, rows + 8.0 * spread), chains, 400, 1)
    assert found.count_inside == (0, DWELLS * 4)


def test_repetitions_have_the_spread_of_the_likelihood(toy: Toy) -> None:
    chains = _chains(np.random.default_rng(3))
    # A draw that is repeated: only noise and discrepancy are left.
    same = chains._replace(points=np.tile(chains.points[:1, :1], (1000, 4, 1)))
    found = predict(toy, same, 4000, 1)
    assert len(found.model) == 4000
    np.testing.assert_array_equal(found.model, np.broadcast_to(found.model[0], found.model.shape))
    rows = np.asarray(jax.vmap(toy.likelihood.rows)(jnp.asarray(found.replicated[:2000])))
    off = rows - np.asarray(toy.likelihood.rows(jnp.asarray(found.model[0])))
    spread = np.asarray(toy.likelihood.spread(jnp.asarray(same.points[0, 0])))
    assert np.abs(off.var(axis=0) / spread - 1.0).max() < 4.5 * np.sqrt(2.0 / 2000)
    unused = ~found.used
    assert unused[:, :, 0].all()
    assert np.all(found.replicated[:, unused] == 0.0)
    assert not found.inside[unused].any()


def test_draws_without_a_solution_are_left_out(toy: Toy) -> None:
    chains = _chains(np.random.default_rng(4))
    half = replace(toy, edge=float(np.median(chains.points[:, :, 0])))
    found = predict(half, chains, 800, 1)
    kept = chains.points.reshape(-1, 5)[chains.points.reshape(-1, 5)[:, 0] <= half.edge]
    np.testing.assert_allclose(found.model, half.responses(kept[:, :-2]).harmonics, rtol=1e-12)
