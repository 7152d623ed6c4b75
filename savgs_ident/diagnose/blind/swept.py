"""A sweep of the cam from rest, by time integration."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from diffrax import RESULTS
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnose.blind.steady import PRECISION
from savgs_ident.model.actuation import ImposedLink, held_link
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.road import RoadMotion, sweep_road
from savgs_ident.model.values import Values
from savgs_ident.simulate.stored import placed
from savgs_ident.simulate.transient import simulate_transient


def sweep_readings(
    model: QuarterCar, p: Values, duration: float, end: float, rate: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Instants [s], (n,), and what the sensors show then, (2, n), from 0 to ``end`` [Hz] in ``duration`` [s].

    Raises :class:`InputError` if the integration does not end well.
    """
    times = np.arange(round(duration * rate) + 1) / rate
    road = sweep_road(float(p["cam_peak_to_peak"]), 0.0, end, duration)
    link = held_link(float(p["psi_nominal"]))
    shown, ended = _swept(model, p, *placed((road, link, jnp.asarray(times))))
    if not np.isfinite(shown).all() or not bool(ended):
        raise InputError("the sweep cannot be simulated", source="sweep", remedy="draw another rig")
    return times, np.asarray(shown)


@eqx.filter_jit
def _swept(
    model: QuarterCar, p: Values, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, Array]:
    found = simulate_transient(model, p, road, link, times, tolerance=PRECISION)
    return jnp.stack(found.readings), jnp.asarray(found.result == RESULTS.successful)
