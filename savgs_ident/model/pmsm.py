"""Permanent-magnet synchronous motor in d-q axes with its current controller.

Peak-value convention, mechanical speed w, electrical speed w_e = pole_pairs w:

    L_d di_d/dt = v_d - R i_d + w_e L_q i_q
    L_q di_q/dt = v_q - R i_q - w_e (L_d i_d + psi)
    torque      = 3/2 pole_pairs (psi + (L_d - L_q) i_d) i_q

The controller is a PI on each axis (gains by pole-zero cancellation: 500 Hz) with the speed voltages fed
forward. The voltage vector cannot be longer than V_dc / sqrt(3); the integrators give back what it clips.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.values import Values

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
