"""NUTS on the surrogate, corrected by the exact model.

A gradient of the exact model costs as much as forty responses; one of the surrogate s costs next to nothing, and in
its coordinates t the posterior is nearly a unit normal (the Laplace approximation and draws of s are the
preconditioner). A step of a chain therefore is

1. from the chain's present state x, :data:`TRANSITIONS` transitions of NUTS (blackjax) on s, which lead to y;
2. the exact density pi at y, and y is accepted with probability min(1, w(y) / w(x)), w = pi / s; otherwise the chain
   stays at x, and the next step begins at x again.

This is the surrogate transition method (Liu, Monte Carlo Strategies in Scientific Computing, 2001, section 9.4.3). It
leaves pi invariant, however rough the surrogate and however short the trajectories, because the proposal's kernel K
is reversible with respect to s, s(x) K(x, y) = s(y) K(y, x): then the acceptance probability above is Metropolis's
own. One transition of NUTS is reversible: all states of a trajectory are equally likely to give rise to it, and the
state drawn from it satisfies detailed balance (multinomial draws within each half, min(1, W_new / W_old) between
halves). Any number of transitions by one and the same kernel is, too; hence the step size is adapted beforehand, and
then fixed. And a proposal must start from the state that the chain is in: to go on from the last *proposal* instead,
accepted or not, is right only where proposals are independent of where they start.

The tail of the weights w at the proposals, which are nearly draws of s, shows whether the surrogate covers the
posterior: its Pareto index k is reported.
"""

import importlib
from collections.abc import Generator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import equinox as eqx
import h5py
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from savgs_ident.inference.near_mode import ExactModel, Surrogate
from savgs_ident.inference.samplers.chains import Chains, Checkpoint, decide, steps_without_density
from savgs_ident.simulate.program_cache import placed, run_cached

CHAINS = 8
"""Chains: as many responses of the exact model are solved side by side."""

TRANSITIONS = 3
"""NUTS transitions from a state to its proposal: enough to forget where they began on a density that is round."""

ACCEPTANCE = 0.8
"""Acceptance within a trajectory that the step size aims at."""

DOUBLINGS = 6
"""Most doublings of a trajectory: on a round density three or four are the rule."""

BURN_IN = 4
"""Steps left out at least: the chains begin with draws of the surrogate, a step or two from the posterior."""

_STRIDE = 4
_ADAPTING = 200
_SETTLING = 15


class State(NamedTuple):
    """Where C chains stand after S steps, and how they came there: all that a continued run needs.

    Attributes:
        points: the states so far [1], (S, C, n + 2).
        log_density: their exact log densities, (S, C).
        accepted: whether each is a new one, (S, C).
        proposal_log_ratio: log w of the proposals, (S, C).
        t: the present states in the surrogate's coordinates [1], (C, n + 2).
        present: their exact log densities, and their log w, (2, C).
        step_size: of the trajectories [1].
        divergences: trajectories that diverged so far.
    """

    points: Float[np.ndarray, "S C n+2"]
    log_density: Float[np.ndarray, "S C"]
    accepted: Bool[np.ndarray, "S C"]
    proposal_log_ratio: Float[np.ndarray, "S C"]
    t: Float[np.ndarray, "C n+2"]
    present: Float[np.ndarray, "2 C"]
    step_size: Float[np.ndarray, ""]
    divergences: np.ndarray


def sample_by_nuts(
    exact: ExactModel, surrogate: Surrogate, seed: int, checkpoint: Checkpoint
) -> Generator[Chains]:
    """Chains that grow by a few steps at a time, from what ``checkpoint`` holds if it holds something."""
    with checkpoint.scratch() as scratch:
        evaluations, unsolved = checkpoint.counts
        if scratch.exists():
            state = load_state(scratch)
        else:
            state, failed = begin(exact, surrogate, seed)
            evaluations, unsolved = CHAINS, failed
        while True:
            for _ in range(_STRIDE):
                state, failed = advance(exact, surrogate, seed, state)
                evaluations, unsolved = evaluations + len(state.t), unsolved + failed
                save_state(scratch, state)
                checkpoint.publish(scratch, (evaluations, unsolved))
            yield _chains(state, evaluations, unsolved)


def begin(exact: ExactModel, surrogate: Surrogate, seed: int) -> tuple[State, int]:
    """Chains of no step that stand at draws of the surrogate, the step size adapted; how many are unsolved."""
    size, key = surrogate.centre.size, jax.random.PRNGKey(seed)
    step_size = np.asarray(_adapted(*placed((surrogate, key)))[0])
    t, log_surrogate, _ = nuts_transitions(surrogate, key, np.zeros((CHAINS, size)), step_size, _SETTLING)
    found = decide(exact, surrogate.prior, surrogate.points(t))
    nothing = np.zeros((0, CHAINS))
    state = State(
        points=np.zeros((0, CHAINS, size)),
        log_density=nothing,
        accepted=nothing.astype(bool),
        proposal_log_ratio=nothing,
        t=t,
        present=_with_log_ratio(surrogate, t, found.log_density, log_surrogate),
        step_size=step_size,
        divergences=np.array(0),
    )
    return state, int(np.sum(~found.solved))


def advance(exact: ExactModel, surrogate: Surrogate, seed: int, state: State) -> tuple[State, int]:
    """The state a step later, and how many proposals were not solved. ``seed`` and the step give all randomness."""
    step = 1 + len(state.points)
    key = jax.random.fold_in(jax.random.PRNGKey(seed), step)
    t, log_surrogate, diverged = nuts_transitions(surrogate, key, state.t, state.step_size, TRANSITIONS)
    found = decide(exact, surrogate.prior, surrogate.points(t))
    proposed = _with_log_ratio(surrogate, t, found.log_density, log_surrogate)
    uniform = np.random.default_rng((seed, step)).random(len(t))
    # A chain that stands where the model is not solved compares minus infinity with itself, and goes anywhere.
    with np.errstate(invalid="ignore"):
        accepted = ~(np.log(uniform) >= proposed[1] - state.present[1])
    t = np.where(accepted[:, None], t, state.t)
    present = np.where(accepted, proposed, state.present)
    later = State(
        points=np.concatenate([state.points, surrogate.points(t)[None]]),
        log_density=np.concatenate([state.log_density, present[:1]]),
        accepted=np.concatenate([state.accepted, accepted[None]]),
        proposal_log_ratio=np.concatenate([state.proposal_log_ratio, proposed[1:]]),
        t=t,
        present=present,
        step_size=state.step_size,
        divergences=state.divergences + diverged,
    )
    return later, int(np.sum(~found.solved))


def _with_log_ratio(
    surrogate: Surrogate,
    t: Float[np.ndarray, "C n+2"],
    log_density: Float[np.ndarray, " C"],
    log_surrogate: Float[np.ndarray, " C"],
) -> Float[np.ndarray, "2 C"]:
    """The log densities of points, and log w: both densities over t."""
    return np.stack([log_density, log_density + surrogate.log_volumes(t) - log_surrogate])


def nuts_transitions(
    surrogate: Surrogate,
    key: Array,
    start: Float[np.ndarray, "C n+2"],
    step_size: Float[np.ndarray, ""],
    count: int,
) -> tuple[Float[np.ndarray, "C n+2"], Float[np.ndarray, " C"], int]:
    """Where ``count`` transitions from ``start`` lead [1], the surrogate's log density there, and divergences."""
    args = placed((surrogate, key, jnp.asarray(start), jnp.asarray(step_size)))
    t, value, diverged = _transitions(*args, count)
    return np.asarray(t), np.asarray(value), int(diverged)


def save_state(file: Path, state: State) -> None:
    """Write a state as HDF5."""
    with h5py.File(file, "w") as opened:
        for name, value in state._asdict().items():
            opened[name] = value


def load_state(file: Path) -> State:
    """The state in a file that :func:`save_state` wrote."""
    with h5py.File(file, "r") as opened:
        return State(**{name: np.asarray(opened[name]) for name in State._fields})


def _chains(state: State, evaluations: int, unsolved: int) -> Chains:
    first = max(min(BURN_IN, len(state.points)), steps_without_density(state.log_density))
    ratios = state.proposal_log_ratio[np.isfinite(state.proposal_log_ratio)]
    return Chains(
        state.points[first:],
        state.log_density[first:],
        state.accepted[first:],
        ratios,
        int(state.divergences),
        evaluations,
        unsolved,
    )


def _blackjax() -> ModuleType:
    """blackjax, loaded where a program is traced and no sooner.

    It computes as it is loaded: with the rest of this module it would do so before the compiler is set up, which by
    then has read its flags. Loaded within a trace it would keep what is traced.
    """
    with jax.ensure_compile_time_eval():
        return importlib.import_module("blackjax")


@eqx.filter_jit
def _adapted(*args: Any) -> tuple[Array, ...]:
    return run_cached(_adapt, *args)


@eqx.filter_jit
def _transitions(*args: Any) -> tuple[Array, ...]:
    return run_cached(_transit, *args)


def _adapt(surrogate: Surrogate, key: Array) -> tuple[Array, ...]:
    """The step size by dual averaging, on one chain from the middle of the draws."""
    blackjax = _blackjax()
    start, update, final = blackjax.adaptation.step_size.dual_averaging_adaptation(ACCEPTANCE)
    kernel = blackjax.nuts.build_kernel()
    unit = jnp.ones_like(surrogate.centre)

    def step(carry: tuple[Any, Any], key: Array) -> tuple[tuple[Any, Any], None]:
        state, averaging = carry
        size = jnp.exp(averaging.log_step_size)
        state, info = kernel(key, state, surrogate, size, unit, DOUBLINGS)
        return (state, update(averaging, info.acceptance_rate)), None

    first = blackjax.nuts.init(jnp.zeros_like(unit), surrogate)
    carry, _ = jax.lax.scan(step, (first, start(0.5)), jax.random.split(key, _ADAPTING))
    return (final(carry[1]),)


def _transit(
    surrogate: Surrogate, key: Array, start: Array, step_size: Array, count: int
) -> tuple[Array, ...]:
    """Ends (C, n + 2) of ``count`` transitions of each chain, their log densities (C,), divergences in all."""
    blackjax = _blackjax()
    kernel = blackjax.nuts.build_kernel()

    def transition(state: Any, key: Array) -> tuple[Any, Array]:
        state, info = kernel(key, state, surrogate, step_size, jnp.ones_like(state.position), DOUBLINGS)
        return state, info.is_divergent

    def chain(t: Array, key: Array) -> tuple[Array, ...]:
        keys = jax.random.split(key, count)
        last, diverged = jax.lax.scan(transition, blackjax.nuts.init(t, surrogate), keys)
        return last.position, last.logdensity, jnp.sum(diverged)

    t, value, diverged = jax.vmap(chain)(start, jax.random.split(key, start.shape[0]))
    return t, value, jnp.sum(diverged)
