"""Two masses on a road and in dwells, by the exponential of their state matrix: independent of the solver."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import StateSpace, lsim

from savgs_ident.plants.two_mass import PARAMETERS
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording

RATE = 500.0
NOISE = {"body_accel": 0.02, "susp_deflection": 5e-5}
INPUTS, READINGS = ("road_height",), ("body_accel", "susp_deflection")


def road(seconds: float, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time [s] and height [m] of a road up to 30 Hz that begins level."""
    time, random = np.arange(round(seconds * RATE)) / RATE, np.random.default_rng(seed)
    frequency = np.arange(0.25, 30.0, 0.13)
    size, phase = 2e-3 / frequency, random.uniform(0.0, 2.0 * np.pi, frequency.size)
    height = (size * np.sin(2.0 * np.pi * frequency * time[:, None] + phase)).sum(axis=1)
    return time, height * np.minimum(time, 1.0) ** 2


def linear_readings(
    time: NDArray[np.float64], height: NDArray[np.float64], **other: float
) -> NDArray[np.float64]:
    """Acceleration of the body [m/s^2] and deflection [m], (2, n), by the exponential of the state matrix.

    With ``other`` parameters than those of the sheet, by name.
    """
    p = PARAMETERS.as_dict() | other
    k, c, kt, ct, ms, mu = (p[name] for name in ("k", "c", "k_t", "c_t", "m_s", "m_u"))
    # States: height and speed of the body, height of the wheel, its speed less what the tyre's damper gives it.
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-k / ms, -c / ms, k / ms, c / ms],
            [0.0, 0.0, 0.0, 1.0],
            [k / mu, c / mu, -(k + kt) / mu, -(c + ct) / mu],
        ]
    )
    damped = np.array([0.0, c / ms * ct / mu, ct / mu, -(c + ct) / mu * ct / mu + kt / mu])
    accel = a[1], c / ms * ct / mu
    deflection = np.array([-1.0, 0.0, 1.0, 0.0]), 0.0
    rows = np.stack([accel[0], deflection[0]])
    direct = np.array([[accel[1]], [deflection[1]]])
    _, seen, _ = lsim(StateSpace(a, damped[:, None], rows, direct), height, time)
    return np.asarray(seen).T


def channel_of(name: str, time: NDArray[np.float64], values: NDArray[np.float64]) -> RecordedChannel:
    return RecordedChannel(name, "m/s^2" if name == "body_accel" else "m", time, values)


def campaign(
    seconds: float = 20.0, seed: int = 0, standstill: bool = True, noise: float = 1.0, name: str = "road_c"
) -> Campaign:
    time, height = road(seconds, seed)
    random = np.random.default_rng(seed + 100)
    clean = dict(zip(READINGS, linear_readings(time, height), strict=True))
    seen = {
        each: values + noise * NOISE[each] * random.standard_normal(time.size)
        for each, values in clean.items()
    }
    tests = [recording_of(name, "road", time, {"road_height": height} | seen)]
    if standstill:
        still = {each: max(noise, 1.0) * sd * random.standard_normal(2000) for each, sd in NOISE.items()}
        tests.append(recording_of("standstill", "standstill", time[:2000], still))
    return Campaign("made", tuple(tests), (), "")


def recording_of(
    name: str, kind: str, time: NDArray[np.float64], values: dict[str, NDArray[np.float64]]
) -> Recording:
    channels = {each: channel_of(each, time, signal) for each, signal in values.items()}
    return Recording(name, kind, None, channels)  # type: ignore[arg-type]


SETTLED_S, DWELL_S = 8.0, 8.0


def dwell(frequency: float, seed: int, noise: float = 1.0) -> Recording:
    """A dwell at a frequency [Hz], after the motion has settled."""
    time, random = np.arange(round((SETTLED_S + DWELL_S) * RATE)) / RATE, np.random.default_rng(seed)
    height = 4e-3 / frequency * np.sin(2.0 * np.pi * frequency * time)
    kept = time >= SETTLED_S
    values = {"road_height": height[kept]}
    for name, clean in zip(READINGS, linear_readings(time, height), strict=True):
        values[name] = clean[kept] + noise * NOISE[name] * random.standard_normal(int(kept.sum()))
    test = recording_of(f"dwell_{frequency:g}Hz", "dwell", time[kept] - SETTLED_S, values)
    return replace(test, frequency_hz=frequency)


def dwells_and_road(noise: float = 1.0, seconds: float = 20.0, seed: int = 0) -> Campaign:
    """Dwells, a road and a standstill in one campaign."""
    beside = campaign(seconds, seed, noise=noise)
    dwells = [dwell(hertz, seed + 10 + place, noise) for place, hertz in enumerate((0.9, 1.6, 3.0, 5.0, 9.0))]
    return replace(beside, recordings=(*dwells, *beside.recordings))
