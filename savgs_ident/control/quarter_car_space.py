"""Equation (8) of the paper: the linear equivalent model as a state space.

Two masses, the equivalent spring and damper between them, the tyre below, and a hypothetical linear actuator in
series with the spring and damper, whose velocity is the input:

    m_s dzdot_s/dt = F,     m_u dzdot_u/dt = k_t l_t + c_t dl_t/dt - F,
    F = k_eq (l_s - z_lin) + c_eq d(l_s - z_lin)/dt

    states   zdot_s, zdot_u, l_s, l_t, z_lin      inputs  road_velocity, lin_velocity

The masses may be coupled, as those of distributed wishbones are: then [m_s, 0; 0, m_u] is a full matrix.
"""

from typing import NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

STATES = ("sprung_velocity", "unsprung_velocity", "susp_deflection", "tyre_deflection", "lin_position")
"""[m/s], [m/s], [m], [m], [m]."""

INPUTS = ("road_velocity", "lin_velocity")
"""[m/s] both."""

OUTPUTS = ("sprung_accel", "susp_deflection", "tyre_deflection", "lin_position")
"""[m/s^2], [m], [m], [m]."""


class TwoMasses(NamedTuple):
    """The numbers of eq. (8): ``mass`` [kg], (2, 2), of sprung and unsprung velocity; the rest SI."""

    mass: Matrix
    k_eq: float
    c_eq: float
    k_t: float
    c_t: float


def lumped(m_s: float, m_u: float) -> Matrix:
    """The mass matrix [kg], (2, 2), of eq. (8): the unsprung mass as a point at the wheel centre."""
    return np.diag([m_s, m_u])


def quarter_car_space(rig: TwoMasses) -> control.StateSpace:
    """Equation (8) with named signals; see :data:`STATES`, :data:`INPUTS` and :data:`OUTPUTS`."""
    # Forces on the sprung and the unsprung mass, by state and by input.
    strut = np.array([-rig.c_eq, rig.c_eq, rig.k_eq, 0.0, -rig.k_eq])
    tyre = np.array([0.0, -rig.c_t, 0.0, rig.k_t, 0.0])
    by_state = np.linalg.solve(rig.mass, np.stack([strut, tyre - strut]))
    by_input = np.linalg.solve(rig.mass, np.array([[0.0, -rig.c_eq], [rig.c_t, rig.c_eq]]))
    a, b = np.zeros((5, 5)), np.zeros((5, 2))
    a[:2], b[:2] = by_state, by_input
    a[2, :2] = -1.0, 1.0
    a[3, 1], b[3, 0] = -1.0, 1.0
    b[4, 1] = 1.0
    c, d = np.zeros((4, 5)), np.zeros((4, 2))
    c[0], d[0] = a[0], b[0]
    c[1, 2] = c[2, 3] = c[3, 4] = 1.0
    return control.ss(a, b, c, d, states=STATES, inputs=INPUTS, outputs=OUTPUTS, name="linear_equivalent")
