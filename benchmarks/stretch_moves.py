"""How many evaluations emcee's own move needs for an independent draw.

An ensemble of twice as many walkers as there are dimensions stretches between its members, on the surrogate
of the posterior to second order: that costs next to nothing, and the move cannot distinguish it from the posterior.
The move does not care about affine maps either, so the coordinates are those in which the surrogate is given.
Walkers begin at independent draws; nothing is burnt. Each step of a walker is one evaluation of the
likelihood, and an independent draw takes as many as the autocorrelation time, in steps, says.
"""

from typing import NamedTuple

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from benchmarks.outcome import Progress
from benchmarks.posterior_problem import PosteriorProblem
from savgs_ident.core.free_vector import FreeVector
from savgs_ident.inference.near_mode import Surrogate

LONG_ENOUGH = 50.0
"""Autocorrelation times that a run must last, as emcee asks for."""

WINDOW = 5.0
"""Autocorrelation times over which correlations are summed."""

THINNING = 10
"""Steps from one that is looked at to the next."""

BLOCK = 500
"""Looked-at steps from one estimate to the next."""

SEED = 3


class Stretching(NamedTuple):
    """Longest autocorrelation time of the identified parameters, and how long the run was [steps]."""

    autocorrelation: float
    steps: int

    @property
    def trusted(self) -> bool:
        """Whether the run was long enough for more than a rough figure."""
        return self.steps >= LONG_ENOUGH * self.autocorrelation


def stretch(posed: PosteriorProblem, most_steps: int, progress: Progress) -> Stretching:
    """Run until the estimate is trusted, ``most_steps`` at most."""
    surrogate, free = posed.straight, posed.problem.free
    size = surrogate.centre.size
    sampler = emcee.EnsembleSampler(
        2 * size,
        size,
        lambda vs: np.asarray(_densities(surrogate, jnp.asarray(vs))),
        vectorize=True,
    )
    begin = surrogate.coordinates(posed.draw(2 * size, SEED))
    state = emcee.State(begin, random_state=np.random.RandomState(SEED).get_state())
    seen: list[np.ndarray] = []
    while True:
        walkers = []
        for reached in sampler.sample(state, iterations=BLOCK, thin_by=THINNING, store=False):
            # emcee moves its walkers in place.
            walkers.append(reached.coords.copy())
            state = reached
        seen.append(_identified(free, surrogate.points(np.stack(walkers))))
        found = Stretching(
            THINNING * autocorrelation_time(np.concatenate(seen)), THINNING * BLOCK * len(seen)
        )
        progress(f"stretch moves: {found.steps} steps, autocorrelation time {found.autocorrelation:.0f}")
        if found.trusted or found.steps >= most_steps:
            return found


def autocorrelation_time(values: Float[np.ndarray, "S W k"]) -> float:
    """The longest of k quantities [steps of ``values``], from W walkers that begin at independent draws.

    Correlations are summed over emcee's window, half the run at most. Other than in emcee all walkers share
    one mean and one variance: with those of its own, a walker that hardly moved would seem to have forgotten
    where it began.
    """
    count = values.shape[0]
    centred = values - values.mean(axis=(0, 1))
    spectrum = np.abs(np.fft.rfft(centred, n=2 * count, axis=0)) ** 2
    pairs = np.fft.irfft(spectrum.mean(axis=1), axis=0)[: count // 2]
    correlation = pairs * count / np.arange(count, count - len(pairs), -1)[:, None] / pairs[0]
    return max(_summed(each) for each in correlation.T)


def _summed(correlation: Float[np.ndarray, " n"]) -> float:
    """1 + 2 sum of the correlations at lags up to the first that is :data:`WINDOW` times as long as that."""
    times = 2.0 * np.cumsum(correlation) - 1.0
    beyond = np.flatnonzero(np.arange(times.size) >= WINDOW * times)
    return float(times[beyond[0]] if beyond.size else times[-1])


def _identified(free: FreeVector, points: Float[np.ndarray, "S W n+2"]) -> Float[np.ndarray, "S W k"]:
    """Values of the identified parameters [SI]."""
    values = _values(free, jnp.asarray(points.reshape(-1, points.shape[-1])[:, :-2]))
    columns = [np.asarray(values[name]).reshape(points.shape[:2]) for name in free.identified]
    return np.stack(columns, axis=-1)


@eqx.filter_jit
def _values(free: FreeVector, us: Float[Array, "w n"]) -> dict[str, Array]:
    return jax.vmap(free.to_constrained)(us)


@eqx.filter_jit
def _densities(surrogate: Surrogate, vs: Float[Array, "w n"]) -> Float[Array, " w"]:
    return jax.vmap(surrogate)(vs)
