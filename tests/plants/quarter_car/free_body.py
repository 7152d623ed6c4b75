"""The rig as four separate rigid bodies: an independent formulation to test the model against.

Every body has its own place and roll (y, z, phi) about its centre of gravity. Pins A, B, C, D join them and
the rail holds the sprung mass: poses come from Newton's method on the closure of the pins, velocities and
accelerations from its time derivatives, forces from Newton's and Euler's laws of each body with the pins'
forces unknown. Nothing is reduced to two coordinates, nothing is in closed form, nothing comes from the
package: only the numbers of the rig are shared.

Wrenches and motions of all bodies are stacked (12,): force or place (y, z) and moment or roll of S, L, U, K.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

BODIES = {"S": slice(0, 3), "L": slice(3, 6), "U": slice(6, 9), "K": slice(9, 12)}
PINS = (("A", "S", "L"), ("B", "S", "U"), ("C", "L", "K"), ("D", "U", "K"))

# Neither the height of the sprung mass's centre of gravity nor its inertia may matter: it does not roll.
SPRUNG_HEIGHT, SPRUNG_INERTIA = 1.1, 22.0

LATERAL, ROLL, LIFT, SWING = 8, 9, 10, 11
"""Rows of the closure after the eight of the pins: held by the rail (2), driven (2)."""


@dataclass(frozen=True)
class Drive:
    """What moves the rig: road height [m] and velocity [m/s], link angle [rad] and velocity [rad/s]."""

    road: float
    road_rate: float
    link: float
    link_rate: float


@dataclass(frozen=True)
class State:
    """Pose (12,), velocities (12,) of all bodies."""

    pose: Vector
    velocity: Vector


@dataclass(frozen=True)
class Answer:
    """What inverse dynamics finds.

    ``lift`` [N] and ``swing`` [N m] are the drives that the motion needs (the lift on the sprung mass, the
    torque between sprung mass and lower wishbone); ``lateral`` F_Ny [N] and ``roll`` M_Nx [N m] of the rail.
    """

    lift: float
    swing: float
    lateral: float
    roll: float


def _across(vector: Vector) -> Vector:
    return np.array([-vector[1], vector[0]])


class FreeBodies:
    """The rig taken apart, from its numbers in SI and its damper law (force [N] of compression [m/s])."""

    def __init__(self, values: Mapping[str, float], damper: Callable[[float], float]) -> None:
        self.v, self.damper = values, damper
        self.cg = {body: self._drawn(f"cg_{body}") for body in "LUK"}
        self.cg["S"] = np.array([0.0, SPRUNG_HEIGHT])
        self.start = np.concatenate([[*self.cg[body], 0.0] for body in BODIES])
        upright = values["m_u"] - values["m_L"] - values["m_U"]
        mass = {"S": values["m_s"], "L": values["m_L"], "U": values["m_U"], "K": upright}
        inertia = {"S": SPRUNG_INERTIA} | {body: values[f"J_{body}"] for body in "LUK"}
        self.mass = np.concatenate([[mass[body], mass[body], inertia[body]] for body in BODIES])

    def _drawn(self, name: str) -> Vector:
        return np.array([self.v[f"{name}_y"], self.v[f"{name}_z"]])

    def _arm(self, pose: Vector, body: str, drawn: Vector) -> Vector:
        """From the body's centre of gravity to a point of it, given where the point is drawn."""
        turn, vector = pose[BODIES[body]][2], drawn - self.cg[body]
        return np.cos(turn) * vector + np.sin(turn) * _across(vector)

    def place(self, pose: Vector, body: str, drawn: Vector) -> Vector:
        """Where a point of a body is [m]."""
        return pose[BODIES[body]][:2] + self._arm(pose, body, drawn)

    def _wrench(self, pose: Vector, body: str, place: Vector, force: Vector) -> Vector:
        """A force [N] at a place [m] on one body, as a wrench on all of them."""
        arm = place - pose[BODIES[body]][:2]
        out = np.zeros(12)
        out[BODIES[body]] = [*force, arm[0] * force[1] - arm[1] * force[0]]
        return out

    def closure(self, pose: Vector, z_s: float, theta: float) -> Vector:
        """By how much pins, rail and drives are violated (12,)."""
        gaps = [
            self.place(pose, one, self._drawn(pin)) - self.place(pose, two, self._drawn(pin))
            for pin, one, two in PINS
        ]
        carriages = self.place(pose, "S", np.array([0.0, self.v["z_tb"]]))
        held = [carriages[0], pose[2], carriages[1] - self.v["z_tb"] - z_s, pose[5] - pose[2] - theta]
        return np.concatenate([*gaps, held])

    def directions(self, pose: Vector) -> NDArray[np.float64]:
        """Derivative of the closure (12, 12); its columns transposed are the wrenches of unit reactions."""
        rows = np.zeros((12, 12))
        for i, (pin, one, two) in enumerate(PINS):
            for body, sign in ((one, 1.0), (two, -1.0)):
                arm = self._arm(pose, body, self._drawn(pin))
                rows[2 * i : 2 * i + 2, BODIES[body]] = sign * np.column_stack([np.eye(2), _across(arm)])
        arm = self._arm(pose, "S", np.array([0.0, self.v["z_tb"]]))
        rows[LATERAL, :3] = [1.0, 0.0, -arm[1]]
        rows[ROLL, 2] = 1.0
        rows[LIFT, :3] = [0.0, 1.0, arm[0]]
        rows[SWING, [5, 2]] = [1.0, -1.0]
        return rows

    def _centripetal(self, state: State) -> Vector:
        """What the accelerations must add up to in the closure because the bodies turn (12,)."""
        out = np.zeros(12)
        for i, (pin, one, two) in enumerate(PINS):
            for body, sign in ((one, 1.0), (two, -1.0)):
                turning = state.velocity[BODIES[body]][2] ** 2
                out[2 * i : 2 * i + 2] += sign * turning * self._arm(state.pose, body, self._drawn(pin))
        return out

    def state(self, z_s: float, theta: float, z_s_rate: float, theta_rate: float) -> State:
        """Pose by Newton's method, approached in small steps from the drawing, and velocities."""
        pose = self.start.copy()
        for share in np.linspace(0.0, 1.0, 2 + int(abs(theta) / 0.1))[1:]:
            for _ in range(30):
                gap = self.closure(pose, share * z_s, share * theta)
                if np.max(np.abs(gap)) < 1e-15:
                    break
                pose = pose - np.linalg.solve(self.directions(pose), gap)
        driven = np.zeros(12)
        driven[[LIFT, SWING]] = z_s_rate, theta_rate
        return State(pose, np.linalg.solve(self.directions(pose), driven))

    def acceleration(self, state: State, z_s: float, theta: float) -> Vector:
        """Accelerations (12,) of all bodies, given those of the driven coordinates."""
        driven = self._centripetal(state)
        driven[[LIFT, SWING]] = z_s, theta
        return np.linalg.solve(self.directions(state.pose), driven)

    def velocity_of(self, state: State, body: str, place: Vector) -> Vector:
        """Velocity [m/s] of the material point of a body at a place [m]."""
        motion = state.velocity[BODIES[body]]
        return motion[:2] + motion[2] * _across(place - state.pose[BODIES[body]][:2])

    def strut(self, state: State, drive: Drive) -> tuple[float, float, Vector]:
        """Length [m], its rate [m/s] and the wrench of the strut."""
        angle = self.v["theta_0"] + drive.link
        crank = self.v["l_SL"] * np.array([np.cos(angle), np.sin(angle)])
        pin = self.place(state.pose, "S", self._drawn("G") + crank)
        eye = self.place(state.pose, "L", self._drawn("E"))
        length = float(np.hypot(*(pin - eye)))
        along = (pin - eye) / length
        moving = self.velocity_of(state, "S", pin) + drive.link_rate * _across(crank)
        rate = float((moving - self.velocity_of(state, "L", eye)) @ along)
        force = self.v["k_sd"] * (self.v["l_free"] - length) + self.damper(-rate)
        wrench = self._wrench(state.pose, "S", pin, force * along)
        return length, rate, wrench + self._wrench(state.pose, "L", eye, -force * along)

    def contact(self, state: State, drive: Drive) -> tuple[Vector, float, float, float]:
        """Contact point [m], compression [m], its rate [m/s] and the wheel's tilt [rad]."""
        wheel = self.place(state.pose, "K", self._drawn("W"))
        tilt = state.pose[11] + self.v["tilt"]
        tiny = 1e-30j
        rise = self.velocity_of(state, "K", wheel)[1] - drive.road_rate
        reach = (wheel[1] - drive.road + tiny * rise) / np.cos(tilt + tiny * state.velocity[11])
        place = wheel + reach.real * np.array([np.sin(tilt), -np.cos(tilt)])
        return place, self.v["r_free"] - reach.real, -reach.imag / tiny.imag, tilt

    def tyre(self, state: State, drive: Drive, mu_t: float) -> tuple[float, float, Vector]:
        """Vertical load [N], friction of eq. (3) on the upright [N] and the wrench of both."""
        place, compression, rate, tilt = self.contact(state, drive)
        radial = max(self.v["k_t"] * compression + self.v["c_t"] * rate, 0.0) if compression > 0.0 else 0.0
        load = radial / np.cos(tilt)
        scrub = float(self.velocity_of(state, "K", place)[0])
        friction = -np.sign(scrub) * min(1.0, abs(scrub) / self.v["ydot_Hth"]) * mu_t * abs(load)
        return load, friction, self._wrench(state.pose, "K", place, np.array([friction, load]))

    def applied(self, state: State, drive: Drive, mu_t: float) -> Vector:
        """Weight, strut and tyre on all bodies (12,)."""
        weight = -self.mass * self.v["g"] * np.tile([0.0, 1.0, 0.0], 4)
        return weight + self.strut(state, drive)[2] + self.tyre(state, drive, mu_t)[2]

    def inverse(self, state: State, drive: Drive, z_s: float, theta: float, mu_t: float) -> Answer:
        """Reactions and drives that these accelerations of the driven coordinates need, body by body."""
        missing = self.mass * self.acceleration(state, z_s, theta) - self.applied(state, drive, mu_t)
        reaction = np.linalg.solve(self.directions(state.pose).T, missing)
        return Answer(*(float(reaction[row]) for row in (LIFT, SWING, LATERAL, ROLL)))

    def carriage_load(self, lateral: float, roll: float) -> float:
        """|N_t| + |N_b| [N] of two carriages half ``l_tb`` above and below their midpoint."""
        half = self.v["l_tb"] / 2.0
        top, bottom = np.linalg.solve([[1.0, 1.0], [-half, half]], [lateral, roll])
        return float(abs(top) + abs(bottom))

    def rail_friction(self, stretch: float, velocity: float, load: float) -> float:
        """Friction on the sprung mass [N] of a bristle stretched by ``stretch`` [m] at ``velocity`` [m/s]."""
        limit = self.v["mu_r"] * load
        return -min(max(self.v["k_pre"] * stretch + self.v["c_pre"] * velocity, -limit), limit)

    def forward(self, state: State, drive: Drive, mu_t: float, stretch: float | None) -> tuple[float, float]:
        """Free accelerations (z_s [m/s^2], theta_LW [rad/s^2]) by Lagrange multipliers of pins and rail.

        The rail's friction follows its own load, so it is iterated; ``stretch`` None leaves it out.
        """
        held = self.directions(state.pose)[:LIFT]
        matrix = np.block([[np.diag(self.mass), -held.T], [held, np.zeros((LIFT, LIFT))]])
        right = np.concatenate([self.applied(state, drive, mu_t), self._centripetal(state)[:LIFT]])
        friction = 0.0
        for _ in range(60):
            solution = np.linalg.solve(matrix, right + friction * np.eye(12 + LIFT)[1])
            if stretch is None:
                break
            load = self.carriage_load(solution[12 + LATERAL], solution[12 + ROLL])
            friction = self.rail_friction(stretch, float(state.velocity[1]), load)
        return float(solution[1]), float(solution[5] - solution[2])
