"""NUTS on the surrogate, decided on by the exact model.

Gradients of the exact model cost as much as forty responses; those of the surrogate cost next to nothing, and
its coordinates are round already (the Laplace approximation is the preconditioner). NUTS (blackjax) therefore
draws from the surrogate pi*, thinned until draws are as good as independent, and each draw y is taken or not,
from the state x before it, by the ratio of weights w = pi / pi* of an independence sampler,

    min(1, w(y) / w(x)).

The tail of the weights tells whether the surrogate covers the posterior: its Pareto index k is reported.
"""

from collections.abc import Generator
from pathlib import Path
from typing import Any, NamedTuple

import blackjax
import equinox as eqx
import h5py
import jax
import jax.numpy as jnp
import numpy as np
from blackjax.adaptation.step_size import dual_averaging_adaptation
from jaxtyping import Array, Float

from savgs_ident.posterior.chains import Chains, unsettled
from savgs_ident.posterior.decide import decide
from savgs_ident.posterior.exact import ExactModel
from savgs_ident.posterior.keep import Keep
from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.simulate.stored import placed, stored

CHAINS = 4

THINNING = 2
"""NUTS transitions from one proposal to the next."""

ACCEPTANCE = 0.8
"""Acceptance within a trajectory that the step size aims at."""

DOUBLINGS = 6
"""Most doublings of a trajectory: on a round density three or four are the rule."""

_STRIDE = 8
_ADAPTING = 200
_SETTLING = 15


class _State(NamedTuple):
    """Everything that a continued run needs: proposals, what became of them, where NUTS stands."""

    proposals: Float[np.ndarray, "S C n+2"]
    log_density: Float[np.ndarray, "S C"]
    log_ratio: Float[np.ndarray, "S C"]
    t: Float[np.ndarray, "C n+2"]
    step_size: Float[np.ndarray, ""]
    divergences: np.ndarray


def sample_by_nuts(exact: ExactModel, surrogate: Surrogate, seed: int, keep: Keep) -> Generator[Chains]:
    """Chains that grow by a few steps at a time, from what ``keep`` holds if it holds something."""
    key = jax.random.PRNGKey(seed)
    with keep.scratch() as scratch:
        state = _load(scratch) if scratch.exists() else _begin(surrogate, key)
        evaluations, unsolved = keep.counts
        while True:
            if state.proposals.shape[0]:
                yield _chains(state, seed, evaluations, unsolved)
            state, failed = _advance(
                exact, surrogate, jax.random.fold_in(key, 1 + len(state.proposals)), state
            )
            evaluations, unsolved = evaluations + _STRIDE * CHAINS, unsolved + failed
            _save(scratch, state)
            keep.publish(scratch, (evaluations, unsolved))


def _begin(surrogate: Surrogate, key: Array) -> _State:
    """The step size adapted, every chain settled on the surrogate."""
    size = surrogate.centre.size
    step_size = _adapted(*placed((surrogate, key)))[0]
    start = placed((surrogate, key, jnp.zeros((CHAINS, size)), step_size))
    _, t, _, _ = _drawn(*start, _SETTLING)
    nothing = np.zeros((0, CHAINS))
    empty = np.zeros((0, CHAINS, size))
    return _State(empty, nothing, nothing, np.asarray(t), np.asarray(step_size), np.array(0))


def _advance(exact: ExactModel, surrogate: Surrogate, key: Array, state: _State) -> tuple[_State, int]:
    begin = placed((surrogate, key, jnp.asarray(state.t), jnp.asarray(state.step_size)))
    draws, t, values, diverged = _drawn(*begin, _STRIDE)
    points = surrogate.points(np.asarray(draws))
    found = decide(exact, surrogate.prior, points.reshape(-1, points.shape[-1]))
    log_density = found.log_density.reshape(points.shape[:2])
    grown = _State(
        np.concatenate([state.proposals, points]),
        np.concatenate([state.log_density, log_density]),
        np.concatenate([state.log_ratio, log_density - np.asarray(values)]),
        np.asarray(t),
        state.step_size,
        state.divergences + int(diverged),
    )
    return grown, int(np.sum(~found.solved))


def _chains(state: _State, seed: int, evaluations: int, unsolved: int) -> Chains:
    """The independence sampler's pass over the proposals; the same every time."""
    steps, chains = state.log_ratio.shape
    uniform = np.random.default_rng(seed)
    taken, moved = np.zeros((steps, chains), dtype=int), np.ones((steps, chains), dtype=bool)
    for step in range(1, steps):
        before = state.log_ratio[taken[step - 1], np.arange(chains)]
        with np.errstate(invalid="ignore"):
            moved[step] = ~(np.log(uniform.random(chains)) >= state.log_ratio[step] - before)
        taken[step] = np.where(moved[step], step, taken[step - 1])
    chain = np.arange(chains)
    log_density = state.log_density[taken, chain]
    begin = unsettled(log_density)
    ratios = state.log_ratio[np.isfinite(state.log_ratio)]
    return Chains(
        state.proposals[taken, chain][begin:],
        log_density[begin:],
        moved[begin:],
        ratios,
        int(state.divergences),
        evaluations,
        unsolved,
    )


def _save(scratch: Path, state: _State) -> None:
    with h5py.File(scratch, "w") as file:
        for name, value in state._asdict().items():
            file[name] = value


def _load(scratch: Path) -> _State:
    with h5py.File(scratch, "r") as file:
        return _State(**{name: np.asarray(file[name]) for name in _State._fields})


@eqx.filter_jit
def _adapted(*args: Any) -> tuple[Array, ...]:
    return stored(_adapt, *args)


@eqx.filter_jit
def _drawn(*args: Any) -> tuple[Array, ...]:
    return stored(_draw, *args)


def _adapt(surrogate: Surrogate, key: Array) -> tuple[Array, ...]:
    """The step size by dual averaging, on one chain from the mode."""
    begin, update, final = dual_averaging_adaptation(ACCEPTANCE)
    kernel = blackjax.nuts.build_kernel()
    unit = jnp.ones_like(surrogate.centre)

    def step(carry: tuple[Any, Any], key: Array) -> tuple[tuple[Any, Any], None]:
        state, averaging = carry
        size = jnp.exp(averaging.log_step_size)
        state, info = kernel(key, state, surrogate, size, unit, DOUBLINGS)
        return (state, update(averaging, info.acceptance_rate)), None

    first = blackjax.nuts.init(jnp.zeros_like(unit), surrogate)
    carry, _ = jax.lax.scan(step, (first, begin(0.5)), jax.random.split(key, _ADAPTING))
    return (final(carry[1]),)


def _draw(surrogate: Surrogate, key: Array, start: Array, step_size: Array, count: int) -> tuple[Array, ...]:
    """``count`` thinned draws of each chain (count, C, n + 2), the last t, log densities, divergences."""
    kernel = blackjax.nuts.build_kernel()
    unit = jnp.ones_like(surrogate.centre)

    def transition(state: Any, key: Array) -> tuple[Any, Array]:
        state, info = kernel(key, state, surrogate, step_size, unit, DOUBLINGS)
        return state, info.is_divergent

    def thinned(state: Any, key: Array) -> tuple[Any, tuple[Array, Array, Array]]:
        state, diverged = jax.lax.scan(transition, state, jax.random.split(key, THINNING))
        return state, (state.position, state.logdensity, jnp.sum(diverged))

    def chain(t: Array, key: Array) -> tuple[Array, ...]:
        last, told = jax.lax.scan(thinned, blackjax.nuts.init(t, surrogate), jax.random.split(key, count))
        return last.position, *told

    last, draws, values, diverged = jax.vmap(chain)(start, jax.random.split(key, start.shape[0]))
    return jnp.swapaxes(draws, 0, 1), last, jnp.swapaxes(values, 0, 1), jnp.sum(diverged)
