"""An axis that is simulated in closed form: a smooth periodic motion and the force that known laws ask for."""

from collections.abc import Mapping

import numpy as np
from scipy.signal import lfilter

import savgs_ident as si
from savgs_ident.recordings.axis_recording import AxisRecording

PERIOD_S = 5.0
RATE_HZ = 1000.0
BASE = {"mass": 80.0, "viscous": 150.0}


def recorded_axis(
    laws: Mapping[str, float],
    seed: int,
    cycles: int = 4,
    noise: float = 0.3,
    colour: float = 0.9,
) -> AxisRecording:
    """A recording of an axis with mass, viscous friction and the given ``laws`` (SI).

    The force has noise of standard deviation ``noise`` [N] with correlation ``colour`` from sample to sample, the
    position has the steps of an encoder of 0.1 micrometre.
    """
    p = BASE | dict.fromkeys(("coulomb", "offset", "spring"), 0.0) | dict(laws)
    time = np.arange(round(cycles * PERIOD_S * RATE_HZ)) / RATE_HZ
    q, v, a = np.zeros((3, time.size))
    for order, size, phase in ((1, 0.09, 0.3), (2, 0.02, 1.1), (5, 0.008, 2.0), (9, 0.002, 0.7)):
        w = 2.0 * np.pi * order / PERIOD_S
        q += size * np.sin(w * time + phase)
        v += size * w * np.cos(w * time + phase)
        a -= size * w**2 * np.sin(w * time + phase)
    force = p["mass"] * a + p["viscous"] * v + p["coulomb"] * np.sign(v) + p["offset"] + p["spring"] * q
    draw = np.random.default_rng(seed).normal(size=time.size)
    force += noise * np.sqrt(1.0 - colour**2) * lfilter([1.0], [1.0, -colour], draw)
    return AxisRecording("synthetic", time, np.round(q, 7), q, force)


def axis_with(*effects: str) -> si.PlantModel:
    """The axis with effects of its catalogue."""
    model = si.PlantModel(si.Axis(), si.Axis.parameters)
    for name in effects:
        model = model + name
    return model
