"""A campaign of our own making: periodic motions of a known rig, sampled with jitter and white noise."""

from collections.abc import Mapping
from functools import partial

import jax
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from savgs_ident.core.values import as_values
from savgs_ident.plants.quarter_car.catalogue import build_model, model_parameters
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.plant import read_sensors
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic

STROKE = 0.0275
RATE_HZ, JITTER_S = 500.0, 4e-5
NOISE: Mapping[str, float] = {"road_height": 1e-5, "sprung_accel": 0.05, "susp_deflection": 1e-4}
"""Standard deviation of a sample by channel [its unit]."""


def synthetic_campaign(
    rig: Rig,
    effects: tuple[str, ...],
    values: Mapping[str, float],
    frequencies: tuple[float, ...],
    seed: int,
    seconds: float = 6.0,
) -> Campaign:
    """Dwells at ``frequencies`` [Hz] of a rig with some other ``values`` [SI], link rigid.

    The motions are solved on four times as many nodes as a fit takes.
    """
    rng = np.random.default_rng(seed)
    p = as_values(model_parameters(rig, effects).as_dict() | dict(values))
    excitation = cam_excitation(frequencies, STROKE, float(p["psi_nominal"]))
    solution = simulate_periodic(build_model(rig, effects), p, excitation, PeriodicSettings(nodes=1024))
    assert all(status.ok for status in solution.status())
    readings = jax.vmap(partial(read_sensors, p))(solution.trajectory.x[1], solution.trajectory.y[0])
    recordings = []
    for dwell, frequency in enumerate(frequencies):
        mine = solution.mesh.layout.dwell == dwell
        phase = np.asarray(solution.mesh.phase)[mine]
        clean = {
            "road_height": STROKE / 2.0 * np.cos(phase),
            "sprung_accel": np.asarray(readings.sprung_accel)[mine],
            "susp_deflection": np.asarray(readings.susp_deflection)[mine] + 0.002,
        }
        count = int(np.ceil(seconds * frequency) / frequency * RATE_HZ)
        time = np.arange(count) / RATE_HZ + JITTER_S * rng.standard_normal(count)
        at = np.mod(2.0 * np.pi * frequency * time + rng.uniform(0.0, 2.0 * np.pi), 2.0 * np.pi)
        channels = {
            name: _channel(name, time, _sampled(phase, signal, at) + NOISE[name] * rng.standard_normal(count))
            for name, signal in clean.items()
        }
        recordings.append(Recording(f"dwell_{frequency}Hz", "dwell", frequency, channels))
    return Campaign("synthetic", tuple(recordings), (), "", RIG_LAYOUT)


def _channel(name: str, time: NDArray[np.float64], values: NDArray[np.float64]) -> RecordedChannel:
    return RecordedChannel(name, RIG_LAYOUT.si_unit(name), time, values)


def _sampled(
    phase: NDArray[np.float64], signal: NDArray[np.float64], at: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A periodic signal known at nodes, elsewhere: by a curve that does not overshoot at its corners."""
    around = np.concatenate([phase - 2.0 * np.pi, phase, phase + 2.0 * np.pi])
    found: NDArray[np.float64] = PchipInterpolator(around, np.tile(signal, 3))(at)
    return found
