"""NUTS corrected by the exact model draws from the exact density, whatever the surrogate and the kernel's memory."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from scipy import stats

from savgs_ident.inference.samplers.nuts import State, advance, nuts_transitions

from .hill import NormalHill, SkewHill, assert_reversible

CHAINS = 10_000
STEPS = 6

SHORT = 0.02
"""Step size [1] of trajectories that remember where they began: a proposal correlates with its start by about 0.6."""

Draw = Callable[[np.random.Generator, int], np.ndarray]


class Stand(eqx.Module):
    """A density over t as a surrogate: its points are the t themselves, and there is no prior beside it."""

    density: Callable[[Array], Array]
    centre: Array

    def __call__(self, t: Array) -> Array:
        return self.density(t)

    def prior(self, point: Array) -> Array:
        return 0.0 * point[0]

    def points(self, ts: np.ndarray) -> np.ndarray:
        return np.asarray(ts)

    def log_volumes(self, ts: np.ndarray) -> np.ndarray:
        return np.zeros(len(ts))


class Exact(NamedTuple):
    """A density over points as the exact model: it has no rows but is solved everywhere."""

    density: Callable[[Array], Array]

    def rows(self, us: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(us), 0)), np.ones(len(us), dtype=bool)

    def likelihood(self, rows: Array, point: Array) -> Array:
        return self.density(point)


class Case(NamedTuple):
    """A target with independent draws of it, and a surrogate that misjudges it."""

    target: Any
    draw: Draw
    surrogate: Stand


def _normal(centre: list[float], sd: list[float]) -> NormalHill:
    return NormalHill(jnp.asarray(centre), jnp.diag(1.0 / jnp.asarray(sd) ** 2))


def _unit(size: int) -> Draw:
    return lambda random, count: random.standard_normal((count, size))


CASES = {
    "1-d, 30 % too narrow": Case(
        _normal([0.0], [1.0]), _unit(1), Stand(_normal([0.0], [0.77]), jnp.zeros(1))
    ),
    "1-d, 30 % too wide, off": Case(
        _normal([0.0], [1.0]), _unit(1), Stand(_normal([0.4], [1.3]), jnp.zeros(1))
    ),
    "2-d, skewed": Case(
        SkewHill(2.0), SkewHill(2.0).draws, Stand(_normal([0.4, 0.4], [1.0, 1.3]), jnp.zeros(2))
    ),
}


def _started(case: Case, t: np.ndarray, step_size: float) -> State:
    """Chains that stand at ``t`` (C, n)."""
    count, size = t.shape
    exact, stand_in = (np.asarray(jax.vmap(each)(t)) for each in (case.target, case.surrogate))
    nothing = np.zeros((0, count))
    return State(
        points=np.zeros((0, count, size)),
        log_density=nothing,
        accepted=nothing.astype(bool),
        proposal_log_ratio=nothing,
        t=t,
        present=np.stack([exact, exact - stand_in]),
        step_size=np.array(step_size),
        divergences=np.array(0),
    )


def _advanced(case: Case, t: np.ndarray, step_size: float, steps: int) -> State:
    state = _started(case, t, step_size)
    for _ in range(steps):
        state, failed = advance(Exact(case.target), case.surrogate, 1, state)  # type: ignore[arg-type]
        assert failed == 0
    return state


def _off_in_standard_errors(one: np.ndarray, other: np.ndarray) -> float:
    """The greatest difference of mean, spread and third moment of two samples, of any of their coordinates."""
    found = []
    for shape in (lambda x: x, lambda x: x**2, lambda x: x**3):
        a, b = shape(one), shape(other)
        error = np.sqrt((a.var(axis=0) + b.var(axis=0)) / len(a))
        found.append(np.abs(a.mean(axis=0) - b.mean(axis=0)) / error)
    return float(np.max(found))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "step_size"),
    [
        *((name, 0.7) for name in CASES),
        ("1-d, 30 % too wide, off", SHORT),
        ("2-d, skewed", SHORT),
    ],
)
def test_draws_of_the_exact_density_stay_draws_of_it(name: str, step_size: float) -> None:
    case = CASES[name]
    start = case.draw(np.random.default_rng(2), CHAINS)
    state = _advanced(case, start, step_size, STEPS)
    fresh = case.draw(np.random.default_rng(3), CHAINS)
    assert _off_in_standard_errors(state.t, fresh) < 4.0
    assert stats.ks_2samp(state.t[:, 0], fresh[:, 0]).pvalue > 1e-3
    # Or the exact density would have nothing to correct.
    assert 0.3 < state.accepted.mean() < 0.95


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1-d, 30 % too wide, off", "2-d, skewed"])
def test_a_chain_reaches_the_exact_density_from_elsewhere(name: str) -> None:
    case = CASES[name]
    start = np.random.default_rng(2).normal(0.5, 0.3, (CHAINS, case.surrogate.centre.size))
    state = _advanced(case, start, 0.7, 5 * STEPS)
    assert _off_in_standard_errors(state.t, case.draw(np.random.default_rng(3), CHAINS)) < 4.0


@pytest.mark.slow
def test_proposals_that_go_on_from_rejected_ones_would_be_found_out() -> None:
    """The scheme of the first version, in which a proposal starts from the last proposal, taken or not."""
    case = CASES["1-d, 30 % too wide, off"]
    random = np.random.default_rng(2)
    state = proposal = case.draw(random, CHAINS)

    def log_ratio(t: np.ndarray) -> np.ndarray:
        return np.asarray(jax.vmap(lambda each: case.target(each) - case.surrogate(each))(t))

    proposals = [proposal]
    for step in range(2 * STEPS):
        key = jax.random.fold_in(jax.random.PRNGKey(4), step)
        proposal, _, _ = nuts_transitions(case.surrogate, key, proposal, np.array(SHORT), 3)  # type: ignore[arg-type]
        accepted = np.log(random.random(CHAINS)) < log_ratio(proposal) - log_ratio(state)
        state = np.where(accepted[:, None], proposal, state)
        proposals.append(proposal)
    assert 0.4 < np.corrcoef(proposals[-1][:, 0], proposals[-2][:, 0])[0, 1] < 0.8
    assert _off_in_standard_errors(state, case.draw(np.random.default_rng(3), CHAINS)) > 6.0
    assert abs(state.std() - 1.0) > 0.02


@pytest.mark.slow
def test_transitions_are_reversible_on_the_surrogate() -> None:
    hill = SkewHill(2.0)
    start = hill.draws(np.random.default_rng(3), CHAINS)
    stand = Stand(hill, jnp.zeros(2))
    end, value, diverged = nuts_transitions(stand, jax.random.PRNGKey(5), start, np.array(0.3), 3)  # type: ignore[arg-type]
    np.testing.assert_allclose(value, jax.vmap(hill)(end), rtol=1e-12)
    assert diverged == 0
    assert_reversible(start, end)
