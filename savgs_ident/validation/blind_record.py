"""A campaign as the stand's controller logs it: samples, stamps that jitter, noise.

A dwell repeats its steady period for as long as the programme says; the noise of every sample is its own, so
that what is estimated from the record is as well known as on the rig. Stamps are the true instants, to the
hundredth of a millisecond in which they are logged.

What was drawn for a trial: the truth that the diagnosis must not see.

A campaign on disk, in the form in which the rig's own is shipped: one table, gzipped.

The same recordings give the same bytes. Numbers are written to what the logger resolves.

The seal: nobody can change the answer of a trial after its recordings were handed over and go unnoticed.

Beside the recordings stands a digest of the answer together with a salt, so that it reveals nothing of the answer;
answer and salt lie elsewhere, and are opened when the diagnosis has spoken. The seal holds the digest of the
recordings, too.

    seal = sealed(answer, salt, digest_of_recordings)
    ...
    opened(seal, envelope, digest_of_recordings)      # the answer, or an error
"""

import gzip
import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import record_of, write_bytes
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.inputs import nominal_test
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig_recordings import RIG_LAYOUT
from savgs_ident.recordings.recording import RecordedChannel, Recording, TestKind
from savgs_ident.validation.virtual_motions import Steady, steady_dwells, sweep_readings
from savgs_ident.validation.virtual_rig import Bench, Sensors

Drawn = Literal["none", "effect", "two", "unknown", "foreign"]
"""What a trial's rig has beyond its model: nothing, an effect, two, one that the catalogue then lacks, or one whose
law no catalogue has."""


@dataclass(frozen=True)
class SmallErrors:
    """What no real rig is without, and no diagnosis is to take for an effect.

    Attributes:
        damper: relative errors of the damper's table, point by point [1].
        drift: relative change of the rail's friction over the campaign, about its mean [1].
        colour: correlation of the sensors' noise from one sample to the next [1].
        phase: angle by which the road's signal leads the road [rad].
    """

    damper: tuple[float, ...]
    drift: float
    colour: float
    phase: float


@dataclass(frozen=True)
class Answer:
    """The truth of a trial.

    Attributes:
        number: of the trial.
        kind: what was drawn.
        effects: names of the effects that the rig has beyond the baseline.
        ports: where they act, in the same order.
        changes: by how much each alone changes the clean response, relative; by effect.
        sigmas: by how many standard deviations each stands out of what noise, calibration and tolerances can do,
            the other one projected out; by effect.
        imitators: of a single effect, others of the catalogue that do the same to this campaign, to first order
            within the noise.
        parameters: true values of the effects' parameters, SI.
        rig: true values of the rig's own parameters that are not those of the sheet, SI.
        without: effects that are removed from the catalogue for this trial.
        accepted: of a foreign effect, the ports that are right.
        families: of a foreign effect, the families that are right.
        small_errors: of a foreign trial; None in a trial of the catalogue's own effects, which has none.
    """

    number: int
    kind: Drawn
    effects: tuple[str, ...]
    ports: tuple[str, ...]
    changes: Mapping[str, float]
    sigmas: Mapping[str, float]
    imitators: tuple[str, ...]
    parameters: Mapping[str, float]
    rig: Mapping[str, float]
    without: tuple[str, ...]
    accepted: tuple[str, ...] = ()
    families: tuple[str, ...] = ()
    small_errors: SmallErrors | None = None


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
        if not dwell.settled:
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
    names = ("road_height", "sprung_accel", "susp_deflection", "link_angle")
    values = (*shown, link)
    channels = {
        name: RecordedChannel(name, RIG_LAYOUT.si_unit(name), stamps, each)
        for name, each in zip(names, values, strict=True)
    }
    return Recording(name, kind, frequency, channels)


FILE = "campaign.csv.gz"

DECIMALS = {
    "time": 5,
    "road_height": 6,
    "sprung_accel": 4,
    "susp_deflection": 6,
    "link_angle": 6,
}
"""Decimals of each column in its SI unit."""


def write_campaign(recordings: Sequence[Recording], folder: Path) -> Path:
    """Write ``campaign.csv.gz`` into a folder, whole or not at all; its path.

    Raises :class:`InputError` if it cannot be written.
    """
    text = io.StringIO()
    units = {name: channel.unit for name, channel in recordings[0].channels.items()}
    text.write(",".join(["test", "time [s]", *(f"{name} [{unit}]" for name, unit in units.items())]) + "\n")
    for each in recordings:
        channels = [each.channels[name] for name in units]
        table = np.column_stack([channels[0].time, *(channel.values for channel in channels)])
        form = [f"%.{DECIMALS[name]}f" for name in ("time", *units)]
        np.savetxt(text, table, fmt=",".join([each.name, *form]))
    packed = gzip.compress(text.getvalue().encode(), compresslevel=6, mtime=0)
    return write_bytes(folder / FILE, packed)


_FOREIGN_ONLY = ("accepted", "families", "small_errors")

_REMEDY = "record the trial again: remove its folder"


@dataclass(frozen=True)
class Seal:
    """Digests (SHA-256, hexadecimal) of the salted answer and of the recordings."""

    answer: str
    recordings: str


@dataclass(frozen=True)
class Envelope:
    """The answer and its salt (hexadecimal)."""

    answer: Answer
    salt: str


def sealed(envelope: Envelope, recordings: str) -> Seal:
    """The seal of an answer and of recordings with this digest."""
    return Seal(_digest(envelope), recordings)


def opened(seal: Seal, envelope: Envelope, recordings: str) -> Answer:
    """The answer; raises :class:`InputError` if it or the recordings are not those that were sealed."""
    if _digest(envelope) != seal.answer:
        raise InputError("the answer is not the one that was sealed", remedy=_REMEDY)
    if recordings != seal.recordings:
        raise InputError("the recordings are not those that were sealed", remedy=_REMEDY)
    return envelope.answer


def envelope_of(record: Mapping[str, Any]) -> Envelope:
    """The envelope from what ``dataclasses.asdict`` and JSON made of it; ``ValueError`` for something else."""
    return record_of(Envelope, {name: record.get(name) for name in ("answer", "salt")})


def _digest(envelope: Envelope) -> str:
    # What only foreign trials have is left out of the others: seals of earlier versions hold.
    answer = asdict(envelope.answer)
    given = {name: value for name, value in answer.items() if name not in _FOREIGN_ONLY or value}
    text = json.dumps(given, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(f"{envelope.salt}\n{text}".encode("utf-8", "surrogatepass")).hexdigest()
