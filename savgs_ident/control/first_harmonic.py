"""First harmonics of the nonlinear rig on a cam, of any size."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.simulate.collocation import Trajectory
from savgs_ident.simulate.excitation import cam_excitation
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, simulate_periodic, solve_on_mesh

START = 1e-4
"""Peak to peak of the cam [m] from which smaller motions are found: the rig's rest may be millimetres off the
drawing's, which is far for a motion of micrometres."""

Complex = NDArray[np.complex128]


def motions_on_cam(
    model: QuarterCar, p: Values, frequency: NDArray[np.float64], peak_to_peak: float
) -> PeriodicSolution:
    """Periodic motions on a cam of height ``peak_to_peak`` [m] at frequencies [Hz], (D,).

    Raises :class:`InputError` where one was not found.
    """
    nominal = float(p["psi_nominal"])
    size = max(peak_to_peak, START)
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
    """First harmonics of the readings per metre of road [unit/m], (D, 2), whose stroke is ``peak_to_peak`` [m]."""
    found = harmonics(model, p, solution, 1)[:, :, 1] / (peak_to_peak / 2.0)
    return np.asarray(found, np.complex128)


def _shrunk(solution: PeriodicSolution, share: float) -> Trajectory:
    """The motions about their means at a ``share`` of their size."""
    layout, weight = solution.mesh.layout, np.asarray(solution.mesh.weight)

    def shrunk(values: Array) -> Array:
        rows = np.asarray(values)
        total = np.add.reduceat(weight, layout.starts)
        means = np.add.reduceat(rows * weight, layout.starts, axis=1) / total
        mean = means[:, np.asarray(layout.dwell)]
        return jnp.asarray(mean + share * (rows - mean))

    return Trajectory(*(shrunk(part) for part in solution.trajectory))
