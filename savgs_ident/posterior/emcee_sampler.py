"""emcee on the exact posterior, with proposals that walk on the surrogate.

emcee's own moves stretch between walkers, which in forty dimensions hardly gets anywhere: hundreds of steps
of eighty walkers for one independent draw. Here a proposal is a walk that leaves the surrogate as it is
(:mod:`savgs_ident.posterior.walk`) from where the walker stands; it is accepted by

    log pi(y) - log pi(x) - log pi*(y) + log pi*(x),

pi the exact posterior, pi* the surrogate (the surrogate transition of Liu, Monte Carlo Strategies in
Scientific Computing, 2001). The draws are those of the exact posterior however rough the surrogate is; how
rough shows in the acceptance.

The chain is kept in emcee's own HDF5 form with its random state, after every step, whole or not at all.
"""

from collections.abc import Generator

import emcee
import numpy as np
from emcee.backends import HDFBackend
from jaxtyping import Float

from savgs_ident.posterior.chains import Chains, unsettled
from savgs_ident.posterior.decide import decide
from savgs_ident.posterior.exact import ExactModel
from savgs_ident.posterior.keep import Keep
from savgs_ident.posterior.surrogate import Surrogate
from savgs_ident.posterior.walk import walk

WALKERS = 8

BURN_IN = 4
"""Steps left out at least: the walkers begin on the surrogate, a step or two from the posterior."""

_FIRST_WALK = 20
_STRIDE = 4


def sample_by_emcee(exact: ExactModel, surrogate: Surrogate, seed: int, keep: Keep) -> Generator[Chains]:
    """Chains that grow by a few steps at a time, from what ``keep`` holds if it holds something."""
    tally = _Tally(exact, surrogate, keep.counts)
    size = surrogate.centre.size
    with keep.scratch() as scratch:
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
                    keep.publish(scratch, tally.counts)
                    state = reached
            yield _chains(sampler, tally)


def _first_state(surrogate: Surrogate, seed: int) -> emcee.State:
    start, _, _ = walk(surrogate, seed, np.zeros((WALKERS, surrogate.centre.size)), _FIRST_WALK)
    points = surrogate.points(start)
    return emcee.State(points, random_state=np.random.RandomState(seed).get_state())


def _chains(sampler: emcee.EnsembleSampler, tally: "_Tally") -> Chains:
    points, log_density = sampler.get_chain(), sampler.get_log_prob()
    begin = max(BURN_IN, unsettled(log_density))
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
        """Where walks on the surrogate lead, and the surrogate's log density here less that there."""
        begin = self.surrogate.coordinates(points)
        end, before, after = walk(self.surrogate, int(random.randint(2**31)), begin)
        return self.surrogate.points(end), before - after
