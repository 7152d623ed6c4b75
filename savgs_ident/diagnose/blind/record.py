"""A campaign as the stand's controller logs it: samples, stamps that jitter, noise.

A dwell repeats its steady period for as long as the programme says; the noise of every sample is its own, so
that what is estimated from the record is as well known as on the rig. Stamps are the true instants, to the
hundredth of a millisecond in which they are logged.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from savgs_ident.core.errors import InputError
from savgs_ident.diagnose.blind.answer import Answer
from savgs_ident.diagnose.blind.bench import Bench
from savgs_ident.diagnose.blind.programme import Sensors
from savgs_ident.diagnose.blind.steady import Steady, steady_dwells
from savgs_ident.diagnose.blind.swept import sweep_readings
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.recordings.recording import CANONICAL_UNITS, Channel, Recording, TestKind

STAMP = 1e-5
"""Resolution of the stamps [s]."""

Real = NDArray[np.float64]


def record_campaign(bench: Bench, answer: Answer, random: np.random.Generator) -> tuple[Recording, ...]:
    """The tests of a rig with the truth ``answer``, by the transient simulator.

    Raises :class:`InputError` for a rig that does not come to a steady motion.
    """
    model, p = bench.model(answer.effects), bench.values({**answer.rig, **answer.parameters})
    lift, angle = (float(p[name]) for name in ("cam_peak_to_peak", "psi_nominal"))
    tests = []
    for dwell in steady_dwells(model, p, bench.programme.dwells):
        if not dwell.settled:
            raise InputError(
                "the motion does not become steady",
                source=f"trial {answer.number}",
                test=f"{dwell.frequency} Hz",
            )
        tests.append(_dwell(bench, dwell, lift, angle, random))
    if bench.programme.sweep > 0.0:
        tests.append(_sweep(bench, model, p, lift, angle, random))
    still = _stamps(bench.programme.standstill, bench.sensors, random)
    nothing = np.zeros((3, still.size))
    tests.append(_test("standstill", "standstill", None, still, nothing, angle, bench.sensors, random))
    return tuple(tests)


def _stamps(duration: float, sensors: Sensors, random: np.random.Generator) -> Real:
    """Instants of the samples of a test [s]."""
    grid = np.arange(round(duration * sensors.rate)) / sensors.rate
    true = grid + sensors.jitter * random.standard_normal(grid.size)
    return np.maximum(np.round(true / STAMP), 0.0) * STAMP


def _dwell(bench: Bench, dwell: Steady, lift: float, angle: float, random: np.random.Generator) -> Recording:
    """The record begins at an arbitrary angle of the cam."""
    frequency = dwell.frequency
    stamps = _stamps(bench.programme.periods_at(frequency) / frequency, bench.sensors, random)
    turns = np.mod(frequency * stamps + random.uniform(), 1.0)
    knots = np.linspace(0.0, 1.0, dwell.readings.shape[1] + 1)
    closed = np.concatenate([dwell.readings, dwell.readings[:, :1]], axis=1)
    readings = CubicSpline(knots, closed, axis=1, bc_type="periodic")(turns)
    road = lift / 2.0 * np.cos(2.0 * np.pi * turns)
    truth = np.stack([road, *readings])
    return _test(f"dwell_{frequency:.2f}Hz", "dwell", frequency, stamps, truth, angle, bench.sensors, random)


def _sweep(
    bench: Bench, model: QuarterCar, p: Values, lift: float, angle: float, random: np.random.Generator
) -> Recording:
    programme = bench.programme
    stamps = _stamps(programme.sweep, bench.sensors, random)
    times, readings = sweep_readings(model, p, programme.sweep, programme.sweep_end, bench.sensors.rate)
    turns = 0.5 * programme.sweep_end / programme.sweep * stamps**2
    truth = np.stack(
        [lift / 2.0 * np.sin(2.0 * np.pi * turns), *CubicSpline(times, readings, axis=1)(stamps)]
    )
    name = f"sweep_0_{programme.sweep_end:g}Hz_{programme.sweep:g}s"
    return _test(name, "sweep", None, stamps, truth, angle, bench.sensors, random)


def _test(
    name: str,
    kind: TestKind,
    frequency: float | None,
    stamps: Real,
    truth: Real,
    angle: float,
    sensors: Sensors,
    random: np.random.Generator,
) -> Recording:
    """A test with the sensors' noise on the true road, acceleration and deflection, (3, n)."""
    noise = np.array([sensors.road, sensors.accel, sensors.deflection])[:, None]
    shown = truth + noise * random.standard_normal(truth.shape)
    count = 2.0 * np.pi / sensors.counts
    link = count * np.round((angle + sensors.hunting * random.standard_normal(stamps.size)) / count)
    names = ("road_height", "sprung_accel", "susp_deflection", "link_angle")
    values = (*shown, link)
    channels = {
        name: Channel(name, CANONICAL_UNITS[name], stamps, each)
        for name, each in zip(names, values, strict=True)
    }
    return Recording(name, kind, frequency, channels)
