"""The rig identified from a minute of road alone, against a minute of dwells."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.plants.profiles import Constant, ProfileSource, tabulated
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.simulate.transient import simulate_transient

RATE = 500.0
SECONDS = 60.0
TRUTH = {"mu_r": 0.03, "mu_t": 0.25, "ydot_Hth": 0.05, "c_sd": 5387.0}
NOISE = {"road_height": 1e-5, "sprung_accel": 0.05, "susp_deflection": 1e-4}
UNITS = {"road_height": "m", "sprung_accel": "m/s^2", "susp_deflection": "m"}


def class_c(seconds: float, random: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time [s] and height [m] of a road of class C at 10 m/s, from 0.3 Hz on (ISO 8608), which begins level."""
    count = 1 << int(np.ceil(np.log2(seconds * RATE)))
    frequency = np.fft.rfftfreq(count, 1.0 / RATE)[1:]
    density = 256e-6 * 0.1**2 * 10.0 / frequency**2 / (1.0 + (0.3 / frequency) ** 6)
    parts = random.standard_normal((2, frequency.size)) * np.sqrt(density * count * RATE / 4.0)
    height = np.fft.irfft(np.append(0.0, parts[0] + 1j * parts[1]), count)[: round(seconds * RATE)]
    time = np.arange(height.size) / RATE
    begun = np.minimum(time / 1.5, 1.0)
    return time, (height - height[0]) * begun**2 * (3.0 - 2.0 * begun)


def recorded_road(model: RigModel, seed: int) -> Campaign:
    """What the sensors of a rig show of it, and of a standstill, by the transient simulator."""
    random = np.random.default_rng(seed)
    time, height = class_c(SECONDS + 2.0, random)
    p = as_values(model.table.as_dict() | TRUTH)
    source = ProfileSource((tabulated(time, height), Constant(np.pi / 2.0)))
    found = simulate_transient(model.build(), p, source, time)
    assert found.status().ok
    readings = dict(zip(("sprung_accel", "susp_deflection"), map(np.asarray, found.readings), strict=True))
    still = {name: np.zeros(2000) for name in NOISE}
    tests = []
    for name, kind, signals in (
        ("road_class_c", "road", {"road_height": height} | readings),
        ("standstill", "standstill", still),
    ):
        channels = {}
        for each, values in signals.items():
            noisy = values + NOISE[each] * random.standard_normal(values.size)
            stamps = np.arange(values.size) / RATE
            channels[each] = RecordedChannel(each, UNITS[each], stamps, noisy)
        tests.append(Recording(name, kind, None, channels))  # type: ignore[arg-type]
    return Campaign("simulated", tuple(tests), (), "")


def minute_of_dwells() -> Campaign:
    """Dwells of the shipped campaign from slow to fast, a minute of them together, and the standstill."""
    shipped = si.load_campaign(si.default_campaign_path())
    dwells = sorted(shipped.of_kind("dwell"), key=lambda each: each.frequency_hz or 0.0)
    kept, left = [], SECONDS
    for each in dwells[1::3]:
        if each.duration_s <= left:
            kept.append(each)
            left -= each.duration_s
    assert left < 1.0
    return replace(shipped, recordings=(*kept, *shipped.of_kind("standstill")))


@pytest.mark.slow
def test_a_minute_of_road_tells_as_much_as_a_minute_of_dwells() -> None:
    model = si.QuarterCar(si.load_rig()) + "rail_coulomb" + "tyre_friction"
    road = si.fit(model, recorded_road(model, 11))
    dwells = si.fit(model, minute_of_dwells())
    assert road.trusted
    for name, truth in TRUTH.items():
        assert abs(road[name].value - truth) < 4.0 * road[name].stderr
        assert road[name].stderr < 2.0 * dwells[name].stderr
