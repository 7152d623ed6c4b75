"""In which regimes the recalibrated baseline fails: speed, stroke, load, direction, kind of test, time.

A regime is a part of what was recorded. Within the cycle it is a third of the instants of every test, by the speed,
the displacement or the load at a port, or the half in which the port moves in one direction; among tests it is a
third of them, by frequency, by the size of the response, or by what was recorded beside, as a temperature of the oil.
Regimes of which nine tenths coincide in a campaign cannot be distinguished by it and are one: where the port moves
like a sine, the instants of high speed are those of small stroke.

For a regime R of a residual waveform w (test d, channel c, instant i) the statistic is

    T = log mean_R(w^2 / s^2) - log mean_elsewhere(w^2 / s^2),      s^2 = noise + d^2 power of the response (d, c)

with the discrepancy d of the fit. Its p-value is the share of residuals drawn from the fitted error model that are as
concentrated; all p-values are corrected together by Holm's method. A drawn residual is

    r = y - J P^-1 J' S^-1 y,      y = e + J x,

e drawn with the noise scale and the discrepancy of the fit, x from the prior: what the parameters would take up is
taken out of a draw as it is out of the residual (J slopes, P precision of the fit, S spread of the rows).

Two things must not make the reference too wide. A discrepancy beyond what its prior allows for small errors is itself
a misfit: errors are drawn with no more than the prior's 95 % quantile. Errors that rows share, of the background, are
what a model may have, not what it must have, and have regimes of their own: a drift of the friction is greatest in
slow tests. So there are two references, with them and without, and the p-value is the larger one of both.

The last regimes are drifts: in every test the residual is projected on the slope in each identified parameter, and
the coefficients are regressed on the time at which the tests were recorded, and on what was recorded beside, as the
temperature of a damper's oil. It must be a trend, and more than errors of the background look like: the largest |t|
of the regressions is held against the draws without shared errors, the largest trend in standard deviations of the
rows against those with them. Drifts that the background tolerates are left out of both: what is tolerated is no
reason to call an effect missing, but it is where the model fails.

Source: Holm 1979, A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6(2).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.result import Regime
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.effects.base import PortKind
from savgs_ident.inference.laplace_fit import LaplaceFit
from savgs_ident.inference.observations import Data

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

DRAWS = 499
"""Residuals drawn for each reference: before their correction, p-values are multiples of 1/500."""

FLOOR_DRAWS = 200
"""Draws of the noise alone, for the floor of a gap."""

SEED = 11

INSTANTS = 64
"""Instants of a cycle: six to a period of the tenth order."""


@dataclass(frozen=True)
class Cycles:
    """The waveforms of D tests in C channels at I instants, and what distinguishes regimes.

    Attributes:
        waves: turns rows (S, m) [unit of the reading] into waveforms (S, D, C, I); zero where nothing is compared.
        velocity: at the port that is looked at, (D, I).
        displacement: there, (D, I).
        load: of the port that carries most, (D, I); None where none carries anything.
        beside: what else was recorded in each test of the data [its unit], (t,) by name.
        frequency: of the tests [Hz], (D,).
        recorded: when each test of the data was recorded, in any unit of time, (t,).
        places: of the D tests among those of the data, where they are some of them.
    """

    waves: Callable[[Array], Array]
    velocity: Array
    displacement: Array
    frequency: Array
    recorded: Array
    load: Array | None = field(default=None)
    beside: Mapping[str, Array] = field(default_factory=dict)
    places: NDArray[np.intp] | slice = field(default_factory=lambda: slice(None))

    @property
    def known_beside(self) -> dict[str, Array]:
        """What else was recorded in all tests."""
        return {name: values for name, values in self.beside.items() if np.all(np.isfinite(values))}


def find_regimes(
    cycles: Cycles,
    data: Data,
    fit: LaplaceFit,
    free: Sequence[str] = (),
    steady: Data | None = None,
    draws: int = DRAWS,
    constants: DecisionConstants = DEFAULTS,
) -> tuple[Regime, ...]:
    """The regimes of a campaign with the gap in each, the most significant first.

    ``fit`` is that of the recalibrated baseline to ``data``, ``free`` names the parameters that it identifies; where
    there are none, a drift is looked for in all of them. The time is that of ``cycles.recorded``. ``steady``
    are the data less the drifts that they tolerate, where they do.
    """
    missed = data.measured - fit.prediction.rows
    residual = (missed - data.explained_by_nuisances(missed))[None]
    drawn, noise = drawn_residuals(data, fit, draws, constants=constants), drawn_noise(data)
    waves = cycles.waves(np.concatenate([residual, *drawn]))
    floor = np.mean(cycles.waves(noise) ** 2, axis=(0, 3))
    named = _joined(dict(_masks(cycles, data)), constants.same_regime_share)
    names, masks = list(named), list(named.values())
    spread = _spread(cycles, data, fit, floor, constants)
    p_values = [max(_p_values(each, len(drawn))) for each in concentrations(waves, spread, masks)]
    gaps = [_gap(cycles, data, waves[0] ** 2, floor, mask) for mask in masks]
    without = drawn
    if steady is not None:
        without = drawn_residuals(data, fit, draws, source=steady, constants=constants)
    columns = [n for n, each in enumerate(fit.coordinates) if each.name in free or not free]
    rows = np.concatenate([residual, *without, noise])
    slopes = fit.slopes - data.explained_by_nuisances(fit.slopes)
    drifts = _drifts(cycles, constants.same_regime_share)
    for name, over in drifts.items() if data.tests >= constants.fewest_trend_tests else ():
        trend = _trend(data, fit, rows, slopes[:, columns], over)
        if trend is None:
            continue
        some = len(rows) - len(noise)
        names.append(name)
        p_values.append(
            max(_p_values(trend.size[:some], len(without))[0], _p_values(trend.t[:some], len(without))[-1])
        )
        gaps.append(_gap_of_trend(cycles, data, trend.rows[:1], trend.rows[some:]))
    found = zip(names, gaps, holm(np.array(p_values)), strict=True)
    return tuple(sorted((Regime(*each) for each in found), key=lambda each: each.p_value))


def drawn_residuals(
    data: Data,
    fit: LaplaceFit,
    draws: int,
    seed: int = SEED,
    source: Data | None = None,
    constants: DecisionConstants = DEFAULTS,
) -> tuple[Array, ...]:
    """Residuals (S, m) [unit of each row] of data drawn from the fitted error model, after a fit like ``fit``.

    With the errors that rows share, and without; the first alone where they share none. Errors are those of
    ``source`` where that is given, otherwise those of ``data``.
    """
    source = data if source is None else source
    random, noise = np.random.default_rng(seed), fit.noise_scales.noise
    discrepancy = _small_discrepancy(data, fit, constants)
    weighted = data.turned(fit.slopes) / fit.noise_scales.spread[:, None]
    slopes = fit.slopes - data.explained_by_nuisances(fit.slopes)
    shares = source.shared is not None or source.tolerated is not None
    found = []
    for each in (source, replace(source, shared=None, tolerated=None))[: 2 if shares else 1]:
        errors = np.stack([each.draw_errors(noise, discrepancy, random) for _ in range(draws)], axis=1)
        errors += fit.slopes @ random.standard_normal((fit.slopes.shape[1], draws))
        errors -= data.explained_by_nuisances(errors)
        taken_up = np.linalg.solve(fit.precision, weighted.T @ data.turned(errors))
        found.append(np.asarray((errors - slopes @ taken_up).T))
    return tuple(found)


def _small_discrepancy(data: Data, fit: LaplaceFit, constants: DecisionConstants) -> float:
    """The discrepancy [1] of the fit, as far as its prior has it for small errors."""
    return min(fit.noise_scales.discrepancy, constants.small_discrepancy * data.scales.discrepancy)


def drawn_noise(data: Data) -> Array:
    """The noise of the rows alone (S, m) [unit of each row], at the scale that was measured."""
    random = np.random.default_rng(SEED)
    noise = np.sqrt(data.variance) * random.standard_normal((FLOOR_DRAWS, data.variance.size))
    return noise - data.explained_by_nuisances(noise.T).T


def _spread(cycles: Cycles, data: Data, fit: LaplaceFit, floor: Array, constants: DecisionConstants) -> Array:
    """s^2 (D, C) [unit of the reading squared] of noise with a mean square of ``floor`` and a discrepancy."""
    power = np.var(cycles.waves(data.measured[None])[0], axis=2)
    discrepancy = _small_discrepancy(data, fit, constants)
    return np.asarray(fit.noise_scales.noise**2 * floor + discrepancy**2 * power)


def concentrations(waves: Array, spread: Array, regimes: Sequence[Mask]) -> Array:
    """T of waveforms (S, D, C, I) in each regime, masks (D, I), with s^2 (D, C), zero where nothing is; (R, S)."""
    present = spread > 0.0
    weights = np.divide(1.0, spread, out=np.zeros_like(spread), where=present)
    by_instant = np.einsum("sdci,dc->sdi", waves**2, weights).reshape(len(waves), -1)
    size = np.repeat(present.sum(axis=1).astype(float), waves.shape[3])
    inside = np.array([mask.ravel() for mask in regimes], float).reshape(len(regimes), size.size)
    within, beside = inside @ by_instant.T, (1.0 - inside) @ by_instant.T
    ratio = within / beside * ((1.0 - inside) @ size / np.maximum(inside @ size, 1.0))[:, None]
    return np.asarray(np.log(np.maximum(ratio, np.finfo(float).tiny)))


def holm(p_values: Array) -> tuple[float, ...]:
    """P-values (k,) corrected for all of them by Holm's method."""
    order = np.argsort(p_values)
    factors = p_values.size - np.arange(p_values.size)
    corrected = np.empty(p_values.size)
    corrected[order] = np.minimum(np.maximum.accumulate(factors * p_values[order]), 1.0)
    return tuple(float(each) for each in corrected)


def _p_values(statistic: Array, references: int) -> list[float]:
    """Shares of statistics that are at least the first of (S,), by reference; the first is among each."""
    beyond = (statistic[1:] >= statistic[0]).reshape(references, -1)
    return [float(each) for each in (1.0 + beyond.sum(axis=1)) / (1.0 + beyond.shape[1])]


def _masks(cycles: Cycles, data: Data) -> Iterator[tuple[str, Mask]]:
    """Regimes by name, (D, I)."""
    middle = cycles.displacement.mean(axis=1, keepdims=True)
    yield from _thirds("low speed", "high speed", np.abs(cycles.velocity))
    yield from _thirds("small stroke", "large stroke", np.abs(cycles.displacement - middle))
    if cycles.load is not None:
        yield from _thirds("low load", "high load", cycles.load)
    if np.any(cycles.velocity):
        yield "positive direction", cycles.velocity > 0.0
        yield "negative direction", cycles.velocity < 0.0
    waves = cycles.waves(data.measured[None])[0]
    size = waves.std(axis=2)
    largest = size.max(axis=0)
    relative = np.mean(size[:, largest > 0.0] / largest[largest > 0.0], axis=1)
    shape = cycles.velocity.shape
    for names, values in (
        (("slow tests", "fast tests"), cycles.frequency),
        (("small response", "large response"), relative),
        *(
            ((f"low {name}", f"high {name}"), values[cycles.places])
            for name, values in cycles.known_beside.items()
        ),
    ):
        for name, mask in _thirds(*names, values[None]):
            yield name, np.broadcast_to(mask.T, shape)


def _thirds(low: str, high: str, values: Array) -> Iterator[tuple[str, Mask]]:
    """The lowest and the highest third of values (D, n) in each row; none of fewer than three, or of equal ones."""
    count = values.shape[1]
    if count < 3 or not np.all(np.ptp(values, axis=1) > 1e-9 * np.abs(values).max(axis=1)):
        return
    rank = np.argsort(np.argsort(values, axis=1, kind="stable"), axis=1, kind="stable")
    yield low, rank < count // 3
    yield high, rank >= count - count // 3


def _joined(masks: Mapping[str, Mask], least: float) -> dict[str, Mask]:
    """The same with those as one, under both names, that have at least this share of their union in common."""
    found: list[tuple[list[str], Mask]] = []
    for name, mask in masks.items():
        for names, other in found:
            if np.sum(mask & other) >= least * np.sum(mask | other):
                names.append(name)
                break
        else:
            found.append(([name], mask))
    return {" or ".join(names): mask for names, mask in found}


def _gap(cycles: Cycles, data: Data, squares: Array, floor: Array, mask: Mask) -> float:
    """Relative rms [%] of a residual with ``squares`` (D, C, I) in a regime, beyond the noise's ``floor`` (D, C)."""
    counts = mask.sum(axis=1)[:, None]
    there = np.einsum("dci,di->dc", squares, mask.astype(float)) / np.maximum(counts, 1)
    return _percent(cycles, data, there - floor, np.broadcast_to(counts > 0, floor.shape))


def _percent(cycles: Cycles, data: Data, squares: Array, mask: Mask) -> float:
    """Mean ``squares`` (D, C) as a relative rms [%]; every test and channel in ``mask`` (D, C) counts alike."""
    power = np.var(cycles.waves(data.measured[None])[0], axis=2)
    counted = mask & (power > 0.0)
    if not np.any(counted):
        return 0.0
    return float(100.0 * np.sqrt(max(float(np.mean(squares[counted] / power[counted])), 0.0)))


class _Trend(NamedTuple):
    """The largest trend over time of residuals.

    Attributes:
        t: largest |t| of a regression [1], (S,).
        size: largest trend in standard deviations of independent rows [1], (S,).
        rows: the trend with the largest |t| [unit of each row], (S, m).
    """

    t: Array
    size: Array
    rows: Array


def _trend(data: Data, fit: LaplaceFit, rows: Array, slopes: Array, recorded: Array) -> _Trend | None:
    """Linear trends over time, or what was recorded beside, (t,), in residuals ``rows`` (S, m) [unit of each row].

    ``slopes`` (m, q) [unit of each row] are the directions whose coefficients are regressed. None where it is the
    same in all tests, or these see none of the directions.
    """
    if np.ptp(recorded) == 0.0:
        return None
    weighted = slopes / data.marginal(fit.noise_scales.noise, fit.noise_scales.discrepancy)[:, None]
    mine = [data.test == test for test in range(data.tests)]
    known = np.stack([np.sum(weighted[each] * slopes[each], axis=0) for each in mine])
    seen = np.all(known > 1e-12 * known.max(axis=0), axis=0) & (known.max(axis=0) > 0.0)
    if not np.any(seen):
        return None
    known, slopes, weighted = known[:, seen], slopes[:, seen], weighted[:, seen]
    coefficients = np.stack([rows[:, each] @ weighted[each] for each in mine], axis=1) / known
    late = recorded[:, None] - np.sum(known * recorded[:, None], axis=0) / known.sum(axis=0)
    about = coefficients - np.sum(known * coefficients, axis=1, keepdims=True) / known.sum(axis=0)
    spread = np.sum(known * late**2, axis=0)
    trend = np.sum(known * late * about, axis=1) / spread
    left = np.sum(known * (about - trend[:, None] * late) ** 2, axis=1) / (data.tests - 2)
    size = np.abs(trend) * np.sqrt(spread)
    t = size / np.sqrt(np.maximum(left, np.finfo(float).tiny))
    best = np.argmax(t, axis=1)
    steepest = np.take_along_axis(trend, best[:, None], axis=1)
    return _Trend(t.max(axis=1), size.max(axis=1), steepest * (late[data.test] * slopes).T[best])


def _gap_of_trend(cycles: Cycles, data: Data, trend: Array, noise: Array) -> float:
    """What a trend (1, m) changes [%], beyond what those in the ``noise`` (S, m) do on average."""
    found, floor = (np.mean(cycles.waves(rows) ** 2, axis=(0, 3)) for rows in (trend, noise))
    return _percent(cycles, data, found - floor, np.ones(floor.shape, bool))


def _drifts(cycles: Cycles, least: float) -> dict[str, Array]:
    """What a drift may be over, by name: the time, and what was recorded beside in all tests.

    Those that put the tests in nearly the same order, or in that of their frequencies, have one name.
    """
    found: list[tuple[list[str], Array]] = []
    for name, over in {"time": cycles.recorded, **cycles.known_beside}.items():
        for names, other in found:
            if _alike(over, other, least):
                names.append(name)
                break
        else:
            found.append(([name], over))
    for names, over in found:
        names += ["frequency"] if _alike(over[cycles.places], cycles.frequency, least) else []
    return {f"drift over {' or '.join(names)}": over for names, over in found}


def _alike(one: Array, other: Array, least: float) -> bool:
    """Whether the tests are in nearly the same order, or in the opposite one, by either."""
    if one.size != other.size or one.size < 3:
        return False
    both = np.stack([np.argsort(np.argsort(each)) for each in (one, other)])
    return abs(float(np.asarray(np.corrcoef(both))[0, 1])) >= least


def dwell_cycles(problem: "DwellProblem", fit: LaplaceFit) -> Cycles:
    """The cycles of dwells about the motion of ``fit``.

    Speed, stroke and direction are those at the plant's first force port; the load is that of the loaded port that
    carries most.
    """
    phase = 2.0 * np.pi * np.arange(INSTANTS) / INSTANTS
    turns = np.exp(1j * np.arange(problem.shape[2])[:, None] * phase)
    dwells = problem.dwells
    solution = fit.prediction.warm_start
    nodes, at = solution.mesh.layout.dwell, np.asarray(solution.mesh.phase)

    def over_cycle(signal: object) -> Array:
        values = np.asarray(signal, np.float64)
        tests = [nodes == test for test in dwells]
        return np.stack([np.interp(phase, at[each], values[each], period=2.0 * np.pi) for each in tests])

    seen = problem.port_signals(fit.values, solution)
    forces = [each for each in problem.plant.ports if each.kind is PortKind.FORCE]
    loads = [np.asarray(seen[each.name].load) for each in forces if each.loaded]
    motion = seen[forces[0].name]
    return Cycles(
        waves=lambda rows: np.real(problem.likelihood.harmonics(rows, problem.shape)[:, dwells] @ turns),
        velocity=over_cycle(motion.velocity),
        displacement=over_cycle(motion.displacement),
        load=over_cycle(max(loads, key=lambda each: float(np.abs(each).mean()))) if loads else None,
        frequency=np.asarray(problem.excitation.frequency)[dwells],
        recorded=problem.times,
        beside=problem.beside,
        places=dwells,
    )
