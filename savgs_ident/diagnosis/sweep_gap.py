"""The gap between models and a recorded sweep, which took no part in any fit.

A sweep is slow: at every instant the rig moves nearly
as in a dwell of the frequency of that instant. The first harmonic X of the periodic motions is a smooth function of
the angular frequency w, and

    X(w) - (i / 2) wd d^2 X / dw^2

is that of the sweep, to the next order of its rate wd: peaks come a little late. So a sweep is predicted without a
program of its own. Below the slowest dwell of the campaign nothing is compared.
"""

from collections.abc import Mapping, Sequence
from math import nan
from typing import cast

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from savgs_ident.diagnosis.dwell_problem import DwellProblem
from savgs_ident.diagnosis.gap import FurtherShrink
from savgs_ident.diagnosis.problem import ModelPoint
from savgs_ident.inference.background.imposed import harmonics_of_motion
from savgs_ident.plants.base import Excitation
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.simulate.excitation import only_driven
from savgs_ident.simulate.periodic import PeriodicSolution, layout_of, simulate_periodic

SWEEP_NAME = "recorded sweep, first harmonic"
"""What the gap of a sweep is called in reports."""

Signal = NDArray[np.float64]


def sweep_shrink(sweep: SweepResponse, points: Sequence[ModelPoint]) -> FurtherShrink | None:
    """The gap of a sweep before, recalibrated and after, by models of dwells; two if nothing is to come after.

    None where too few dwells of the campaign lie in the sweep's range. NaN for a model without motion.
    """
    problem = _of_dwells(points[0])
    fewest = problem.constants.sweep_dwells
    dwells = only_driven(problem.excitation, problem.dwells)
    frequencies = frequencies_of(np.asarray(dwells.frequency), sweep, fewest)
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
    place = np.argsort(np.argsort(np.asarray(dwells.frequency)))
    # What is named begins from the motion of the recalibrated baseline.
    known = [swept_motions(each, sweep, frequencies[place]) for each in points[:2]]
    gaps = []
    for point, near in zip(points, [*known, known[1]], strict=False):
        found = first_harmonic(point, near)
        rows = None if found is None else found[np.argsort(place)]
        swept = None if rows is None else along(frequencies, rows, sweep.frequency, sweep.sweep_rate)
        gaps.append(_sweep_gap(sweep, shown, problem.channels, swept))
    return FurtherShrink(
        SWEEP_NAME, gaps[0], gaps[1], gaps[2] if len(gaps) > 2 else nan, _sweep_floor(sweep, shown)
    )


def frequencies_of(dwells: Signal, sweep: SweepResponse, fewest: int) -> Signal | None:
    """As many frequencies [Hz] as there are dwells: those in the sweep's range, its end, and what lies between.

    Its end is left out where all dwells lie in its range: then it is compared up to the fastest of them.
    Frequencies are (D,). None where the ``fewest`` dwells do not lie in its range.
    """
    lowest, highest = float(sweep.frequency.min()), float(sweep.frequency.max())
    inside = np.unique(dwells[(dwells >= lowest) & (dwells < highest)])
    if inside.size < fewest:
        return None
    found = inside.tolist() if inside.size == dwells.size else [*inside.tolist(), highest]
    while len(found) < dwells.size:
        place = int(np.argmax(np.diff(found)))
        found.insert(place + 1, (found[place] + found[place + 1]) / 2.0)
    return np.array(found)


def swept_motions(point: ModelPoint, sweep: SweepResponse, frequencies: Signal) -> PeriodicSolution:
    """Motions of a baseline at frequencies [Hz], (D,), under the first input of a sweep alone, the others at rest.

    Where slow frequencies take the places of slow dwells, which have the nodes for it, and there are dwells alone, no
    program is compiled anew.
    """
    problem = _of_dwells(point)
    dwells = only_driven(problem.excitation, problem.dwells)
    first, *others = (each.name for each in problem.plant.inputs)
    swept = {name: np.zeros(each.shape, complex) for name, each in dwells.harmonics.items()}
    swept[first][:, 1] = float(np.median(sweep.input_amplitude))
    for name in others:
        swept[name][:, 0] = np.mean(np.asarray(dwells.harmonics[name])[:, 0])
    driven = {name: jnp.asarray(each) for name, each in swept.items()}
    model, p = problem.model(()), problem.values(point.values)
    there, layout = Excitation(jnp.asarray(frequencies), driven), layout_of(dwells, problem.settings, model)
    return simulate_periodic(model, p, there, problem.settings, layout)


def first_harmonic(point: ModelPoint, known: PeriodicSolution) -> NDArray[np.complex128] | None:
    """First harmonic per unit of the first input, (D, C), of a model under the excitation of ``known`` motions.

    These are a baseline's, from which its own are found, on nodes that follow them. None where one is not found.
    """
    problem = _of_dwells(point)
    model, p, near = problem.motions_with(point.terms, point.values, known)
    solution = problem.refined(point.terms, point.values, near)
    if not all(status.ok for status in solution.status()):
        return None
    amplitude = np.asarray(known.excitation.harmonics[problem.plant.inputs[0].name])[:, 1]
    found = np.asarray(harmonics_of_motion(model, p, solution, problem.orders))[:, :, 1]
    return np.asarray(found / amplitude[:, None], np.complex128)


def _of_dwells(point: ModelPoint) -> DwellProblem:
    """The problem of a model of dwells."""
    return cast(DwellProblem, point.problem)


def along(
    frequencies: Signal, steady: NDArray[np.complex128], frequency: Signal, rate: Signal
) -> NDArray[np.complex128]:
    """First harmonic (W, C) of a sweep that passes ``frequency`` [Hz] at ``rate`` [Hz/s], (W,).

    From ``steady`` ones, (D, C), at ``frequencies`` [Hz], (D,), increasing.
    """
    curve, omega = CubicSpline(2.0 * np.pi * frequencies, steady), 2.0 * np.pi * frequency
    late = 0.5j * 2.0 * np.pi * rate[:, None] * curve(omega, 2)
    return np.asarray(curve(omega) - late)


def _sweep_gap(
    sweep: SweepResponse,
    shown: Mapping[str, NDArray[np.bool_]],
    channels: tuple[str, ...],
    predicted: NDArray[np.complex128] | None,
) -> float:
    """Relative rms over the instants shown, all channels counting alike."""
    if predicted is None:
        return nan
    shares = []
    for name, rows in shown.items():
        seen = sweep.response[rows, sweep.channel(name)]
        miss = seen - predicted[rows, channels.index(name)]
        shares.append(np.sum(np.abs(miss) ** 2) / np.sum(np.abs(seen) ** 2))
    return float(np.sqrt(np.mean(shares)))


def _sweep_floor(sweep: SweepResponse, shown: Mapping[str, NDArray[np.bool_]]) -> float:
    """The same of the noise alone."""
    shares = []
    for name, rows in shown.items():
        place = sweep.channel(name)
        seen = np.sum(np.abs(sweep.response[rows, place]) ** 2)
        shares.append(2.0 * np.sum(sweep.response_sd[rows, place] ** 2) / seen)
    return float(np.sqrt(np.mean(shares)))
