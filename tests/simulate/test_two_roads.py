"""A body on two wheels with a road each, in phase, against each other, and one alone: against its transfer matrix."""

from typing import ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.simulate.excitation import sine_excitation
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics

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
    parameters: ClassVar = si.ParameterTable((si.Parameter("m", M, "kg", about="body"),))

    def rhs(self, x, u, p, f):  # type: ignore[no-untyped-def]
        """Accelerations."""
        front, rear = x.z + FRONT * x.theta - u.road_front, x.z - REAR * x.theta - u.road_rear
        at_front, at_rear = (
            x.w + FRONT * x.q - u.road_front_rate,
            x.w - REAR * x.q - u.road_rear_rate,
        )
        pull = f.force(FRONT_STRUT, front, at_front) - K_F * front - C_F * at_front
        push = -K_R * rear - C_R * at_rear
        return {"w": (pull + push) / p["m"], "q": (FRONT * pull - REAR * push) / J}

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


@pytest.mark.parametrize(("front", "rear"), [(0.015, 0.015), (0.015, -0.015), (0.005, 0.0), (0.01, 0.02)])
def test_motions_under_two_roads_are_those_of_the_transfer_matrix(front: float, rear: float) -> None:
    plant, p = HalfCar(), as_values(HalfCar.parameters.as_dict())
    driven = {"road_front": front, "road_rear": rear}
    excitation = sine_excitation(plant, HalfCar.parameters, np.array(HERTZ), driven)
    solution = simulate_periodic(plant, p, excitation)
    assert all(status.ok for status in solution.status())
    found, expected = np.asarray(harmonics(plant, p, solution, 1))[:, :, 1], exact(front, rear)
    assert np.max(np.abs(found - expected)) < 3e-4 * np.max(np.abs(expected))
