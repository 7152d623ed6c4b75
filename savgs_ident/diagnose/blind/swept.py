"""A sweep of the cam from rest, by time integration."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnose.blind.steady import PRECISION
from savgs_ident.model.actuation import held_link
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.road import sweep_road
from savgs_ident.model.values import Values
from savgs_ident.simulate.transient import TransientSolution, simulate_transient


def sweep_readings(
    model: QuarterCar, p: Values, duration: float, end: float, rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Instants [s], (n,), and what the sensors show then, (2, n), from 0 to ``end`` [Hz] in ``duration`` [s].

    Raises :class:`InputError` if the integration does not end well.
    """
    times = np.arange(round(duration * rate) + 1) / rate
    found = _sweep(model, p, jnp.asarray(times), jnp.asarray([duration, end]))
    if not found.status().ok:
        raise InputError("the sweep cannot be simulated", source="sweep", remedy=found.status().advice)
    return times, np.stack([np.asarray(each) for each in found.readings])


@eqx.filter_jit
def _sweep(model: QuarterCar, p: Values, times: Array, numbers: Array) -> TransientSolution:
    duration, end = jnp.unstack(numbers)
    road = sweep_road(p["cam_peak_to_peak"], 0.0, end, duration)
    return simulate_transient(model, p, road, held_link(p["psi_nominal"]), times, tolerance=PRECISION)
