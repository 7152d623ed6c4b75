"""The recorded sweep, which nothing was fitted to: its first harmonic held against that of every model.

A sweep is slow: at every instant the rig moves nearly as in a dwell of the frequency of that instant. The first
harmonic X of the periodic motions is a smooth function of the angular frequency w, and

    X(w) - (i / 2) wd d^2 X / dw^2

is that of the sweep, to the next order of its rate wd: peaks come a little late. So a sweep is predicted without a
program of its own. Below the slowest dwell of the campaign nothing is compared.
"""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.result import FurtherShrink
from savgs_ident.plants.base import Excitation
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.simulate.periodic import harmonics, simulate_periodic

DWELLS = 6
"""Dwells of the campaign that must lie in the sweep's range: then the motions between them can be found, too."""

NAME = "recorded sweep, first harmonic"
"""What the gap of a sweep is called in reports."""

Signal = NDArray[np.float64]

ModelPoint = tuple[tuple[str, ...], Mapping[str, float]]
"""Terms of a model, and its values by name [SI]."""


def sweep_shrink(
    problem: DwellProblem, sweep: SweepResponse, hypotheses: Sequence[ModelPoint]
) -> FurtherShrink | None:
    """The gap of a sweep before, recalibrated and after, for three ``hypotheses``; two if nothing is to come after.

    None where too few dwells of the campaign lie in the sweep's range. NaN for a hypothesis without motion.
    """
    frequencies = frequencies_of(np.asarray(problem.excitation.frequency), sweep)
    if frequencies is None:
        return None
    inside = (sweep.frequency >= frequencies[0]) & (sweep.frequency <= frequencies[-1])
    shown = {
        name: inside & sweep.valid[:, sweep.channel(name)]
        for name in problem.channels
        if name in sweep.channels
    }
    shown = {name: rows for name, rows in shown.items() if rows.any()}
    if not shown:
        return None
    gaps = [
        _gap(sweep, shown, problem.channels, first_harmonic(problem, sweep, frequencies, *each))
        for each in hypotheses
    ]
    return FurtherShrink(NAME, gaps[0], gaps[1], gaps[2] if len(gaps) > 2 else np.nan, _floor(sweep, shown))


def frequencies_of(dwells: Signal, sweep: SweepResponse) -> Signal | None:
    """As many frequencies [Hz] as there are dwells: those in the sweep's range, its end, and what lies between.

    Its end is left out where all dwells lie in its range: then it is compared up to the fastest of them.
    Frequencies are (D,).
    """
    lowest, highest = float(sweep.frequency.min()), float(sweep.frequency.max())
    inside = np.unique(dwells[(dwells >= lowest) & (dwells < highest)])
    if inside.size < DWELLS:
        return None
    found = inside.tolist() if inside.size == dwells.size else [*inside.tolist(), highest]
    while len(found) < dwells.size:
        place = int(np.argmax(np.diff(found)))
        found.insert(place + 1, (found[place] + found[place + 1]) / 2.0)
    return np.array(found)


def first_harmonic(
    problem: DwellProblem,
    sweep: SweepResponse,
    frequencies: Signal,
    terms: tuple[str, ...],
    values: Mapping[str, float],
) -> NDArray[np.complex128] | None:
    """First harmonic per unit of the first input at the instants of a sweep, (W, C).

    It follows from motions at frequencies [Hz], (D,), under the first input alone, the others at rest. None where a
    motion is not found. Slow motions take the places of slow dwells, which have the nodes for it: no program is
    compiled anew.
    """
    dwells, amplitude = problem.excitation, float(np.median(sweep.road_amplitude))
    place = np.argsort(np.argsort(np.asarray(dwells.frequency)))
    first, *others = (each.name for each in problem.plant.inputs)
    swept = {name: np.zeros(each.shape, complex) for name, each in dwells.harmonics.items()}
    swept[first][:, 1] = amplitude
    for name in others:
        swept[name][:, 0] = np.mean(np.asarray(dwells.harmonics[name])[:, 0])
    there = Excitation(
        jnp.asarray(frequencies[place]), {name: jnp.asarray(each) for name, each in swept.items()}
    )
    model, p = problem.model(terms), problem.values(values)
    solution = simulate_periodic(model, p, there, problem.settings, problem.layout)
    if not all(status.ok for status in solution.status()):
        return None
    found = np.asarray(harmonics(model, p, solution, problem.orders), np.complex128)
    return along(frequencies, found[np.argsort(place), :, 1] / amplitude, sweep.frequency, sweep.sweep_rate)


def along(
    frequencies: Signal, steady: NDArray[np.complex128], frequency: Signal, rate: Signal
) -> NDArray[np.complex128]:
    """First harmonic (W, C) of a sweep that passes ``frequency`` [Hz] at ``rate`` [Hz/s], (W,).

    From ``steady`` ones, (D, C), at ``frequencies`` [Hz], (D,), increasing.
    """
    curve, omega = CubicSpline(2.0 * np.pi * frequencies, steady), 2.0 * np.pi * frequency
    late = 0.5j * 2.0 * np.pi * rate[:, None] * curve(omega, 2)
    return np.asarray(curve(omega) - late)


def _gap(
    sweep: SweepResponse,
    shown: Mapping[str, NDArray[np.bool_]],
    channels: tuple[str, ...],
    predicted: NDArray[np.complex128] | None,
) -> float:
    """Relative rms over the instants shown, all channels counting alike."""
    if predicted is None:
        return np.nan
    shares = []
    for name, rows in shown.items():
        seen = sweep.response[rows, sweep.channel(name)]
        miss = seen - predicted[rows, channels.index(name)]
        shares.append(np.sum(np.abs(miss) ** 2) / np.sum(np.abs(seen) ** 2))
    return float(np.sqrt(np.mean(shares)))


def _floor(sweep: SweepResponse, shown: Mapping[str, NDArray[np.bool_]]) -> float:
    """The same of the noise alone."""
    shares = []
    for name, rows in shown.items():
        place = sweep.channel(name)
        seen = np.sum(np.abs(sweep.response[rows, place]) ** 2)
        shares.append(2.0 * np.sum(sweep.response_sd[rows, place] ** 2) / seen)
    return float(np.sqrt(np.mean(shares)))
