"""Whether an effect can be seen at all: what calibration and tolerances can do, it must not be.

A spring that is 3 % stiffer than its sheet says, at a tolerance of 1.5 %, is no missing effect, and a tyre with
10 % more friction is identified anyway. What an effect changes is therefore held against the best that the
model without it can do:

    sigma^2 = min_x  |(change - moved(x)) / noise|^2 + |x|^2

with x the parameters that are identified or known to a tolerance, in units of what is known of them beforehand.
The search takes damped Gauss-Newton steps within bounds.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from savgs_ident.core.free_vector import known_to_tolerance
from savgs_ident.core.parameter import Parameter
from savgs_ident.diagnose.blind.bench import ORDERS, Bench
from savgs_ident.fit.problem import used_parameters
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import harmonic_sensitivities

STEPS = 12
"""Steps of the search at most."""

SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step that are tried."""

SETTLED = 0.95
"""The search ends where a whole step leaves more than this of the square."""

ENOUGH = 2.0
"""It ends as well below so many standard deviations: nobody could see that."""

Real = NDArray[np.float64]


class Hiding(NamedTuple):
    """What can hide an effect, to first order about a rig.

    Attributes:
        noise: standard deviations of the rows, (m,).
        names: parameters that are identified or known to a tolerance, n.
        columns: change of the rows in noise per unit of what is known of each, (m, n).
    """

    noise: Real
    names: tuple[str, ...]
    columns: Real


def rows_of(response: NDArray[np.complex128]) -> Real:
    """Real and imaginary parts of the orders from 1 on, (m,), of a response (..., K) [unit of the reading]."""
    kept = response[..., 1:]
    return np.stack([kept.real, kept.imag], axis=-1).ravel()


def noise_rows(bench: Bench) -> Real:
    """Standard deviation of every row, (m,): white noise of the sensors over the length of each dwell."""
    each = bench.sensors
    samples = [bench.programme.periods_at(f) / f * each.rate for f in bench.programme.dwells]
    spread = np.sqrt(2.0 / np.array(samples))[:, None] * np.array([each.accel, each.deflection])
    return np.repeat(spread.ravel(), 2 * ORDERS)


def moved(each: Parameter, value: float, x: float) -> float:
    """A parameter moved from ``value`` [its unit] by ``x`` of what is known of it beforehand, within its bounds.

    ``x`` is in standard deviations.
    """
    there = value + each.tolerance * x if each.tolerance > 0.0 else value * np.exp(x)
    return float(np.clip(there, each.lower, each.upper))


def hiding_at(
    bench: Bench, effects: Sequence[str], given: Mapping[str, float], solution: PeriodicSolution
) -> Hiding:
    """What can hide an effect of the rig with these effects and parameters [SI], whose motions are ``solution``."""
    model, p = bench.model(effects), bench.values(given)
    used = used_parameters(model, bench.table)
    known = [name for name in known_to_tolerance(bench.table, bench.free) if name in used]
    names = (*bench.free, *known)
    slopes = np.asarray(harmonic_sensitivities(model, p, solution, names, ORDERS))
    noise = noise_rows(bench)
    units = [float(p[name]) if name in bench.unknown else bench.table[name].tolerance for name in names]
    columns = [rows_of(slope) / noise * unit for slope, unit in zip(slopes, units, strict=True)]
    return Hiding(noise, names, np.stack(columns, axis=1))


def _step(columns: Real, miss: Real, x: Real, known: int, bounds: tuple[Real, Real] | None = None) -> Real:
    """The step of the search from ``x``; its first ``known`` entries have priors, it does not leave the bounds."""
    stacked = np.concatenate([columns, np.eye(known, x.size)])
    wanted = np.concatenate([miss, -x[:known]])
    lower, upper = (-np.inf, np.inf) if bounds is None else (bounds[0] - x, bounds[1] - x)
    step: Real = lsq_linear(stacked, wanted, (lower, upper), method="bvls").x
    return step


class Closest(NamedTuple):
    """How far a change stands out of the nearest that can be done, and the sizes (k,) of free columns there.

    ``sigma`` is in standard deviations, sizes are in units of the columns.
    """

    sigma: float
    sizes: Real


def closest(hiding: Hiding, change: Real, flat: Real) -> Closest:
    """The nearest to ``change`` (m,) to first order, with columns ``flat`` (m, k) that may have any size.

    ``change`` is in the units of the rows, ``flat`` in those of their noise.
    """
    columns, known = np.concatenate([hiding.columns, flat], axis=1), hiding.columns.shape[1]
    miss = change / hiding.noise
    x = _step(columns, miss, np.zeros(columns.shape[1]), known)
    sigma = float(np.sqrt(np.sum((miss - columns @ x) ** 2) + np.sum(x[:known] ** 2)))
    return Closest(sigma, x[known:])


def sigma_of(
    miss_at: Callable[[Real], Real | None],
    columns_at: Callable[[Real, Real], Real],
    start: Real,
    known: int,
    bounds: tuple[Real, Real],
) -> float:
    """How far a response stands out: the least sigma found from ``start`` (n,), with (m,) misses in noise.

    ``columns_at(x, miss)`` are minus the slopes of ``miss_at(x)``, (m, n); the first ``known`` entries of x have
    priors, and x stays between ``bounds``. Steps that make it worse, or lead where there is no motion, are shortened.
    """

    def square(x: Real, miss: Real | None) -> float:
        return np.inf if miss is None else float(miss @ miss + np.sum(x[:known] ** 2))

    x, miss = start, miss_at(start)
    best = square(x, miss)
    for _ in range(STEPS):
        if miss is None or best < ENOUGH**2:
            break
        step, before = _step(columns_at(x, miss), miss, x, known, bounds), best
        for share in SHARES:
            there = x + share * step
            found = miss_at(there)
            if square(there, found) < best:
                x, miss, best = there, found, square(there, found)
                break
        if best == before or (share == 1.0 and best > SETTLED * before):
            break
    return float(np.sqrt(best))
