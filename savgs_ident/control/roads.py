"""Roads that are driven over: random ones after ISO 8608, and a speed bump.

A random road of class A to H has the displacement spectrum

    G_d(n) = G_d(n_0) (n / n_0)^-2,     n_0 = 0.1 cycles/m,

between 0.011 and 2.83 cycles/m. A wheel at speed v meets it as a sum of sines with random phases; the contact patch
and the rig see nothing faster.
"""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from savgs_ident.model.profile import Faded, tabulated
from savgs_ident.model.road import RoadMotion

ROUGHNESS: Mapping[str, float] = MappingProxyType({"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6})
"""Geometric mean of G_d(n_0) of the classes [m^3], ISO 8608 table C.1."""

REFERENCE = 0.1
"""n_0 [cycles/m]."""

BAND = (0.011, 2.83)
"""Spatial frequencies of a road [cycles/m]."""

STEP = 1e-3
"""Time between the points of a road [s]."""

SEED = 8608
"""Of the phases: the same road every time."""


def iso_height(grade: str, speed: float, duration: float) -> NDArray[np.float64]:
    """Heights [m] every :data:`STEP` of a road of class ``grade`` met at ``speed`` [m/s] for ``duration`` [s].

    A class that is not in :data:`ROUGHNESS` is a KeyError. Heights are (n,).
    """
    count = round(duration / STEP) + 1
    n = np.fft.rfftfreq(count, STEP) / speed
    inside = (n >= BAND[0]) & (n <= BAND[1])
    amplitude = np.zeros(n.size)
    amplitude[inside] = np.sqrt(2.0 * ROUGHNESS[grade] * (n[inside] / REFERENCE) ** -2 * n[1])
    phase = np.random.default_rng(SEED).uniform(0.0, 2.0 * np.pi, n.size)
    return np.fft.irfft(0.5 * amplitude * np.exp(1j * phase) * count, count)


def iso_road(grade: str, speed: float, duration: float, fade: float) -> RoadMotion:
    """The same as a motion of the plate, which begins and ends within ``fade`` [s]."""
    height = iso_height(grade, speed, duration + fade)
    time = STEP * np.arange(height.size)
    return RoadMotion(Faded(tabulated(time, height, f"ISO 8608 {grade}"), duration, fade))


def bump_road(height: float, length: float, speed: float, start: float) -> RoadMotion:
    """A bump of ``height`` and ``length`` [m], one wave of a cosine, met at ``start`` [s] with ``speed`` [m/s]."""
    passing = length / speed
    share = np.linspace(0.0, 1.0, 201)
    table = 0.5 * height * (1.0 - np.cos(2.0 * np.pi * share))
    return RoadMotion(tabulated(start + passing * share, table, "speed bump"))
