"""The task as ordinary differential equations, and harmonics of what an integrator gives.

The right-hand side is the package's own: its residual solved for the accelerations, compiled. No user of
scipy or diffrax has a quicker one at hand, and all methods solve the very same equations.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from benchmarks.task import ORDERS, Harmonics, Task
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.dynamics import Coordinates, SectionCurves
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.kinematics import suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.transient import solve_rates

STATE_SCALE = np.array([1e-2, 3e-2, 1e-1, 3e-1, 1e-2])
"""Typical z_s [m], theta_LW [rad], their rates and the bristle's anchor [m]: absolute over relative tolerance."""

SAMPLES = 1024
"""Instants per period at which a motion is read."""


def state_rates(
    task: Task, state: Float[Array, " x"], phase: Float[Array, ""], omega: Float[Array, ""]
) -> Float[Array, " x"]:
    """d(state)/dt at a phase of the cam [rad] that turns with ``omega`` [rad/s]."""
    road = Road(task.amplitude * jnp.cos(phase), -task.amplitude * omega * jnp.sin(phase))
    link = Link(jnp.full_like(phase, task.link_angle), jnp.zeros_like(phase))
    return driven_rates(task.model, task.values, task.curves, state, Inputs(road, link))


def driven_rates(
    model: QuarterCar, values: Values, curves: SectionCurves, state: Float[Array, " x"], inputs: Inputs
) -> Float[Array, " x"]:
    """d(state)/dt of a rig that road and link drive."""
    q, qd, s = Coordinates(state[0], state[1]), Coordinates(state[2], state[3]), state[4:]
    rates = solve_rates(model, values, q, qd, s, inputs, curves)
    return jnp.concatenate([state[2:4], jnp.stack(rates.qdd), rates.sd])


def settling_periods(frequency: NDArray[np.float64], settling_s: float) -> NDArray[np.float64]:
    """Whole periods that last at least ``settling_s`` [s]."""
    return np.ceil(settling_s * frequency)


def period_harmonics(task: Task, states: NDArray[np.float64]) -> Harmonics:
    """Harmonics of the last period, from states at its 1 + SAMPLES instants, (D, 1 + SAMPLES, x).

    The acceleration is integrated by parts, so that its harmonics come from the velocity, which is a state:
    an integrator needs not be asked for accelerations.
    """
    order = np.arange(ORDERS + 1)
    kernel = np.exp(-2j * np.pi * order[:, None] * np.arange(SAMPLES) / SAMPLES) / SAMPLES
    kernel[1:] *= 2.0
    frequency = task.frequency[:, None]
    gained = (states[:, -1, 2] - states[:, 0, 2])[:, None] * np.where(order == 0, 1.0, 2.0)
    # A motion that has not quite settled does not close; the trapezoidal rule shares its ends.
    closed = states[:, :-1].copy()
    closed[:, 0] = (states[:, 0] + states[:, -1]) / 2.0
    velocity = closed[:, :, 2] @ kernel.T
    acceleration = 2j * np.pi * order * frequency * velocity + gained * frequency
    deflection = _travel(task, closed[:, :, 1]) @ kernel.T
    return np.stack([acceleration, deflection], axis=1)


def _travel(task: Task, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    travel = jax.jit(jax.vmap(lambda one: suspension_travel(task.values, one)))
    return np.asarray(travel(jnp.asarray(theta.ravel()))).reshape(theta.shape)
