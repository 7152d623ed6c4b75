"""The drive of the single link: motor, 40:1 gear, and a velocity loop around the current loop.

    reference -> filter -> [position loop] -> speed limit -> velocity PI -> torque and power limit
              -> current PI -> voltage limit -> motor -> gear -> link

A reference is a link angle to be kept or a link velocity to be followed. Limits: motor speed (3000 rpm, on
the demand; the loop passes it by up to 5 % for a moment), torque of the drive, 500 W at the shaft when motoring,
length of the voltage vector. The velocity loop does not integrate against a limit, or it would pass the speed
limit by three times as much; the current loop gives back what its limit takes away. Speeds and torques of the loops
are those of the motor; the state holds angle and velocity of the link.

The motor is a permanent-magnet synchronous one in d-q axes, in the peak-value convention, with the mechanical speed w
and the electrical speed w_e = pole_pairs w:

    L_d di_d/dt = v_d - R i_d + w_e L_q i_q
    L_q di_q/dt = v_q - R i_q - w_e (L_d i_d + psi)
    torque      = 3/2 pole_pairs (psi + (L_d - L_q) i_d) i_q

Its current controller is a PI on each axis (gains by pole-zero cancellation: 500 Hz) with the speed voltages fed
forward. The voltage vector cannot be longer than V_dc / sqrt(3); the integrators give back what it clips.
"""

from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.plants.profiles import AbstractProfile, Constant
from savgs_ident.plants.quarter_car.forces import Link
from savgs_ident.plants.quarter_car.inputs import AbstractActuation

Scalar = Float[Array, ""]


class Axes(NamedTuple):
    """A quantity in the d and the q axis: a current [A] or a voltage [V]."""

    d: Scalar
    q: Scalar


def motor_torque(p: Values, current: Axes) -> Scalar:
    """Electromagnetic torque [N m] of currents [A]."""
    saliency = p["motor_inductance_d"] - p["motor_inductance_q"]
    return 1.5 * p["motor_pole_pairs"] * (p["motor_flux_linkage"] + saliency * current.d) * current.q


def speed_voltage(p: Values, current: Axes, speed: Scalar) -> Axes:
    """Voltages [V] that the speed [rad/s, mechanical] induces."""
    electrical = p["motor_pole_pairs"] * speed
    return Axes(
        -electrical * p["motor_inductance_q"] * current.q,
        electrical * (p["motor_inductance_d"] * current.d + p["motor_flux_linkage"]),
    )


def current_rate(p: Values, current: Axes, voltage: Axes, speed: Scalar) -> Axes:
    """Rates of the currents [A/s] under voltages [V]."""
    induced = speed_voltage(p, current, speed)
    return Axes(
        (voltage.d - p["motor_resistance"] * current.d - induced.d) / p["motor_inductance_d"],
        (voltage.q - p["motor_resistance"] * current.q - induced.q) / p["motor_inductance_q"],
    )


def control_current(
    p: Values, current: Axes, wanted: Axes, integral: Axes, speed: Scalar
) -> tuple[Axes, Axes]:
    """Voltages [V] for ``wanted`` currents [A], and the rates of the controller's ``integral`` [V]."""
    error = Axes(wanted.d - current.d, wanted.q - current.q)
    forward = speed_voltage(p, current, speed)
    asked = jnp.stack(
        [
            p["motor_current_kp"] * error.d + integral.d + forward.d,
            p["motor_current_kp"] * error.q + integral.q + forward.q,
        ]
    )
    # The square of the length, kept off zero, where its root has no derivative.
    length = jnp.sqrt(jnp.maximum(asked @ asked, 1e-12))
    given = asked * jnp.minimum(1.0, p["motor_dc_bus"] / (jnp.sqrt(3.0) * length))
    lost = (given - asked) * p["motor_current_ki"] / p["motor_current_kp"]
    rate = Axes(p["motor_current_ki"] * error.d + lost[0], p["motor_current_ki"] * error.q + lost[1])
    return Axes(given[0], given[1]), rate


FRICTION_SPEED = 1.0
"""Motor speed [rad/s] over which the friction of motor and gear changes sides: 0.3 % of the speed limit."""

EXCESS = 0.1
"""Share by which the torque asked for passes its limit until the velocity loop integrates no more."""


class AbstractReference(eqx.Module):
    """What the drive is asked for."""

    @abstractmethod
    def wanted(self, t: Scalar) -> Scalar:
        """The reference at time ``t`` [s], before its filter."""

    @abstractmethod
    def velocity_demand(self, filtered: Scalar, angle: Scalar) -> Scalar:
        """Link velocity [rad/s] asked of the velocity loop for a filtered reference, at a link angle [rad]."""


class PositionReference(AbstractReference):
    """A link angle [rad] over time, followed by a proportional loop around the velocity loop.

    ``bandwidth`` [Hz] of that loop: a sixth of the velocity loop's, so that the two do not meet.
    """

    angle: AbstractProfile
    bandwidth: float = 10.0

    def wanted(self, t: Scalar) -> Scalar:
        """The angle [rad]."""
        return self.angle.value(t)

    def velocity_demand(self, filtered: Scalar, angle: Scalar) -> Scalar:
        """In proportion to what is missing to the angle."""
        return 2.0 * jnp.pi * self.bandwidth * (filtered - angle)


class VelocityReference(AbstractReference):
    """A link velocity [rad/s] over time."""

    velocity: AbstractProfile

    def wanted(self, t: Scalar) -> Scalar:
        """The velocity [rad/s]."""
        return self.velocity.value(t)

    def velocity_demand(self, filtered: Scalar, angle: Scalar) -> Scalar:
        """The filtered velocity itself, wherever the link is."""
        return filtered


class DriveState(NamedTuple):
    """State of the drive: link angle [rad] and velocity [rad/s], currents [A], integrals, filtered reference.

    ``torque_integral`` [N m] is that of the velocity loop, ``voltage_integral`` [V] that of the current loop.
    """

    angle: Scalar
    velocity: Scalar
    current: Axes
    voltage_integral: Axes
    torque_integral: Scalar
    reference: Scalar


class DriveSignals(NamedTuple):
    """What happens inside: voltages [V], torque of the motor, that of friction and of the strut at its shaft [N m].

    ``demanded`` [N m] is the torque that the velocity loop asks of the current loop.
    """

    voltage: Axes
    torque: Scalar
    friction: Scalar
    load: Scalar
    demanded: Scalar


def control_velocity(p: Values, speed: Scalar, demand: Scalar, integral: Scalar) -> tuple[Scalar, Scalar]:
    """Torque [N m] asked of the motor at a ``speed`` for a ``demand`` [rad/s], and the integral's rate [N m/s]."""
    error = jnp.clip(demand, -p["motor_speed_limit"], p["motor_speed_limit"]) - speed
    asked = p["motor_velocity_kp"] * error + integral
    slow = p["motor_peak_power"] / p["motor_peak_torque"]
    upper = p["motor_peak_power"] / jnp.maximum(speed, slow)
    lower = -p["motor_peak_power"] / jnp.maximum(-speed, slow)
    given = jnp.clip(asked, lower, upper)
    excess = asked - given
    kept = jnp.maximum(0.0, 1.0 - jnp.abs(excess) / (EXCESS * jnp.abs(given)))
    return given, p["motor_velocity_ki"] * error * jnp.where(error * excess > 0.0, kept, 1.0)


def transmission_friction(p: Values, speed: Scalar, carried: Scalar) -> Scalar:
    """Friction of motor and gear at the motor [N m], which opposes its speed [rad/s].

    ``carried`` [N m] is the torque that the gear passes on towards greater angles, as seen at the motor. A
    gear of efficiency eta takes (1/eta - 1) of it when it drives, and 1 - eta when it is driven.
    """
    direction = jnp.tanh(speed / FRICTION_SPEED)
    efficiency = p["motor_gear_efficiency"]
    share = jnp.where(direction * carried > 0.0, 1.0 / efficiency - 1.0, 1.0 - efficiency)
    return direction * (p["motor_static_friction"] + share * jnp.abs(carried))


def inertia_at_motor(p: Values) -> Scalar:
    """Rotor, gear and link, as seen at the motor [kg m^2]."""
    turned = p["motor_rotor_inertia"] + p["motor_gear_input_inertia"]
    return turned + p["motor_link_inertia"] / p["motor_gear_ratio"] ** 2


def drive_state(state: Float[Array, " 8"]) -> DriveState:
    """The drive's state vector by name, in SI."""
    angle, velocity, current_d, current_q, *rest = jnp.unstack(state)
    return DriveState(angle, velocity, Axes(current_d, current_q), Axes(rest[0], rest[1]), rest[2], rest[3])


class Drive(AbstractActuation):
    """A drive that follows ``reference`` from a start at rest at ``angle_at_start`` [rad]."""

    reference: AbstractReference
    angle_at_start: Float[Array, ""] = eqx.field(converter=jnp.asarray)
    scales = (0.1, 1.0, 1.0, 1.0, 1.0, 1.0, 0.1, 1.0)

    def start_angle(self, t: Scalar) -> Scalar:
        """The angle at the start."""
        return self.angle_at_start

    def start(self, p: Values, t: Scalar, load: Scalar) -> Float[Array, " 8"]:
        """The link at rest, its load carried by the motor alone."""
        torque = -load / p["motor_gear_ratio"]
        current = torque / (1.5 * p["motor_pole_pairs"] * p["motor_flux_linkage"])
        zero = jnp.zeros_like(torque)
        hold = [zero, current, zero, p["motor_resistance"] * current]
        commanded = current * p["motor_torque_constant"]
        return jnp.stack([self.angle_at_start, zero, *hold, commanded, self.reference.wanted(t)])

    def link(self, t: Scalar, state: Float[Array, " 8"]) -> Link:
        """The link's angle and velocity, from the state; ``t`` [s]."""
        return Link(state[0], state[1])

    def rate(self, p: Values, t: Scalar, state: Float[Array, " 8"], load: Scalar) -> Float[Array, " 8"]:
        """Time derivatives of the state under a ``load`` [N m] that turns the link towards greater angles."""
        return self._evaluate(p, t, state, load)[0]

    def signals(self, p: Values, t: Scalar, state: Float[Array, " 8"], load: Scalar) -> DriveSignals:
        """Voltages and torques in a state.

        At time ``t`` [s], under the torque ``load`` of the strut on the link [N m].
        """
        return self._evaluate(p, t, state, load)[1]

    def _evaluate(
        self, p: Values, t: Scalar, state: Float[Array, " 8"], load: Scalar
    ) -> tuple[Float[Array, " 8"], DriveSignals]:
        now, ratio = drive_state(state), p["motor_gear_ratio"]
        speed = ratio * now.velocity
        demand = ratio * self.reference.velocity_demand(now.reference, now.angle)
        demanded, torque_rate = control_velocity(p, speed, demand, now.torque_integral)
        wanted = Axes(jnp.zeros_like(demanded), demanded / p["motor_torque_constant"])
        voltage, voltage_rate = control_current(p, now.current, wanted, now.voltage_integral, speed)
        current = current_rate(p, now.current, voltage, speed)
        torque, at_motor = motor_torque(p, now.current), load / ratio
        friction = transmission_friction(p, speed, -at_motor)
        acceleration = (torque - friction + at_motor) / (inertia_at_motor(p) * ratio)
        follow = 2.0 * jnp.pi * p["motor_reference_bandwidth"] * (self.reference.wanted(t) - now.reference)
        rate = [now.velocity, acceleration, *current, *voltage_rate, torque_rate, follow]
        return jnp.stack(rate), DriveSignals(voltage, torque, friction, at_motor, demanded)


def holding_drive(angle: float) -> Drive:
    """A drive that holds the link at ``angle`` [rad], as in passive tests."""
    return Drive(PositionReference(Constant(angle)), jnp.asarray(angle))
