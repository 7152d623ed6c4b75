"""Linearisation of the rig: exact at a state, and by describing functions in a steady motion on the cam.

At a state, the implicit residual r(q, qd, qdd, s, sd, input) = 0 is differentiated with respect to all its arguments
at once, and solved for the accelerations and the rates of the internal states:

    [dqdd; dsd] = -(dr/d[qdd, sd])^-1 (dr/dq dq + dr/dqd dqd + dr/ds ds + dr/dinput dinput).

    at = resting(model, p, link_angle=np.pi / 2)
    space = linearise(model, p, at)                 # python-control, named signals
    space["sprung_accel", "road_velocity"]

This holds for small departures. Where a friction sticks, the rig has its bristle as a spring.

In a steady motion, friction and damper act as linear elements that depend on the amplitude. The first harmonic of an
element's force over that of its velocity is a complex gain, the describing function

    N(f, A) = F_1 / V_1 = -(c + k / (i w)),

with a damping c [N s/m] and a stiffness k [N/m] that are valid at this frequency and amplitude. The rig with these in
place of the friction of its rail, its damper and the friction of its tyre is linear; a control design for the
amplitude of the test starts from it.

    solution = simulate_periodic(model, p, cam_excitation(frequency, 0.0275, np.pi / 2))
    described = describe(model, p, solution)
    described.damping, described.stiffness                  # (D, 3): rail, strut, tyre_lateral
    quasi_linear_response(model, p, described)              # complex (D, 2), per metre of road

The first harmonics of the nonlinear rig, at any amplitude of the cam, are :func:`first_harmonic`.
"""

from functools import partial
from typing import NamedTuple

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.small_root import Root
from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar, static_equilibrium
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    analyse,
    harmonics,
    simulate_periodic,
    solve_on_mesh,
)
from savgs_ident.simulate.sensitivity import loads_at_nodes
from savgs_ident.simulate.transient import solve_rates

INPUTS = ("road_velocity", "link_velocity")
"""[m/s], [rad/s]."""
OUTPUTS = (
    "sprung_accel", "susp_deflection", "tyre_deflection", "tyre_load", "link_torque", "link_angle",
)  # fmt: skip
"""[m/s^2], [m], [m], [N], torque of the strut on the link towards greater angles [N m], [rad]."""
_RIGID = ("sprung_position", "wishbone_angle", "sprung_velocity", "wishbone_velocity")


class OperatingPoint(NamedTuple):
    """A state: coordinates [m, rad], their rates, internal states (s,), road [m, m/s], link [rad, rad/s].

    ``root`` is how the state of rest was found.
    """

    q: Coordinates
    qd: Coordinates
    s: Float[Array, " s"]
    road: Road
    link: Link
    root: Root


def resting(model: QuarterCar, p: Values, link_angle: Float[Array, ""] | float) -> OperatingPoint:
    """The rig at rest with the link at an angle [rad]."""
    # As an array: a Python number would be compiled into the program, one for every angle.
    return _resting(model, p, jnp.asarray(link_angle, jnp.float64))


def nominal_rest(model: QuarterCar, p: Values) -> OperatingPoint:
    """The rig at rest with the link at its nominal angle."""
    return resting(model, p, p["psi_nominal"])


@eqx.filter_jit
def _resting(model: QuarterCar, p: Values, angle: Float[Array, ""]) -> OperatingPoint:
    zero = jnp.zeros_like(angle)
    rest = static_equilibrium(model, p, angle, zero)
    still, road, link = Coordinates(zero, zero), Road(zero, zero), Link(angle, zero)
    return OperatingPoint(rest.q, still, rest.s, road, link, rest.root)


class Slopes(NamedTuple):
    """Derivatives of the residual (2 + s,) and of the outputs (6,) along all of x = (q, qd, s), y = (qdd, sd), u.

    ``u`` are the heights, angles and velocities imposed: road height and velocity, link angle and velocity. ``root``
    are the accelerations and rates of internal states there.
    """

    residual_x: Array
    residual_y: Array
    residual_u: Array
    output_x: Array
    output_y: Array
    output_u: Array
    root: Root


def _outputs(model: QuarterCar, p: Values, motion: Motion, s: Array, sd: Array, inputs: Inputs) -> Array:
    loads = model.loads(p, motion, s, sd, inputs)
    rig = model.effective(p)
    travel = suspension_travel(rig, motion.q.theta_LW)
    return jnp.stack(
        [
            motion.qdd.z_s,
            travel,
            inputs.road.height - motion.q.z_s - travel,
            loads.vertical,
            loads.link_torque,
            inputs.link.angle,
        ]
    )


@eqx.filter_jit
def slopes(model: QuarterCar, p: Values, at: OperatingPoint) -> Slopes:
    """All derivatives at a state; look at the status of the root that its accelerations are."""
    count = len(model.states)
    rates = solve_rates(model, p, at.q, at.qd, at.s, Inputs(at.road, at.link))
    x = jnp.concatenate([jnp.stack([*at.q, *at.qd]), at.s])
    y = jnp.concatenate([jnp.stack([*rates.qdd]), rates.sd])
    u = jnp.stack([*at.road, *at.link])

    def everything(x: Array, y: Array, u: Array) -> Array:
        motion = Motion(Coordinates(x[0], x[1]), Coordinates(x[2], x[3]), Coordinates(y[0], y[1]))
        inputs = Inputs(Road(u[0], u[1]), Link(u[2], u[3]))
        residual = model.residual(p, motion, x[4:], y[2:], inputs)
        return jnp.concatenate([residual, _outputs(model, p, motion, x[4:], y[2:], inputs)])

    by_x, by_y, by_u = jax.jacfwd(everything, argnums=(0, 1, 2))(x, y, u)
    rows = 2 + count
    return Slopes(by_x[:rows], by_y[:rows], by_u[:rows], by_x[rows:], by_y[rows:], by_u[rows:], rates.root)


def linearise(model: QuarterCar, p: Values, at: OperatingPoint) -> control.StateSpace:
    """The rig near a state, with named signals: :data:`INPUTS`, :data:`OUTPUTS`.

    States are the coordinates and their rates, the internal states of the effects, the road's height [m] and the
    link's angle [rad]. Raises :class:`InputError` at a state outside the travel of the rig, where there is no
    linearisation.
    """
    found: Slopes = jax.tree.map(np.asarray, slopes(model, p, at))
    if not found.root.status().ok:
        raise InputError(
            "the rig cannot be linearised there: it finds no accelerations",
            remedy="choose a state within the travel of the suspension",
        )
    n = found.residual_x.shape[1]
    solve = partial(np.linalg.solve, -found.residual_y)
    y_x, y_u = solve(found.residual_x), solve(found.residual_u)
    # Heights and angles are integrals of the inputs, so they are states too.
    a, b = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
    a[0, 2] = a[1, 3] = 1.0
    a[2:n, :n], a[2:n, n:], b[2:n] = y_x, y_u[:, ::2], y_u[:, 1::2]
    b[n, 0] = b[n + 1, 1] = 1.0
    through = found.output_u + found.output_y @ y_u
    c = np.hstack([found.output_x + found.output_y @ y_x, through[:, ::2]])
    internal = [f"{place}_{state.name}" for place, state in enumerate(model.states)]
    return control.ss(
        a,
        b,
        c,
        through[:, 1::2],
        states=[*_RIGID, *internal, "road_height", "link_angle"],
        inputs=INPUTS,
        outputs=OUTPUTS,
        name="exact",
    )


ELEMENTS = ("rail", "strut", "tyre_lateral")
"""Ports of the elements: friction of the rail, damper, lateral friction of the tyre."""
QUASI_LINEAR_OUTPUTS = ("sprung_accel", "susp_deflection")
"""[m/s^2], [m]."""


class DescribingFunctions(NamedTuple):
    """Gains of the elements in D motions.

    Attributes:
        frequency: [Hz], (D,).
        gain: complex, (D, 3), force over velocity [N s/m], elements as in :data:`ELEMENTS`.
    """

    frequency: NDArray[np.float64]
    gain: NDArray[np.complex128]

    @property
    def damping(self) -> NDArray[np.float64]:
        """c [N s/m], (D, 3)."""
        return -self.gain.real

    @property
    def stiffness(self) -> NDArray[np.float64]:
        """k [N/m], (D, 3)."""
        return 2.0 * np.pi * self.frequency[:, None] * self.gain.imag


@eqx.filter_jit
def _first_harmonics(model: QuarterCar, p: Values, solution: PeriodicSolution) -> tuple[Array, Array]:
    loads = loads_at_nodes(model, p, solution)
    forces = jnp.stack([loads.rail, loads.ports["strut"].load, loads.lateral], axis=-1)
    velocities = jnp.stack([loads.ports[port].velocity for port in ELEMENTS], axis=-1)
    return analyse(forces, solution.mesh, 1)[:, :, 1], analyse(velocities, solution.mesh, 1)[:, :, 1]


def describe(model: QuarterCar, p: Values, solution: PeriodicSolution) -> DescribingFunctions:
    """The gains in converged periodic motions; zero where an element does not move."""
    force, velocity = (np.asarray(each) for each in _first_harmonics(model, p, solution))
    gain = np.divide(force, velocity, out=np.zeros_like(force), where=velocity != 0.0)
    return DescribingFunctions(np.asarray(solution.excitation.frequency), gain)


class _Bare(NamedTuple):
    """The rig without the elements, near rest: residual (2,), outputs (2,) and velocities of the elements (3,).

    Each along the coordinates, their rates, their accelerations, the road's height and velocity, and forces of the
    elements.
    """

    residual: tuple[Array, ...]
    output: tuple[Array, ...]
    velocity: Array


@eqx.filter_jit
def _bare_slopes(model: QuarterCar, p: Values, at: OperatingPoint) -> _Bare:
    bare = QuarterCar(model.damper)
    rig = model.effective(p)
    undamped = {**rig, "c_sd": jnp.zeros_like(rig["c_sd"])}
    zero = jnp.zeros(())

    def everything(q: Array, qd: Array, qdd: Array, road: Array, forces: Array) -> tuple[Array, Array, Array]:
        given = {"rail": forces[0], "strut": forces[1], "tyre_lateral": forces[2]}
        inputs = Inputs(Road(road[0], road[1]), Link(at.link.angle, zero), None, given)
        motion = Motion(Coordinates(q[0], q[1]), Coordinates(qd[0], qd[1]), Coordinates(qdd[0], qdd[1]))
        none = jnp.zeros(0)
        loads = bare.loads(undamped, motion, none, none, inputs)
        readings = jnp.stack(
            [rig["accel_gain"] * qdd[0], rig["deflection_gain"] * suspension_travel(rig, q[1])]
        )
        return (
            bare.residual(undamped, motion, none, none, inputs),
            readings,
            jnp.stack([loads.ports[port].velocity for port in ELEMENTS]),
        )

    still = jnp.zeros(2)
    found = jax.jacfwd(everything, argnums=(0, 1, 2, 3, 4))(
        jnp.stack([*at.q]), still, still, still, jnp.zeros(3)
    )
    return _Bare(found[0], found[1], found[2][1])


def _bare(model: QuarterCar, p: Values) -> _Bare:
    at = nominal_rest(QuarterCar(model.damper), model.effective(p))
    return jax.tree.map(np.asarray, _bare_slopes(model, p, at))


def quasi_linear_response(
    model: QuarterCar, p: Values, described: DescribingFunctions
) -> NDArray[np.complex128]:
    """:data:`QUASI_LINEAR_OUTPUTS` per metre of road [unit/m], (D, 2), of the rig with the described elements."""
    rig = _bare(model, p)
    position, velocity, acceleration, road, force = rig.residual
    rows = []
    for frequency, gain in zip(described.frequency, described.gain, strict=True):
        iw = 2j * np.pi * frequency
        # The residual is a sum of forces: an element's force enters with its gain times its velocity.
        elements = force @ (gain[:, None] * rig.velocity)
        dynamic = position + iw * (velocity + elements) + iw**2 * acceleration
        q = np.linalg.solve(dynamic, -(road[:, 0] + iw * road[:, 1]))
        rows.append((rig.output[0] + iw**2 * rig.output[2]) @ q)
    return np.array(rows)


def quasi_linear_space(
    model: QuarterCar, p: Values, damping: Float[np.ndarray, " 3"], stiffness: Float[np.ndarray, " 3"]
) -> control.StateSpace:
    """The rig near rest with dampings [N s/m] and stiffnesses [N/m] in place of its elements, as a state space.

    States are coordinates, their rates and the road's height [m]; the input is the road's velocity [m/s].
    """
    rig = _bare(model, p)
    position, velocity, acceleration, road, force = rig.residual
    stiff = position - force @ (stiffness[:, None] * rig.velocity)
    damped = velocity - force @ (damping[:, None] * rig.velocity)
    a, b = np.zeros((5, 5)), np.zeros((5, 1))
    a[0, 2] = a[1, 3] = b[4, 0] = 1.0
    a[2:4] = np.linalg.solve(-acceleration, np.hstack([stiff, damped, road[:, :1]]))
    b[2:4] = np.linalg.solve(-acceleration, road[:, 1:])
    shown = np.hstack([rig.output[0], rig.output[1], np.zeros((2, 1))])
    c, d = shown + rig.output[2] @ a[2:4], rig.output[2] @ b[2:4]
    states = ("sprung_position", "wishbone_angle", "sprung_velocity", "wishbone_velocity", "road_height")
    return control.ss(
        a,
        b,
        c,
        d,
        states=states,
        inputs=("road_velocity",),
        outputs=QUASI_LINEAR_OUTPUTS,
        name="quasi_linear",
    )


_CONTINUED_FROM = 1e-4
"""Peak to peak of the cam [m] from which smaller motions are continued: the static equilibrium may be millimetres off
the drawing's, which is far for a motion of micrometres."""
Complex = NDArray[np.complex128]


def motions_on_cam(
    model: QuarterCar, p: Values, frequency: NDArray[np.float64], peak_to_peak: float
) -> PeriodicSolution:
    """Periodic motions on a cam of height ``peak_to_peak`` [m] at frequencies [Hz], (D,).

    Raises :class:`InputError` where one did not converge.
    """
    nominal = float(p["psi_nominal"])
    size = max(peak_to_peak, _CONTINUED_FROM)
    solution = simulate_periodic(model, p, cam_excitation(frequency, size, nominal))
    if peak_to_peak < size:
        excitation = cam_excitation(frequency, peak_to_peak, nominal)
        start = _shrunk(solution, peak_to_peak / size)
        limit = PeriodicSettings.iterations
        solution = solve_on_mesh(model, p, excitation, solution.mesh, start, limit)
    lost = [f"{at:g}" for at, status in zip(frequency, solution.status(), strict=True) if not status.ok]
    if lost:
        raise InputError(
            f"the periodic motion was not found at {', '.join(lost)} Hz", remedy="check the rig's numbers"
        )
    return solution


def first_harmonic(model: QuarterCar, p: Values, solution: PeriodicSolution, peak_to_peak: float) -> Complex:
    """First harmonics of the channels per metre of road [unit/m], (D, 2), for a cam of ``peak_to_peak`` [m]."""
    found = harmonics(model, p, solution, 1)[:, :, 1] / (peak_to_peak / 2.0)
    return np.asarray(found, np.complex128)


def _shrunk(solution: PeriodicSolution, share: float) -> Trajectory:
    """The motions scaled by ``share`` about their means."""
    layout, weight = solution.mesh.layout, np.asarray(solution.mesh.weight)

    def shrunk(values: Array) -> Array:
        rows = np.asarray(values)
        total = np.add.reduceat(weight, layout.starts)
        means = np.add.reduceat(rows * weight, layout.starts, axis=1) / total
        mean = means[:, np.asarray(layout.dwell)]
        return jnp.asarray(mean + share * (rows - mean))

    return Trajectory(*(shrunk(part) for part in solution.trajectory))
