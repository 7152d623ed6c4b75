"""The recorded sweep, which nothing was fitted to: its waveform held against that of every model.

The cam's angle is found from the recorded road, so that the models are driven by the motion itself and not by the
noise of its sensor. A model's readings are simulated from rest at even instants and interpolated at the stamps.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from diffrax import RESULTS
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from savgs_ident.model.actuation import ImposedLink, held_link
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.road import RoadMotion, sweep_road
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.model.values import Values
from savgs_ident.recordings.recording import Recording
from savgs_ident.responses.road_phase import crossing_times
from savgs_ident.simulate.stored import placed
from savgs_ident.simulate.transient import simulate_transient

RATE = 500.0
"""Instants a second at which readings are simulated [Hz]: the corners of stick and slip lie between no two."""

PRECISION = 1e-6
"""Relative tolerance of a step of the integration."""

CROSSINGS = 12
"""Passages of the road through its middle that a sweep needs."""

MISSED = 0.02
"""Share of the road's amplitude by which a sweep may miss the recorded road, rms."""

Signal = NDArray[np.float64]


class CamSweep(NamedTuple):
    """Height from top to bottom [m]; frequencies [Hz] at the first stamp and after ``duration`` [s]; the angle
    [rad] at the first stamp, from where the cam lifts highest."""

    peak_to_peak: float
    start: float
    end: float
    duration: float
    angle: float

    def road(self) -> RoadMotion:
        """The plate's motion, time counted from the first stamp."""
        return sweep_road(self.peak_to_peak, self.start, self.end, self.duration, self.angle)


def cam_sweep(recording: Recording) -> CamSweep | None:
    """The sweep of the cam that a recorded road shows; None where it is none or was not recorded."""
    channel = recording.channels.get("road_height")
    if channel is None or not (np.isfinite(channel.values).all() and np.ptp(channel.values) > 0.0):
        return None
    time, height = channel.time - channel.time[0], channel.values - channel.values.mean()
    crossings = crossing_times(time, height)
    if crossings.size < CROSSINGS:
        return None
    upwards = np.interp(crossings[0] + 0.25 * (crossings[1] - crossings[0]), time, height) > 0.0
    passed = np.pi * np.arange(crossings.size) - (np.pi / 2.0 if upwards else -np.pi / 2.0)
    bend, speed, angle = np.polyfit(crossings, passed, 2)

    def shape(x: Signal) -> Signal:
        return np.asarray(np.cos(x[0] + x[1] * time + x[2] * time**2))

    def missed(x: Signal) -> Signal:
        return np.asarray(height - x[3] * shape(x) - x[4])

    amplitude = np.ptp(height) / 2.0
    start = np.array([angle, speed, bend, amplitude, 0.0])
    spread = np.array([0.1, 0.1, 0.01, amplitude, amplitude])
    found = least_squares(missed, start, x_scale=spread)
    if not found.success or np.sqrt(np.mean(found.fun**2)) > MISSED * abs(found.x[3]):
        return None
    duration = float(time[-1])
    first = float(found.x[1]) / (2.0 * np.pi)
    last = first + float(found.x[2]) * duration / np.pi
    return CamSweep(2.0 * float(found.x[3]), first, last, duration, float(found.x[0]))


def sweep_gaps(
    recording: Recording, sweep: CamSweep, models: Sequence[tuple[QuarterCar, Values]]
) -> tuple[float, ...]:
    """Relative rms gap of each model's waveform over the sweep, both channels counting alike; NaN where a model
    cannot be simulated."""
    return tuple(_gap(recording, simulated(sweep, model, p)) for model, p in models)


def simulated(sweep: CamSweep, model: QuarterCar, p: Values) -> Mapping[str, CubicSpline] | None:
    """A model's readings over the time since the first stamp, by channel; None where it cannot be simulated."""
    times = np.arange(int(np.ceil(sweep.duration * RATE)) + 1) / RATE
    link = held_link(float(p["psi_nominal"]))
    shown, ended = _swept(model, *placed((p, sweep.road(), link, jnp.asarray(times))))
    readings = np.asarray(shown)
    if not (bool(ended) and np.isfinite(readings).all()):
        return None
    return {
        name: CubicSpline(times, values) for name, values in zip(RESPONSE_CHANNELS, readings, strict=True)
    }


def _gap(recording: Recording, model: Mapping[str, CubicSpline] | None) -> float:
    if model is None:
        return np.nan
    first = recording.channels["road_height"].time[0]
    missed = shown = 0.0
    for name, curve in model.items():
        channel = recording.channels.get(name)
        if channel is None or not np.isfinite(channel.values).all():
            continue
        apart = channel.values - curve(channel.time - first)
        power = float(np.var(channel.values))
        missed, shown = missed + float(np.var(apart)) / power, shown + 1.0
    return float(np.sqrt(missed / shown)) if shown else np.nan


@eqx.filter_jit
def _swept(
    model: QuarterCar, p: Values, road: RoadMotion, link: ImposedLink, times: Array
) -> tuple[Array, Array]:
    found = simulate_transient(model, p, road, link, times, tolerance=PRECISION)
    return jnp.stack(found.readings), jnp.asarray(found.result == RESULTS.successful)
