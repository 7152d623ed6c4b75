"""Campaigns as a rig with known parameters would record them.

    truth = draw_truth(model, seed=3) | {"mount_compliance": 1.5e-6, "mount_damping": 400.0}
    campaign = simulate_campaign(model, truth, effects=("mount_compliance",), seed=3)

The motions are integrated in time, by another method than the one that models are fitted with
(:mod:`savgs_ident.validation.virtual_motions`), and recorded as the stand's controller logs them. A dwell repeats its
steady period for as long as the programme says. The noise of every sample is its own, so that what is estimated from
the record is as well known as on the rig. Stamps jitter; they are the true instants, to the hundredth of a
millisecond in which they are logged.

On disk a campaign has the form in which the rig's own is shipped: one table, gzipped, in which numbers are written to
what the logger resolves. The same recordings give the same bytes.
"""

import gzip
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import prepare_folder, write_bytes
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.inputs import nominal_test
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording, TestKind
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.public import DWELLS
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.virtual_motions import Steady, steady_dwells, sweep_readings
from savgs_ident.validation.virtual_rig import Bench, Programme, Sensors, draw_rig


def draw_truth(model: RigModel, seed: int | np.random.Generator = 1) -> dict[str, float]:
    """Parameters of a rig [SI] that is off its drawing: normal about the drawing's, by their tolerances."""
    return draw_rig(_bench(model, Programme()), np.random.default_rng(seed))


def simulate_campaign(
    model: RigModel,
    truth: Mapping[str, float],
    effects: Sequence[str] = (),
    *,
    dwells: Sequence[float] = DWELLS,
    sweep: float = 0.0,
    seed: int | np.random.Generator = 1,
    start: datetime | None = None,
) -> Campaign:
    """The campaign that a rig would have recorded: dwells, a sweep if asked for, a standstill.

    Args:
        model: the rig with the effects that are known.
        truth: the parameters that differ from the model's, those of ``effects`` among them [SI].
        effects: what acts on the rig besides.
        dwells: frequencies of the cam [Hz].
        sweep: length of a sweep [s]; none if zero.
        seed: of the noise.
        start: when the recording begins; its clock counts from zero if left out.

    Raises :class:`InputError` for a rig that does not come to a steady motion.
    """
    use_persistent_cache()
    bench = _bench(model, Programme(dwells=tuple(dwells), sweep=sweep))
    answer = Answer(1, "none", tuple(effects), (), {}, {}, (), {}, truth, ())
    recordings = record_campaign(bench, answer, np.random.default_rng(seed))
    if start is not None:
        recordings = tuple(_begun(each, start.timestamp()) for each in recordings)
    return Campaign("simulated", recordings, (), "", RIG_LAYOUT)


def write_campaign(campaign: Campaign, folder: str | Path) -> Path:
    """Write a campaign to ``campaign.csv.gz`` in a folder, as the shipped one is written; its path.

    Raises :class:`InputError` if it cannot be written.
    """
    return write_recordings(campaign.recordings, prepare_folder(Path(folder)))


def _bench(model: RigModel, programme: Programme) -> Bench:
    return Bench(model.rig, model.effects, model.free(), programme)


def _begun(recording: Recording, start: float) -> Recording:
    """The recording with a clock that has the date, ``start`` being its first instant [s since 1970]."""
    channels = {name: replace(each, time=each.time + start) for name, each in recording.channels.items()}
    return replace(recording, channels=channels)


STAMP = 1e-5
"""Resolution of the stamps [s]."""

Real = NDArray[np.float64]


def record_campaign(bench: Bench, answer: Answer, random: np.random.Generator) -> tuple[Recording, ...]:
    """The tests of a rig with the truth ``answer``, by the transient simulator.

    Raises :class:`InputError` for a rig that does not come to a steady motion.
    """
    model, during = bench.model(answer.effects), bench.values_during({**answer.rig, **answer.parameters})
    lift, angle = nominal_test(during[0])
    tests = []
    for dwell in steady_dwells(model, during, bench.programme.dwells, bench.step):
        if not dwell.status.ok:
            raise InputError(
                "the motion does not become steady",
                source=f"trial {answer.number}",
                test=f"{dwell.frequency} Hz",
            )
        tests.append(_dwell(bench, dwell, lift, angle, random))
    if bench.programme.sweep > 0.0:
        tests.append(_sweep(bench, model, during[-1], lift, angle, random))
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
    frequency, sensors = dwell.frequency, bench.sensors
    stamps = _stamps(bench.programme.periods_at(frequency) / frequency, bench.sensors, random)
    turns = np.mod(frequency * stamps + random.uniform(), 1.0)
    knots = np.linspace(0.0, 1.0, dwell.readings.shape[1] + 1)
    period = dwell.readings if sensors.corner == 0.0 else _filtered_period(sensors, frequency, dwell.readings)
    closed = np.concatenate([period, period[:, :1]], axis=1)
    readings = CubicSpline(knots, closed, axis=1, bc_type="periodic")(turns)
    passed = sensors.filtered(np.array([frequency]))[0]
    lead = sensors.phase + float(np.angle(passed))
    road = float(np.abs(passed)) * lift / 2.0 * np.cos(2.0 * np.pi * turns + lead)
    truth = np.stack([road, *readings])
    return _test(f"dwell_{frequency:.2f}Hz", "dwell", frequency, stamps, truth, angle, bench.sensors, random)


def _filtered_period(sensors: Sensors, frequency: float, readings: Real) -> Real:
    """A period of readings after the logger's filters."""
    count = readings.shape[1]
    passed = sensors.filtered(frequency * np.arange(count // 2 + 1))
    return np.fft.irfft(np.fft.rfft(readings, axis=1) * passed, count, axis=1)


def _sweep(
    bench: Bench, model: QuarterCar, p: Values, lift: float, angle: float, random: np.random.Generator
) -> Recording:
    programme, sensors = bench.programme, bench.sensors
    stamps = _stamps(programme.sweep, sensors, random)
    rate = programme.sweep_end / programme.sweep
    times, readings = sweep_readings(model, p, programme.sweep, programme.sweep_end, sensors.rate, bench.step)
    if sensors.corner > 0.0:
        # Far below its corner the filter is a delay, the same in the road and in what answers to it.
        late = float(-np.angle(sensors.filtered(np.array([1.0]))[0])) / (2.0 * np.pi)
        times = times + late
    else:
        late = 0.0
    turns = 0.5 * rate * (stamps - late) ** 2 + sensors.phase / (2.0 * np.pi)
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
    shown = sensors.converted(truth + noise * sensors.noise(truth.shape, random))
    count = 2.0 * np.pi / sensors.counts
    link = count * np.round((angle + sensors.hunting * random.standard_normal(stamps.size)) / count)
    driven, held = QuarterCar.inputs
    names = (driven.name, *(each.name for each in QuarterCar.channels), held.name)
    channels = {
        name: RecordedChannel(name, RIG_LAYOUT.si_unit(name), stamps, values)
        for name, values in zip(names, (*shown, link), strict=True)
    }
    return Recording(name, kind, frequency, channels)


FILE = "campaign.csv.gz"

DECIMALS = {"s": 5, "m": 6, "m/s^2": 4, "rad": 6}
"""Decimals of a column by its SI unit."""


def write_recordings(recordings: Sequence[Recording], folder: Path) -> Path:
    """Write ``campaign.csv.gz`` into a folder, whole or not at all; its path.

    Raises :class:`InputError` if it cannot be written.
    """
    text = io.StringIO()
    units = {name: channel.unit for name, channel in recordings[0].channels.items()}
    text.write(",".join(["test", "time [s]", *(f"{name} [{unit}]" for name, unit in units.items())]) + "\n")
    for each in recordings:
        channels = [each.channels[name] for name in units]
        table = np.column_stack([channels[0].time, *(channel.values for channel in channels)])
        form = [f"%.{DECIMALS[unit]}f" for unit in ("s", *units.values())]
        np.savetxt(text, table, fmt=",".join([each.name, *form]))
    packed = gzip.compress(text.getvalue().encode(), compresslevel=6, mtime=0)
    return write_bytes(folder / FILE, packed)
