"""Synthetic dwells whose harmonics are known."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording

Noise = Callable[[np.random.Generator, int], NDArray[np.float64]]


@dataclass(frozen=True)
class Signal:
    """Harmonics X_0..X_K at the road's phase zero, sampling rate [Hz], noise, and where its stamps start."""

    harmonics: NDArray[np.complex128]
    rate: float
    noise: Noise
    offset: float = 0.0
    drift: float = 0.0
    clock: float = 1.0


def white(sd: float) -> Noise:
    """White noise of standard deviation ``sd``."""
    return lambda rng, count: sd * rng.standard_normal(count)


def coloured(sd: float, memory: float) -> Noise:
    """AR(1) noise of standard deviation ``sd``: the density falls from low to high frequency."""

    def draw(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
        shocks = rng.standard_normal(count) * np.sqrt(1.0 - memory**2)
        values = np.empty(count)
        values[0] = rng.standard_normal()
        for i in range(1, count):
            values[i] = memory * values[i - 1] + shocks[i]
        return sd * values

    return draw


def dwell(
    rng: np.random.Generator,
    signals: Mapping[str, Signal],
    frequency: float,
    duration: float,
    *,
    name: str = "dwell",
    jitter: float = 0.02,
    start: float = 0.0,
) -> Recording:
    """One dwell that starts at an arbitrary phase; ``jitter`` is in sampling intervals, rms."""
    zero = start - rng.uniform() / frequency
    channels = {}
    for label, signal in signals.items():
        count = round(duration * signal.rate)
        time = start + (np.arange(count) + signal.offset) / signal.rate
        time = time + jitter * rng.standard_normal(count) / signal.rate
        order = np.arange(signal.harmonics.size)
        turns = np.exp(2j * np.pi * frequency * np.outer(time - zero, order))
        clean = (turns @ signal.harmonics).real + signal.drift * (time - start)
        stamps = start + (time - start) / signal.clock
        channels[label] = RecordedChannel(
            label, RIG_LAYOUT.si_unit(label), stamps, clean + signal.noise(rng, count), "synthetic"
        )
    return Recording(name, "dwell", frequency, channels)


def campaign(*recordings: Recording) -> Campaign:
    """The recordings as one campaign."""
    return Campaign("synthetic", recordings, (), "", RIG_LAYOUT)


@dataclass(frozen=True)
class Synthetic:
    """The builders above, for tests."""

    Signal = Signal
    white = staticmethod(white)
    coloured = staticmethod(coloured)
    dwell = staticmethod(dwell)
    campaign = staticmethod(campaign)
    amplitude: float = 0.01375

    def road(self, noise: float = 1e-5, rate: float = 250.0) -> Signal:
        """A cam of 27.5 mm peak to peak with a little second and third harmonic."""
        harmonics = np.array([1e-4, self.amplitude, 2e-5 + 1e-5j, -1e-5j])
        return Signal(harmonics, rate, white(noise))

    def stepped(self, size: float, highest: int, seed: int = 5) -> NDArray[np.complex128]:
        """Harmonics that fall like 1/k, as a friction step's do, up to ``highest``."""
        rng = np.random.default_rng(seed)
        order = np.arange(highest + 1)
        harmonics = size * np.exp(2j * np.pi * rng.uniform(size=order.size)) / np.maximum(order, 1)
        harmonics[0] = 0.3 * size
        return harmonics


@pytest.fixture(scope="session")
def synthetic() -> Synthetic:
    """Builders of synthetic dwells."""
    return Synthetic()
