"""emcee on the exact posterior, with proposals that are ends of chains on the surrogate.

emcee's own moves stretch between walkers, which in forty dimensions hardly gets anywhere: hundreds of steps of
eighty walkers for one independent draw. Here a proposal y is where preconditioned Crank-Nicolson steps on the
surrogate s lead from a walker's state x; it is accepted with probability min(1, w(y) / w(x)), w = pi / s and pi the
exact posterior: the surrogate transition of Liu (Monte Carlo Strategies in Scientific Computing, 2001). The draws
are those of the exact posterior however rough the surrogate is; how rough shows in the acceptance.

A step t' = sqrt(1 - b^2) t + b xi is reversible with respect to the unit normal; accepted by the ratio of the
surrogate to that normal it is reversible with respect to the surrogate. The length b of every step is drawn anew:
all steps are then the same kernel, and any number of them one after the other is reversible too. (Lengths in a
fixed order would not be: backwards is another order.)

The chain is kept in emcee's own HDF5 form with its random state, after every step, whole or not at all.
"""

from collections.abc import Generator
from typing import Any

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from emcee.backends import HDFBackend
from jaxtyping import Array, Float

from savgs_ident.inference.near_mode import ExactModel, Surrogate
from savgs_ident.inference.samplers.chains import Chains, Checkpoint, decide, steps_without_density
from savgs_ident.simulate.program_cache import placed, run_cached

STEPS = 120
"""Steps to one proposal: enough to forget where it began."""

DRAWS = 128
"""Chains on the surrogate that say where it lies and how wide it is."""

_ROUNDS = 3

LENGTHS = (0.2, 0.5, 0.8)
"""The b of steps, drawn at random: long ones travel, short ones get through where the surrogate is not normal."""


def about_draws(surrogate: Surrogate, seed: int) -> Surrogate:
    """The surrogate in coordinates in which it is about as wide as the normal of the steps.

    Its curvature in one point says that of a skew density only in part, and steps hardly get anywhere along an axis
    along which it is twice as wide.
    """
    drawn, _, _ = pcn_steps(surrogate, seed, np.zeros((DRAWS, surrogate.centre.size)), _ROUNDS)
    return surrogate.with_draws(drawn)


def pcn_steps(
    surrogate: Surrogate, seed: int, start: Float[np.ndarray, "W n+2"], rounds: int = 1
) -> tuple[Float[np.ndarray, "W n+2"], Float[np.ndarray, " W"], Float[np.ndarray, " W"]]:
    """Chains of ``rounds`` times :data:`STEPS` steps from ``start`` (W, n + 2) in t.

    Gives their last draws, and the surrogate's log density at the start and there, (W,).
    """
    key = jax.random.PRNGKey(seed)
    args = placed((surrogate, key, jnp.asarray(start), jnp.asarray(rounds * STEPS)))
    end, before, after = _compiled_steps(*args)
    return np.asarray(end), np.asarray(before), np.asarray(after)


@eqx.filter_jit
def _compiled_steps(*args: Any) -> tuple[Array, ...]:
    return run_cached(_pcn_steps, *args)


def _pcn_steps(surrogate: Surrogate, key: Array, start: Array, steps: Array) -> tuple[Array, ...]:
    density = jax.vmap(surrogate)

    def step(count: Array, at: tuple[Array, Array]) -> tuple[Array, Array]:
        t, value = at
        to_choose, to_move, to_decide = jax.random.split(jax.random.fold_in(key, count), 3)
        length = jax.random.choice(to_choose, jnp.asarray(LENGTHS), (value.size, 1))
        moved = jnp.sqrt(1.0 - length**2) * t + length * jax.random.normal(to_move, t.shape)
        there = density(moved)
        ratio = there - value + 0.5 * (jnp.sum(moved**2, axis=1) - jnp.sum(t**2, axis=1))
        taken = jnp.log(jax.random.uniform(to_decide, value.shape)) < ratio
        return jnp.where(taken[:, None], moved, t), jnp.where(taken, there, value)

    begin = density(start)
    end, value = jax.lax.fori_loop(0, steps, step, (start, begin))
    return end, begin, value


WALKERS = 8

BURN_IN = 4
"""Steps left out at least: the walkers begin on the surrogate, a step or two from the posterior."""

_FIRST_ROUNDS = 5
_STRIDE = 4


def sample_by_emcee(
    exact: ExactModel, surrogate: Surrogate, seed: int, checkpoint: Checkpoint
) -> Generator[Chains]:
    """Chains that grow by a few steps at a time, from what ``checkpoint`` holds if it holds something."""
    tally = _Tally(exact, surrogate, checkpoint.counts)
    size = surrogate.centre.size
    with checkpoint.scratch() as scratch:
        backend = HDFBackend(str(scratch), name="mcmc")
        move = emcee.moves.MHMove(tally.propose, size)
        sampler = emcee.EnsembleSampler(
            WALKERS, size, tally.log_density, moves=move, backend=backend, vectorize=True
        )
        # Without emcee's wrapping, which prints all that is raised, Ctrl-C among it, to standard output.
        sampler.log_prob_fn = tally.log_density
        state = sampler.get_last_sample() if backend.iteration else _first_state(surrogate, seed)
        while True:
            # A walker that began where the model is not solved compares minus infinity with itself.
            with np.errstate(invalid="ignore"):
                # The walkers move each by itself: that there are fewer than dimensions does not matter to them.
                for reached in sampler.sample(state, iterations=_STRIDE, skip_initial_state_check=True):
                    checkpoint.publish(scratch, tally.counts)
                    state = reached
            yield _chains(sampler, tally)


def _first_state(surrogate: Surrogate, seed: int) -> emcee.State:
    start, _, _ = pcn_steps(surrogate, seed, np.zeros((WALKERS, surrogate.centre.size)), _FIRST_ROUNDS)
    points = surrogate.points(start)
    return emcee.State(points, random_state=np.random.RandomState(seed).get_state())


def _chains(sampler: emcee.EnsembleSampler, tally: "_Tally") -> Chains:
    points, log_density = sampler.get_chain(), sampler.get_log_prob()
    begin = max(BURN_IN, steps_without_density(log_density))
    moved = np.any(np.diff(points[begin - 1 :], axis=0) != 0.0, axis=2)
    evaluations, unsolved = tally.counts
    return Chains(points[begin:], log_density[begin:], moved, np.zeros(0), 0, evaluations, unsolved)


class _Tally:
    """The functions that emcee calls, and how often the exact model was asked and was not solved."""

    def __init__(self, exact: ExactModel, surrogate: Surrogate, counts: tuple[int, int]) -> None:
        self.exact, self.surrogate, self.counts = exact, surrogate, counts

    def log_density(self, points: Float[np.ndarray, "W n+2"]) -> Float[np.ndarray, " W"]:
        """The exact log density of the walkers' proposals."""
        found = decide(self.exact, self.surrogate.prior, points)
        self.counts = (self.counts[0] + len(points), self.counts[1] + int(np.sum(~found.solved)))
        return found.log_density

    def propose(
        self, points: Float[np.ndarray, "W n+2"], random: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "W n+2"], Float[np.ndarray, " W"]]:
        """The last draws of chains on the surrogate, and the surrogate's log density here less that there."""
        begin = self.surrogate.coordinates(points)
        end, before, after = pcn_steps(self.surrogate, int(random.randint(2**31)), begin)
        # The walkers are points: of the densities over t their volumes are taken.
        volume = self.surrogate.log_volumes(begin) - self.surrogate.log_volumes(end)
        return self.surrogate.points(end), before - after - volume
