"""Where the rig is linear its response is that of its linearisation, and where it is not SimQC peaks as printed."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.catalogue import build_model
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar, read_sensors
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import peak_to_peak
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic

from .programme import LINK, PROGRAMME, cam, orders

TINY = 2e-7
"""Cam stroke at which the linkage is straight to about 1e-6 [m]."""


@pytest.fixture(scope="module")
def straight(rig: Rig) -> QuarterCar:
    """The frictionless rig with a viscous damper: a table on a straight line."""
    velocity = (-0.4, -0.1, 0.0, 0.2, 0.6)
    force = tuple(5792.0 * each for each in velocity)
    return build_model(replace(rig, damper_velocity=velocity, damper_force=force), ())


def _flat_residual(model: QuarterCar, p: Values, z: Array) -> Array:
    """The residual at z = (q, qd, qdd, road height and velocity)."""
    motion = Motion(*(Coordinates(z[i], z[i + 1]) for i in (0, 2, 4)))
    inputs = Inputs(Road(z[6], z[7]), Link(jnp.asarray(LINK), jnp.zeros(())))
    return model.residual(p, motion, jnp.zeros(0), jnp.zeros(0), inputs)


@pytest.fixture(scope="module")
def linearised(straight: QuarterCar, numbers: Values) -> tuple[NDArray[np.float64], float]:
    """The residual's slopes (2, 8) where the rig stands still, and d(deflection)/d(theta_LW) there [m/rad]."""
    residual = jax.jit(lambda z: _flat_residual(straight, numbers, z))
    jacobian = jax.jit(jax.jacobian(lambda z: _flat_residual(straight, numbers, z)))
    z = np.zeros(8)
    for _ in range(20):
        z[:2] -= np.linalg.solve(np.asarray(jacobian(z))[:, :2], np.asarray(residual(z)))
    travel = jax.grad(lambda angle: read_sensors(numbers, angle, jnp.zeros(())).susp_deflection)(z[1])
    return np.asarray(jacobian(z)), float(travel)


def _transfer(
    linearised: tuple[NDArray[np.float64], float], omega: NDArray[np.float64], s: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """First harmonics of the sensors per metre of road, (D, 2), with ``s`` for d/dt of the rig's motion.

    ``omega`` [rad/s] is the frequency of the road, whose velocity is imposed exactly.
    """
    slope, travel = linearised
    out = []
    for w, d in zip(omega, s, strict=True):
        road = slope[:, 6] + 1j * w * slope[:, 7]
        q = -np.linalg.solve(slope[:, :2] + d * slope[:, 2:4] + d**2 * slope[:, 4:6], road)
        out.append([d**2 * q[0], travel * q[1]])
    return np.array(out)


@pytest.mark.slow
def test_a_tiny_motion_has_the_transfer_function_of_the_linearised_rig(
    straight: QuarterCar, numbers: Values, linearised: tuple[NDArray[np.float64], float]
) -> None:
    omega = 2.0 * np.pi * PROGRAMME
    settings = PeriodicSettings(nodes=1024, slow=0.1)
    solution = simulate_periodic(straight, numbers, cam_excitation(PROGRAMME, TINY, LINK), settings)
    assert all(status.ok for status in solution.status())
    found = orders(straight, numbers, solution)[:, :, 1] / (TINY / 2.0)
    wanted = _transfer(linearised, omega, 1j * omega)
    assert np.max(np.abs(found / wanted - 1.0)) < 1e-4


@pytest.mark.slow
def test_equal_steps_warp_the_frequency_exactly_as_the_trapezoidal_rule_does(
    straight: QuarterCar, numbers: Values, linearised: tuple[NDArray[np.float64], float]
) -> None:
    """On N equal steps d/dt of a harmonic becomes 2i/h tan(omega h / 2): nothing else may be wrong."""
    nodes, frequency = 64, np.array([0.5, 2.0, 6.0])
    omega, step = 2.0 * np.pi * frequency, 1.0 / (nodes * frequency)
    settings = PeriodicSettings(nodes=nodes, slow=0.1, adaptations=0)
    solution = simulate_periodic(straight, numbers, cam_excitation(frequency, TINY, LINK), settings)
    found = orders(straight, numbers, solution)[:, :, 1] / (TINY / 2.0)
    warped = 2j / step * np.tan(omega * step / 2.0)
    assert np.max(np.abs(found / _transfer(linearised, omega, warped) - 1.0)) < 3e-6
    assert np.max(np.abs(found / _transfer(linearised, omega, 1j * omega) - 1.0)) > 1e-4


@pytest.mark.slow
def test_simqc_peaks_at_two_hertz(frictionless: QuarterCar, numbers: Values) -> None:
    solution = simulate_periodic(frictionless, numbers, cam(PROGRAMME))
    assert all(status.ok for status in solution.status())
    found = orders(frictionless, numbers, solution, 15)[:, 0]
    reach = peak_to_peak(found, np.ones(16, bool))
    for response in (np.abs(found[:, 1]), reach):
        assert abs(PROGRAMME[np.argmax(response)] - 2.0) <= 0.1
