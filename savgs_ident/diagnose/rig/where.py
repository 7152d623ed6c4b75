"""Where in the response the gap lies: by channel, frequency and order, and by position in the cycle."""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.data import Data
from savgs_ident.diagnose.result import CyclePosition, MapCell
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.model.sensors import RESPONSE_CHANNELS

SAMPLES = 256
"""Instants of a cycle."""

REVERSAL, MID_STROKE = 0.3, 0.8
"""Shares of the body's largest velocity below which it turns round and above which it is in mid-stroke."""


def gap_map(plant: RigPlant, data: Data, rows: NDArray[np.float64]) -> tuple[MapCell, ...]:
    """The gap of every harmonic that is compared.

    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape = plant.shape
    measured = plant.likelihood.harmonics(data.measured[None], shape)[0]
    residual = plant.likelihood.harmonics((data.measured - rows)[None], shape)[0]
    squares = np.zeros(2 * int(np.prod(shape)))
    squares[plant.likelihood.place] = (data.measured - rows) ** 2 / data.variance
    sigma = np.sqrt(squares.reshape(*shape, 2).mean(axis=-1))
    frequency = np.asarray(plant.excitation.frequency)
    cells = []
    for d, c, k in np.argwhere(sigma > 0.0):
        size = np.abs(measured[d, c, 1]) or np.abs(measured[d, c]).max()
        percent = 100.0 * np.abs(residual[d, c, k]) / size
        cells.append(
            MapCell(RESPONSE_CHANNELS[c], float(frequency[d]), int(k), float(percent), float(sigma[d, c, k]))
        )
    return tuple(cells)


def cycle_positions(plant: RigPlant, data: Data, rows: NDArray[np.float64]) -> tuple[CyclePosition, ...]:
    """The gap of the waveforms at reversal, in mid-stroke and between, by channel; every test counts alike.

    ``rows`` (m,) are those that a model predicts [unit of the reading].
    """
    shape = plant.shape
    measured = plant.likelihood.harmonics(data.measured[None], shape)[0]
    residual = plant.likelihood.harmonics((data.measured - rows)[None], shape)[0]
    phase = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    order = np.arange(shape[2])
    turns = np.exp(1j * order[:, None] * phase)
    body = np.real((measured[:, 0, 1:] / (1j * order[1:])) @ turns[1:])
    if not np.any(measured[:, 0]):
        return ()
    fastest = np.abs(body).max(axis=1, keepdims=True)
    speed = np.abs(body) / np.where(fastest > 0.0, fastest, 1.0)
    found = []
    for c, channel in enumerate(RESPONSE_CHANNELS):
        power = np.sum(np.abs(measured[:, c]) ** 2, axis=1)
        if not np.any(power):
            continue
        wave = np.real(residual[:, c] @ turns) ** 2 / np.where(power > 0.0, power, np.inf)[:, None]
        whole = wave.sum()
        at_reversal, at_middle = wave[speed < REVERSAL].sum() / whole, wave[speed > MID_STROKE].sum() / whole
        between = 1.0 - at_reversal - at_middle
        found.append(CyclePosition(channel, float(at_reversal), float(at_middle), float(between)))
    return tuple(found)
