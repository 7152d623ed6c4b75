"""Motions and samples as an optimisation sees them: the unknowns, the rule between them, and the samples' misfit.

The unknowns stand in one long vector (:class:`Unknowns`),

    [ parameters (n) | point 0: x, y, m | point 1: x, y, m | ... | zeros of the sensors (D, C) ]

with x the states, y the algebraic variables (accelerations and rates of internal states), m what the sensors
read. Parameters stand as unconstrained coordinates, everything else in units of its typical size, so that all
unknowns are of the order of one.

The motions are periodic by the Radau IIA rule with two points a step, the model's residual holding at each point:

    x_i = x_0 + h sum_j a_ij xd_j,    a = ((5/12, -1/12), (3/4, 1/4)),    points at 1/3 and 1 of the step.

It is of third order, and stable however stiff the model: what a friction's bristle asks for. The steps are pairs of
those of an earlier solution on a :class:`savgs_ident.simulate.mesh.Mesh`, so that there are as many points as
that has nodes, dense where it is.

The samples of a dwell are held against the readings m (:class:`Misfit`). A sample at phase phi is predicted by
interpolation between points, linear in the values m there: W m + o, with o the unknown zero of the sensor. So the sum
of squares over all samples,

    |y - W m - o|^2 / sd^2,

is a quadratic form of (m, o): thousands of samples become a band matrix over the points, with nothing lost.
"""

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, hstack

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.inference.problem import Task
from savgs_ident.plants.at_rest import find_rest, nominal_inputs, standing
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.fundamental import group_by_clock, highest_fitted_order
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis
from savgs_ident.simulate.mesh import Mesh

PACE = 10.0
"""Typical rate of change of an internal state, in its typical sizes [1/s]."""


@dataclass(frozen=True)
class Unknowns:
    """Sizes and scales of the unknowns of a plant with q coordinates, s internal states and C channels.

    Attributes:
        parameters: n.
        points: P.
        dwells: D.
        coordinates: typical displacement, rate and acceleration of each coordinate [SI], (q, 3).
        internal: typical sizes of the internal states [SI], (s,).
        readings: of what the sensors read [SI], (C,).
        balances: of the terms in the equations of motion [SI], (q,).
    """

    parameters: int
    points: int
    dwells: int
    coordinates: tuple[tuple[float, float, float], ...]
    internal: tuple[float, ...]
    readings: tuple[float, ...]
    balances: tuple[float, ...]

    @property
    def states(self) -> int:
        """Entries of x."""
        return 2 * len(self.coordinates) + len(self.internal)

    @property
    def algebraic(self) -> int:
        """Entries of y."""
        return len(self.coordinates) + len(self.internal)

    @property
    def width(self) -> int:
        """Unknowns of a point."""
        return self.states + self.algebraic + len(self.readings)

    @property
    def size(self) -> int:
        """All unknowns."""
        return self.parameters + self.points * self.width + self.dwells * len(self.readings)

    @property
    def scale(self) -> NDArray[np.float64]:
        """Typical sizes of the unknowns of a point [SI], (width,)."""
        rates = tuple(PACE * size for size in self.internal)
        ways, velocities, accelerations = zip(*self.coordinates, strict=True)
        return np.array([*ways, *velocities, *self.internal, *accelerations, *rates, *self.readings])

    @property
    def residual_scale(self) -> NDArray[np.float64]:
        """Typical sizes of the equations of a point [SI], (rows,).

        The model's residual, then what the sensors read.
        """
        return np.array([*self.balances, *(PACE * size for size in self.internal), *self.readings])

    @property
    def at_points(self) -> NDArray[np.intp]:
        """Places of the unknowns of the points, (P, width)."""
        places = np.arange(self.points * self.width).reshape(self.points, self.width)
        return self.parameters + places

    @property
    def zeros(self) -> NDArray[np.intp]:
        """Places of the sensors' zeros, (D, C)."""
        count = self.dwells * len(self.readings)
        return np.arange(self.size - count, self.size).reshape(self.dwells, -1)


A = np.array([[5.0 / 12.0, -1.0 / 12.0], [3.0 / 4.0, 1.0 / 4.0]])
"""The rule's coefficients."""

C = np.array([1.0 / 3.0, 1.0])
"""Where in the step its points stand."""


class Points(NamedTuple):
    """Points of all dwells, two a step, flat in the mesh's layout.

    ``mesh`` has the points in place of its nodes; ``step`` [rad] is the length of each step and ``before`` the
    point at which it begins, both (P / 2,).
    """

    mesh: Mesh
    step: NDArray[np.float64]
    before: NDArray[np.intp]


def unknowns_of(task: Task, points: Points) -> Unknowns:
    """The unknowns of a task at its points.

    A reading is as large as the largest first harmonic that was measured, a balance as what the typical
    accelerations do in it.
    """
    plant, measured = task.problem.model, task.measured
    at, layout = plant.coordinates, points.mesh.layout
    readings = [
        float(np.max(np.abs(measured.harmonics[:, measured.channel(each.name), 1])))
        if each.name in measured.channels
        else 1.0
        for each in plant.channels
    ]
    return Unknowns(
        parameters=len(task.problem.free.names),
        points=layout.total,
        dwells=len(layout.counts),
        coordinates=tuple((each.size, each.rate_size, each.acceleration_size) for each in at),
        internal=tuple(float(state.scale) for state in plant.states),
        readings=tuple(readings),
        balances=tuple(_inertia_forces(plant, task.problem.fixed)),
    )


def _inertia_forces(plant: AbstractPlant, p: Values) -> NDArray[np.float64]:
    """What the coordinates' typical accelerations do in the equations of motion about rest [SI], (q,)."""
    u, q = nominal_inputs(plant, p), len(plant.coordinates)
    rest = find_rest(plant, p, u)
    motion = standing(plant, rest.q)

    def balance(acceleration: Array) -> Array:
        moving = motion._replace(qdd=plant.coordinate_type(*acceleration))
        return plant.residual(p, moving, rest.s, jnp.zeros_like(rest.s), u)[:q]

    inertia = np.abs(np.asarray(jax.jacfwd(balance)(jnp.zeros(q))))
    return np.asarray(inertia @ np.array([each.acceleration_size for each in plant.coordinates]))


def radau_points(mesh: Mesh) -> Points:
    """Points in the steps between every other node of ``mesh``."""
    layout = mesh.layout
    gap = np.asarray(mesh.gap).reshape(-1, 2)
    start, step = np.asarray(mesh.phase)[::2], gap.sum(axis=1)
    phase = (start[:, None] + step[:, None] * C).ravel()
    first = np.zeros(layout.total, bool)
    first[layout.starts] = True
    ends = np.arange(1, layout.total, 2)
    before = np.where(first[::2], layout.preceding[::2], ends - 2)
    gaps = _gaps(phase, layout.following)
    return Points(Mesh(layout, phase, gaps, gaps / (2.0 * np.pi)), step, before)


def _gaps(phase: NDArray[np.float64], following: NDArray[np.intp]) -> NDArray[np.float64]:
    return np.mod(phase[following] - phase, 2.0 * np.pi)


def step_rule(
    points: Points, seconds: NDArray[np.float64], states: NDArray[np.intp], rates: NDArray[np.intp]
) -> csr_array:
    """The rule as a matrix that vanishes on what keeps it: rows (P m,), columns the unknowns of all points.

    ``states`` and ``rates`` (P, m) are the columns of the m states and of their time derivatives at each point;
    ``seconds`` (P / 2,) is the length of each step [s].
    """
    total, width = states.shape
    row = np.arange(total * width).reshape(total, width)
    pair = np.arange(total).reshape(-1, 2)
    entries = [(row, states, np.ones_like(row, float))]
    begin = np.repeat(points.before, 2)
    entries.append((row, states[begin], -np.ones_like(row, float)))
    for i in range(2):
        for j in range(2):
            weight = -A[i, j] * seconds[:, None] * np.ones(width)
            entries.append((row[pair[:, i]], rates[pair[:, j]], weight))
    rows, columns, values = (
        np.concatenate([part.ravel() for part in each]) for each in zip(*entries, strict=True)
    )
    size = 1 + int(max(states.max(), rates.max()))
    return csr_array(coo_array((values, (rows, columns)), shape=(total * width, size)))


_POINTS = 4
"""Nodes that a sample is interpolated between: a cubic."""


class Samples(NamedTuple):
    """Samples of one channel of one dwell: ``phase`` [rad] of each, ``values`` [unit], both (N,); ``sd`` [unit]."""

    phase: NDArray[np.float64]
    values: NDArray[np.float64]
    sd: float


class Misfit(NamedTuple):
    """Half the weighted sum of squares, 1/2 v' H v - c' v + rest, of v = (values at the nodes, zero of the sensor).

    ``curvature`` H (n + 1, n + 1), ``slope`` c (n + 1,), of so many ``samples``. It has no dimension [1]: v
    is in the unit of the channel, c in one over it.
    """

    curvature: csr_array
    slope: NDArray[np.float64]
    rest: float
    samples: int


def find_recordings(campaign: Campaign, measured: HarmonicResponse) -> tuple[Recording, ...]:
    """The recordings behind the dwells of a response, in its order.

    Raises :class:`InputError` for a dwell that the campaign does not hold, or for channels whose clocks run at
    different rates: their stamps would have to be corrected first.
    """
    by_name = {recording.name: recording for recording in campaign.of_kind("dwell")}
    for test in measured.tests:
        if test not in by_name:
            raise InputError(
                "the response has a dwell that was not recorded",
                source=campaign.source,
                test=test,
                remedy="take response and samples from the same campaign",
            )
    for warning in measured.warnings:
        if warning.code == "clock_rate_differs":
            raise InputError(
                "the clocks of its channels run at different rates",
                source=campaign.source,
                channel=warning.channel,
                remedy="correct the time stamps, the cross-check takes them as they are",
            )
    return tuple(by_name[test] for test in measured.tests)


def samples_of(
    recording: Recording, driven: str, frequency: float, sd: dict[str, float]
) -> dict[str, Samples]:
    """Samples of the channels named in ``sd``, those that were recorded.

    ``frequency`` [Hz] is the dwell's measured fundamental, ``sd`` the noise of one sample by channel [unit].
    Phases count from where the fundamental of the input ``driven`` is at its highest, as those of the harmonics do.
    """
    imposed = recording.channels[driven]
    middle = 0.5 * float(imposed.time[0] + imposed.time[-1])
    groups = group_by_clock(recording, middle, {})
    lead = next(group for group in groups if driven in group.names)
    highest = highest_fitted_order(lead, frequency)
    height = lead.values[lead.names.index(driven)][None]
    fit = fit_periodic(plan_basis(lead.time, frequency, highest), height, highest, 0)
    ahead = float(np.angle(fit.amplitude[0, 1]))
    found = {}
    for group in groups:
        phase = np.mod(2.0 * np.pi * frequency * group.time + ahead, 2.0 * np.pi)
        for name, values in zip(group.names, group.values, strict=True):
            if name in sd:
                found[name] = Samples(phase, values, sd[name])
    return found


def interpolation(nodes: NDArray[np.float64], phase: NDArray[np.float64]) -> csr_array:
    """Weights (N, n) of periodic values at ``nodes`` (n,) [rad], growing, for their values at ``phase`` (N,)."""
    count = nodes.size
    first = np.searchsorted(nodes, phase, side="right") - _POINTS // 2
    near = first[:, None] + np.arange(_POINTS)
    turns, places = np.divmod(near, count)
    at = nodes[places] + 2.0 * np.pi * turns
    weights = np.ones_like(at)
    for i in range(_POINTS):
        for j in range(_POINTS):
            if j != i:
                weights[:, i] *= (phase - at[:, j]) / (at[:, i] - at[:, j])
    rows = np.repeat(np.arange(phase.size), _POINTS)
    return csr_array((weights.ravel(), (rows, places.ravel())), shape=(phase.size, count))


def misfit_of(samples: Samples, nodes: NDArray[np.float64]) -> Misfit:
    """The misfit of samples against values at ``nodes`` (n,) [rad]."""
    count = samples.values.size
    inner = interpolation(nodes, samples.phase)
    ones = csr_array(np.ones((count, 1)))
    design = hstack([inner, ones], format="csr") / samples.sd
    y = samples.values / samples.sd
    return Misfit(csr_array(design.T @ design), design.T @ y, 0.5 * float(y @ y), count)
