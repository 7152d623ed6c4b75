"""Linearisation of the rig: exact at a state, and by describing functions in a steady motion on the cam.

The exact one is that of any plant (:mod:`savgs_ident.simulate.linearisation`), with the names of the rig and the
outputs that a control design needs.

    at = resting(model, p, link_angle=np.pi / 2)
    space = linearise(model, p, at)                 # python-control, named signals
    space["sprung_accel", "road_velocity"]

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

from typing import NamedTuple

import control
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.plants.base import AbstractPlant, Motion, Output
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.linearisation import (
    LinearSignals,
    OperatingPoint,
    linearise_plant,
    nominal_rest,
    plant_signals,
    rest_under,
)
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    simulate_periodic,
    solve_on_mesh,
)
from savgs_ident.simulate.readings import analyse, harmonics
from savgs_ident.simulate.sensitivity import loads_at_nodes

RIG_STATES = (
    ("sprung_position", "m"),
    ("wishbone_angle", "rad"),
    ("sprung_velocity", "m/s"),
    ("wishbone_velocity", "rad/s"),
)
"""Names and units of the coordinates and their rates."""
RIG_OUTPUTS = (
    Output("sprung_accel", "m/s^2", "acceleration of the sprung mass"),
    Output("susp_deflection", "m", "suspension deflection"),
    Output("tyre_deflection", "m", "tyre deflection"),
    Output("tyre_load", "N", "vertical load of the tyre"),
    Output("link_torque", "N m", "torque of the strut on the link towards greater angles"),
    Output("link_angle", "rad", "angle of the link"),
)
"""The true signals, whatever sensors show of them."""


def resting(model: QuarterCar, p: Values, link_angle: Float[Array, ""] | float) -> OperatingPoint:
    """The rig at rest with the link at an angle [rad]."""
    return rest_under(model, p, (0.0, link_angle))


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


RIG_SIGNALS = LinearSignals(RIG_STATES, "", "the link at its nominal angle", RIG_OUTPUTS, _outputs)
"""The signals of the rig's linear models."""


def linear_signals(plant: AbstractPlant) -> LinearSignals:
    """The signals of a linear model: those of the rig, or those that another plant declares."""
    return RIG_SIGNALS if isinstance(plant, QuarterCar) else plant_signals(plant)


def linearise(model: QuarterCar, p: Values, at: OperatingPoint) -> control.StateSpace:
    """The rig near a state: :data:`RIG_STATES`, :data:`RIG_OUTPUTS`.

    Inputs are the velocities of the road [m/s] and of the link [rad/s]; the road's height [m] and the link's angle
    [rad] are states. Raises :class:`InputError` at a state outside the travel of the rig, where there is no
    linearisation.
    """
    return linearise_plant(model, p, at, RIG_SIGNALS).space


ELEMENTS = ("rail", "strut", "tyre_lateral")
"""Ports of the elements: friction of the rail, damper, lateral friction of the tyre."""


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
        inputs = Inputs(Road(road[0], road[1]), Link(at.signals[1].value, zero), None, given)
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
    """The channels per metre of road [unit/m], (D, 2), of the rig with the described elements."""
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
