"""A body on two wheels with a road each, and its transfer matrix."""

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

import savgs_ident as si

FRONT, REAR = 1.1, 1.4
M, J, K_F, K_R, C_F, C_R = 600.0, 650.0, 21e3, 18e3, 1300.0, 1050.0
HERTZ = [0.8, 1.3, 1.5, 2.5, 6.0]
FRONT_STRUT = si.Port("front", si.PortKind.FORCE, "front strut", "its extension", force=200.0)


class HalfCar(si.StateSpacePlant):
    """Heave and pitch of a body on two springs and dampers."""

    states_declared: ClassVar = (
        si.State("z", "m", 0.01, "heave"),
        si.State("theta", "rad", 0.01, "pitch, nose up"),
        si.State("w", "m/s", 0.1, "rate of heave", rate_of="z"),
        si.State("q", "rad/s", 0.1, "rate of pitch", rate_of="theta"),
    )
    inputs: ClassVar = (
        si.Input("road_front", "m", "front road", moves=(0.55, 0.4)),
        si.Input("road_rear", "m", "rear road", moves=(0.45, -0.4)),
    )
    channels: ClassVar = (si.Channel("heave", "m", "heave"), si.Channel("pitch", "rad", "pitch"))
    ports: ClassVar = (FRONT_STRUT,)
    parameters: ClassVar = si.ParameterTable(
        (
            si.Parameter("m", M, "kg", tolerance=6.0, about="body"),
            si.Parameter("J", J, "kg m^2", lower=100.0, upper=3000.0, about="pitch inertia"),
            si.Parameter("k_f", K_F, "N/m", lower=5e3, upper=6e4, about="front spring"),
            si.Parameter("k_r", K_R, "N/m", tolerance=2e3, about="rear spring"),
            si.Parameter("c_f", C_F, "N s/m", lower=10.0, upper=1e4, about="front damper"),
            si.Parameter("c_r", C_R, "N s/m", lower=10.0, upper=1e4, about="rear damper"),
        )
    )

    def rhs(self, x, u, p, f):  # type: ignore[no-untyped-def]
        """Accelerations."""
        front, rear = x.z + FRONT * x.theta - u.road_front, x.z - REAR * x.theta - u.road_rear
        at_front, at_rear = (
            x.w + FRONT * x.q - u.road_front_rate,
            x.w - REAR * x.q - u.road_rear_rate,
        )
        pull = f.force(FRONT_STRUT, front, at_front) - p["k_f"] * front - p["c_f"] * at_front
        push = -p["k_r"] * rear - p["c_r"] * at_rear
        return {"w": (pull + push) / p["m"], "q": (FRONT * pull - REAR * push) / p["J"]}

    def output(self, x, dx, u, p):  # type: ignore[no-untyped-def]
        """Heave and pitch."""
        return x.z, x.theta


def exact(front: complex, rear: complex) -> NDArray[np.complex128]:
    """Heave [m] and pitch [rad] at each frequency, (f, 2), under roads of complex amplitudes [m]."""
    arms = np.array([[1.0, FRONT], [1.0, -REAR]])
    mass = np.diag([M, J])
    found = []
    for hertz in HERTZ:
        s = 2j * np.pi * hertz
        struts = np.diag([K_F + s * C_F, K_R + s * C_R])
        found.append(np.linalg.solve(s**2 * mass + arms.T @ struts @ arms, arms.T @ struts @ [front, rear]))
    return np.array(found)
