"""The background: small errors that every model has, in every hypothesis, so that they are no gap.

No table of a damper is exact, no recorded road arrives without a phase error, no friction is the same at the end of a
campaign. Such errors are small, and many rows of the data share them; rows treated as independent would turn each
into tens of nats of evidence for something missing. So all hypotheses, *nothing is missing* among them, carry the
same random errors, each normal about zero:

    at a port     any sum of the functions that a law there may consist of
    at an input   amplitude and phase, in each test their own

Their sizes relative to each other are fixed here; their common size is the model's discrepancy d, estimated with each
hypothesis under a prior whose width is the material size (:class:`~savgs_ident.inference.observations.Data`). What is
missing is what stands out of them.

Beside them stand errors of known size, which calibration may take up. What the sheet knows as a curve, as the table
of a damper, has a tolerance at every point of it, and errs alike at points near each other; and what is identified, a
friction or a damping, may change while a campaign goes on and parts become warm.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.inference.background.constants import BACKGROUND, BackgroundConstants
from savgs_ident.inference.background.imposed import node_loads
from savgs_ident.inference.background.locations import Linearisation, input_locations
from savgs_ident.inference.background.port_functions import InputLocation, Matrix
from savgs_ident.inference.observations import Data
from savgs_ident.inference.prior import Scales

SINE = 400
"""Instants of half a sine at which power is summed up."""


def background_about(
    data: Data,
    about: Linearisation,
    drifts: Matrix,
    recorded: NDArray[np.float64],
    constants: BackgroundConstants = BACKGROUND,
) -> Data:
    """The data with errors at every location and input, of the dampers' curves, and drifts of what is identified.

    ``drifts`` (m, n) is what relative changes of one of what is identified do to the rows [unit of the row];
    ``recorded`` (t,) is when each test was recorded, in any unit of time.
    """
    read, order = about.read(), np.arange(about.orders + 1)
    return with_background(
        data,
        about.likelihood.channel,
        # What is free in every dwell is no part of it.
        input_locations(about, replace(constants, free_orders=0)),
        inputs=np.stack([about.rows(each) for each in (read, 1j * order * read)], axis=1),
        curves=_curves(about, constants),
        drifts=drifts,
        recorded=recorded,
        constants=constants,
    )


def _curves(about: Linearisation, constants: BackgroundConstants) -> Matrix:
    """What independent relative errors of one of the dampers' curves do to the rows, (m, points)."""
    seen, _ = node_loads(about.model, about.p, about.solution)
    fields = [
        (port.name, piece)
        for port in about.model.ports
        if port.damped_at is not None
        for piece in errors_of_curve(
            np.asarray(seen[port.name].velocity),
            np.asarray(seen[port.name].load),
            port.damped_at,
            constants,
        )
    ]
    return about.imposed(fields)


def with_background(
    data: Data,
    channel: NDArray[np.intp],
    locations: Sequence[InputLocation],
    inputs: Matrix,
    curves: Matrix,
    drifts: Matrix,
    recorded: NDArray[np.float64],
    constants: BackgroundConstants = BACKGROUND,
) -> Data:
    """The data with the errors that their rows share.

    ``channel`` (m,) is that of each row; ``locations`` say what laws there can do; ``inputs`` (m, i) is what the
    inputs' relative errors of one do to the rows [unit of the row], in all tests, ``curves`` (m, t) what relative
    errors of one do to them at points of curves of the sheet, ``drifts`` (m, n) what relative changes of one of what
    is identified do; ``recorded`` (t,) is when each test was recorded, in any unit of time.

    Raises :class:`InputError` where these are no numbers: the model is far off there.
    """
    columns = []
    for location in locations:
        functions = location.functions
        size = relative_change(data, channel, functions) * np.sqrt(functions.shape[1])
        columns.append(functions[:, size > 0.0] / size[size > 0.0])
    ratio = constants.input_error / constants.material_error
    tests = (data.test == test for test in range(data.tests))
    columns += [ratio * np.where(mine[:, None], inputs, 0.0) for mine in tests]
    times = time_of(recorded)[data.test, None]
    known = [constants.curve_tolerance * curves, constants.drift_tolerance * drifts * times]
    shared, tolerated = (np.concatenate(each, axis=1) for each in (columns, known))
    if not (np.isfinite(shared).all() and np.isfinite(tolerated).all()):
        raise InputError(
            "what small errors would do to the response of the model at these parameters is no number",
            remedy="look at the units of the recordings and at the numbers of the plant",
        )
    return replace(
        data,
        discrepancy_scale=constants.independent_error * data.discrepancy_scale,
        scales=Scales(discrepancy=constants.material_error),
        shared=shared,
        tolerated=tolerated,
    )


def without_drifts(data: Data, count: int) -> Data:
    """The data of :func:`with_background` less the tolerated drifts, ``count`` of them."""
    if data.tolerated is None:
        return data
    return replace(data, tolerated=data.tolerated[:, : data.tolerated.shape[1] - count])


def with_wider_drifts(data: Data, count: int, width: float) -> Data:
    """The data of :func:`with_background` with ``count`` drifts, ``width`` times as large as tolerated."""
    steady = without_drifts(data, count).tolerated
    if data.tolerated is None or steady is None:
        return data
    return replace(data, tolerated=np.concatenate([steady, width * drifts_of(data, count)], axis=1))


def drifts_of(data: Data, count: int) -> Matrix:
    """What the ``count`` drifts that the data tolerate do to the rows [unit of the row], (m, count)."""
    if data.tolerated is None:
        return np.zeros((data.measured.size, count))
    return data.tolerated[:, data.tolerated.shape[1] - count :]


def relative_change(data: Data, channel: NDArray[np.intp], columns: Matrix) -> NDArray[np.float64]:
    """How much each of the columns (m, q) changes the response [1], in the channel where it changes most; (q,)."""
    of_channel = np.equal.outer(np.arange(channel.max() + 1), channel).astype(float)
    squares, whole = of_channel @ columns**2, of_channel @ data.measured**2
    return np.asarray(np.sqrt(np.max(squares[whole > 0.0] / whole[whole > 0.0, None], axis=0)))


def errors_of_curve(
    velocity: NDArray[np.float64],
    force: NDArray[np.float64],
    reference: float,
    constants: BackgroundConstants = BACKGROUND,
) -> list[NDArray[np.float64]]:
    """What independent relative errors of one of a damper's curve do to its ``force`` (P,) along a motion.

    At each point of the curve they add up to an error of variance one, which is correlated with those of its
    neighbours to the same side by exp(-|ln(v_i / v_j)| / ln ``curve_alike``); less what they have in common, which is
    the damper's coefficient itself: a sine of amplitude ``reference`` of the velocity takes as much energy with the
    errors as without. Velocities and forces are in the units of their port, which the errors keep.
    """
    points = _points(constants)
    pieces = np.stack(pieces_of_curve(velocity, force, constants))
    distance = np.subtract.outer(*[np.log(np.where(points == 0.0, 1.0, np.abs(points)))] * 2)
    same_side = np.equal.outer(np.sign(points), np.sign(points))
    alike = np.where(same_side, np.exp(-np.abs(distance) / np.log(constants.curve_alike)), 0.0)
    errors = np.linalg.cholesky(alike)
    return list((errors - _energy_shares(velocity, force, reference, constants) @ errors).T @ pieces)


def _energy_shares(
    velocity: NDArray[np.float64],
    force: NDArray[np.float64],
    reference: float,
    constants: BackgroundConstants,
) -> NDArray[np.float64]:
    """The share of each point of a curve in the energy of a sine of the velocity [1], (points,).

    The curve is that of the ``force`` (P,) along a motion; beyond its largest velocity it stays as it is there.
    """
    order = np.argsort(velocity)
    sine = reference * np.sin(np.pi * ((np.arange(SINE) + 0.5) / SINE - 0.5))
    curve = np.interp(sine, velocity[order], force[order])
    scaled = sine / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    points = _points(constants)
    energy = np.array(
        [np.sum(np.interp(scaled, points, unit) * curve * sine) for unit in np.eye(points.size)]
    )
    whole = float(energy.sum())
    return energy / whole if whole else energy


def pieces_of_curve(
    velocity: NDArray[np.float64], force: NDArray[np.float64], constants: BackgroundConstants = BACKGROUND
) -> list[NDArray[np.float64]]:
    """What each point of a damper's curve contributes to its ``force`` (P,) along a motion; they sum up to it.

    Between points the errors are straight. Velocities and forces are in the units of their port, which they keep.
    """
    relative = velocity / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    points = _points(constants)
    return [np.interp(relative, points, unit) * force for unit in np.eye(points.size)]


def _points(constants: BackgroundConstants) -> NDArray[np.float64]:
    """Of a damper's curve, as shares of the largest velocity, rising."""
    beside = constants.curve_points
    return np.array([*(-share for share in reversed(beside)), 0.0, *beside])


def time_of(recorded: NDArray[np.float64]) -> NDArray[np.float64]:
    """When in the campaign each test was ``recorded`` [1], from -1 for the first to 1 for the last, (t,)."""
    first, last = float(recorded.min()), float(recorded.max())
    return 2.0 * (recorded - first) / (last - first) - 1.0 if last > first else np.zeros(recorded.size)
