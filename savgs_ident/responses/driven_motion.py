"""The measured motion of a servo axis, and the force that its drive needed for it.

Under closed loop the position hides what a model lacks: the controller makes the carriage follow whatever the
friction. The force shows it. So the measured motion is taken as it is, and the force that a model says it takes is
compared with the force that it did take.

The position is filtered without phase and differentiated centrally. A friction is sharper than the rows are dense,
so that a model is evaluated at every sample, and its force goes through the same low-pass and thinning as the
measured one: both sides of M a + ... = F see the same filter, and it moves no parameter.

The noise of the force comes from the cycles of the reference, which goes through the same one several times. What is
left of the force once inertia and a viscous friction have explained their part holds whatever such a model lacks;
between one cycle and the next that is the same, and the difference is noise, that of the differentiated position
included. Its median size is taken, so that a few instants (reversals, a pulse in one cycle) do not count as noise.

A motion that does not repeat, a drive along a road or a random signal, shows its noise by what changes from row to
row more roughly than a force does that a motion so slow makes: the median size of third differences, in which all
that is smooth over some rows is gone. That the noise is white is then assumed, and a warning says so.

Where the plant is slower than its sensor resolves, nobody can tell which way it goes, or whether it goes at all: a
friction there may have any force between its bounds. Such rows are left out, but for a motion so steady that the mean
of its speed over a longer time says which way it goes.

Times and frequencies below are those of a motion up to :data:`FAST_HZ`; a faster one has a time scale of its own
(:func:`time_scale_of_motion`), by which its times are multiplied and its frequencies divided.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import ceil, log2
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.axis_recording import AxisRecording, is_axis, read_axis
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.resolution import NORMAL, noise_of_rate, noise_of_speed, roughness, unresolved

CUTOFF_HZ = 100.0
"""The position passes up to here [Hz]."""

FAST_HZ = 5.0
"""Above this the middle of a motion's spectrum [Hz] is that of a fast one: a row and a cutoff of twenty a period."""

SHARE_OF_RATE = 0.4
"""Or up to this share of the sampling rate, where that is less."""

ROWS_HZ = 100.0
"""Rows per second [Hz]."""

BLOCK_S = 1.0
"""Rows of so much time [s] are left out together, as one test."""

PASSED = 0.8
"""The rows' low-pass, as a share of half their rate."""

CUT_S = 0.2
"""What is cut off at both ends, where the filters have no neighbours [s]."""

SAME = 1e-6
"""Mean square difference between two cycles of the reference, in its variance, up to which they are the same."""

SAME_AS_MEASURED = 1e-4
"""The same of a measured motion, which has noise and is not led the same way twice."""

UNEVEN = 0.01
"""Largest departure of a time from an even grid, in steps, up to which samples are taken as they are."""

UNSEEN = 0.02
"""Share of a row that may be of samples at rest."""

SELDOM = 0.05
"""Share of the time at rest from which on it is said."""

_ORDER = 4
_FEWEST = 100


@dataclass(frozen=True)
class DrivenMotion:
    """A measured motion of n even samples, and the force of the drive.

    Attributes:
        source: file it came from.
        step: time between samples [s].
        position: filtered, [m], (n,).
        velocity: [m/s], (n,).
        acceleration: [m/s^2], (n,).
        drive: force of the drive [N], (n,).
        period: time in which the reference repeats [s]; the whole recording where it does not.
        noise: standard deviation of the noise of a row of force [N].
        still: 1 where the motion is slower than its sensor resolves, 0 elsewhere, (n,).
        warnings: what is to be known of it.
        starts: places of the samples with which tests begin, several that were recorded one after the other.
        time_scale: by what times that are meant for a slow motion are multiplied [1].
        beside: the plant's other inputs, by name [their units], (n,) each.

    Position and force of a plant that turns are an angle [rad] and a torque [N m].
    """

    source: str
    step: float
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    drive: NDArray[np.float64]
    period: float
    noise: float
    still: NDArray[np.float64]
    warnings: tuple[DataWarning, ...] = ()
    starts: tuple[int, ...] = (0,)
    time_scale: float = 1.0
    beside: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def every(self) -> int:
        """Samples to a row."""
        return _samples_to_a_row(self._scaled_step)

    @property
    def _scaled_step(self) -> float:
        return self.step / self.time_scale

    @property
    def _tests(self) -> list[slice]:
        """The samples of each test."""
        return [slice(*ends) for ends in pairwise((*self.starts, self.position.size))]

    def rows(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals (..., n) of any unit as rows, (..., m): those of which no sample is still."""
        return self._every_row(signals)[..., self._moving]

    def _every_row(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate(
            [_thinned(signals[..., test], self._scaled_step) for test in self._tests], axis=-1
        )

    @cached_property
    def _moving(self) -> NDArray[np.bool_]:
        return np.asarray(np.abs(self._every_row(self.still)) < UNSEEN)

    def rate(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time derivative of a signal (n,) [its unit per second]."""
        return np.concatenate([np.gradient(signal[test], self.step) for test in self._tests])

    @property
    def begins(self) -> NDArray[np.float64]:
        """1 where a test begins, 0 elsewhere, (n,)."""
        found = np.zeros(self.position.size)
        found[list(self.starts)] = 1.0
        return found

    @property
    def row_times(self) -> NDArray[np.float64]:
        """Time of each row since the first sample [s], (m,), as if tests followed each other."""
        edge = round(CUT_S / self._scaled_step)
        samples = [np.arange(test.start + edge, test.stop - edge, self.every) for test in self._tests]
        return self.step * np.concatenate(samples).astype(np.float64)[self._moving]

    @property
    def blocks(self) -> NDArray[np.intp]:
        """The block of time that each row belongs to, (m,); none is of two tests."""
        step = self._scaled_step
        long, edge = round(BLOCK_S / (self.every * step)), round(CUT_S / step)
        found, first = list[NDArray[np.intp]](), 0
        for test in self._tests:
            rows = np.arange(len(range(test.start + edge, test.stop - edge, self.every)))
            found.append(first + (rows / max(long, 1)).astype(np.intp))
            first = int(found[-1][-1]) + 1
        _, there = np.unique(np.concatenate(found)[self._moving], return_inverse=True)
        return np.asarray(there, np.intp)


_SIGNALS = ("position", "velocity", "acceleration", "drive", "still")


def joined(motions: Sequence[DrivenMotion], source: str) -> DrivenMotion:
    """Several motions of one plant as one, whose tests begin from rest; sampled as often as the one sampled most."""
    if len(motions) == 1:
        return motions[0]
    step = min(each.step for each in motions)
    even = [_resampled(each, step) for each in motions]
    sizes = [each.position.size for each in even]
    weights = np.array([each.row_times.size for each in motions])
    noise = float(np.sqrt(np.average([each.noise**2 for each in motions], weights=weights)))
    position, velocity, acceleration, drive, still = (
        np.concatenate([getattr(each, name) for each in even]) for name in _SIGNALS
    )
    return DrivenMotion(
        source,
        step,
        position,
        velocity,
        acceleration,
        drive,
        max(each.period for each in motions),
        noise,
        still,
        _said_once([warning for each in motions for warning in each.warnings], source),
        tuple(np.cumsum([0, *sizes[:-1]]).tolist()),
        min(each.time_scale for each in motions),
        {name: np.concatenate([each.beside[name] for each in even]) for name in even[0].beside},
    )


def _resampled(motion: DrivenMotion, step: float) -> DrivenMotion:
    """The motion at another time between samples [s]."""
    if abs(step / motion.step - 1.0) < UNEVEN:
        return motion
    old = motion.step * np.arange(motion.position.size)
    new = np.arange(0.0, old[-1], step)
    signals = {name: np.interp(new, old, getattr(motion, name)) for name in _SIGNALS}
    beside = {name: np.interp(new, old, each) for name, each in motion.beside.items()}
    return replace(motion, step=step, beside=beside, **signals)


def _said_once(warnings: Sequence[DataWarning], source: str) -> tuple[DataWarning, ...]:
    """Of warnings with the same code one, which says of how many tests it is."""
    codes = dict.fromkeys(each.code for each in warnings)
    found = {code: [each for each in warnings if each.code == code] for code in codes}
    return tuple(
        same[0]
        if len(same) == 1
        else replace(same[0], what=f"in {len(same)} tests {same[0].what}", source=source, test="")
        for same in found.values()
    )


def is_motion(path: Path | str) -> bool:
    """Whether a file is a MATLAB file with the variables that :func:`load_motion` reads."""
    return Path(path).suffix == ".mat" and is_axis(Path(path))


def load_motion(path: Path | str) -> DrivenMotion:
    """The motion of a servo axis and the force of its drive, from a MATLAB file (version 5 to 7).

    The file has the column vectors ``t`` [s], ``qm`` (position [m]), ``qg`` (its reference [m]) and ``vir``
    (controller output [V]), and the scalar ``gtau`` (force of the drive per volt [N/V]).

    Raises :class:`InputError` for a file that cannot be read or that lacks one of them, for a recording that is too
    short, and where the reference does not repeat.
    """
    return driven_motion(read_axis(Path(path)))


def driven_motion(recording: AxisRecording) -> DrivenMotion:
    """The motion in a recording.

    Raises :class:`InputError` for one that is too short, and where the reference does not repeat.
    """
    step, scale = recording.step, time_scale_of_motion(recording.position, recording.step)
    period = period_of(recording.reference, SAME)
    if period is None:
        raise InputError(
            "the reference does not repeat, so that the noise is not known",
            source=recording.source,
            remedy="record two cycles or more",
        )
    unclear = noise_of_rate(recording.position, step, _cutoff(step, scale))
    return _driven(recording.source, step, scale, recording.position, recording.force, period, unclear)


def recorded_motion(
    recording: Recording, motion: str, drive: str, source: str, others: Sequence[str] = ()
) -> DrivenMotion:
    """The motion in a test of any plant with one coordinate: the channel ``motion``, driven by the channel ``drive``.

    ``others`` are the channels of further inputs.
    Samples that are not even in time are interpolated. Raises :class:`InputError` for a test that lacks a channel or
    is too short.
    """
    step, (position, force, *beside) = _even(recording, (motion, drive, *others), source)
    period, scale = period_of(position, SAME_AS_MEASURED), time_scale_of_motion(position, step)
    unclear = noise_of_rate(position, step, _cutoff(step, scale))
    found = _driven(f"{source}, {recording.name}", step, scale, position, force, period, unclear)
    return replace(found, beside=dict(zip(others, beside, strict=True)))


def recorded_speed(
    recording: Recording, speed: str, drive: str, source: str, others: Sequence[str] = ()
) -> DrivenMotion:
    """The same where the channel ``speed`` has the velocity: the position is its integral, from zero.

    Raises :class:`InputError` as :func:`recorded_motion` does.
    """
    step, (velocity, force, *beside) = _even(recording, (speed, drive, *others), source)
    position = np.concatenate([[0.0], np.cumsum(0.5 * step * (velocity[1:] + velocity[:-1]))])
    period, scale = period_of(velocity, SAME_AS_MEASURED), time_scale_of_motion(position, step)
    unclear = noise_of_speed(velocity, step, _cutoff(step, scale))
    found = _driven(f"{source}, {recording.name}", step, scale, position, force, period, unclear)
    return replace(found, beside=dict(zip(others, beside, strict=True)))


def _even(recording: Recording, names: Sequence[str], source: str) -> tuple[float, list[NDArray[np.float64]]]:
    """Time between samples of the first channel [s], and all channels at even times."""
    for name in names:
        if name not in recording.channels:
            raise InputError(
                "was not recorded",
                source=source,
                test=recording.name,
                channel=name,
                remedy="map its channel in channels.toml",
            )
    led, *driven = (recording.channels[name] for name in names)
    start = max(each.time[0] for each in (led, *driven))
    end = min(each.time[-1] for each in (led, *driven))
    step = float(led.time[-1] - led.time[0]) / max(led.time.size - 1, 1)
    time = start + step * np.arange(int((end - start) / step + 1e-6) + 1)
    return step, [_at(time, each) for each in (led, *driven)]


def _at(time: NDArray[np.float64], channel: RecordedChannel) -> NDArray[np.float64]:
    """A channel at even times [s]; as it was sampled where that is even enough."""
    step = time[1] - time[0] if time.size > 1 else 1.0
    same = channel.values.size == time.size and np.max(np.abs(channel.time - time)) <= UNEVEN * step
    return channel.values if same else np.interp(time, channel.time, channel.values)


def time_scale_of_motion(position: NDArray[np.float64], step: float) -> float:
    """That of a motion (n,), sampled every ``step`` [s]: a power of two, 1 for one up to :data:`FAST_HZ`."""
    power = np.abs(np.fft.rfft(position - position.mean())) ** 2
    if not power.sum() > 0.0:
        return 1.0
    middle = float(np.average(np.fft.rfftfreq(position.size, step), weights=power))
    return 2.0 ** -ceil(max(log2(middle / FAST_HZ), 0.0)) if middle > 0.0 else 1.0


def _cutoff(step: float, time_scale: float) -> float:
    """Up to where the position passes [Hz]."""
    return min(CUTOFF_HZ / time_scale, SHARE_OF_RATE / step)


def _driven(
    source: str,
    step: float,
    time_scale: float,
    measured: NDArray[np.float64],
    force: NDArray[np.float64],
    period: int | None,
    unclear: float,
) -> DrivenMotion:
    """The motion of even samples, whose noise comes from cycles of ``period`` samples where it has any.

    ``unclear`` is the standard deviation of the noise of its speed.
    """
    scaled = step / time_scale
    if measured.size * scaled < 2.0 * CUT_S + _FEWEST * _samples_to_a_row(scaled) * scaled:
        raise InputError("is too short", source=source, remedy="record some seconds at least")
    cutoff = _cutoff(step, time_scale)
    position = _low_passed(2.0 * cutoff * step, measured)
    velocity = np.gradient(position, step)
    acceleration = np.gradient(velocity, step)
    still = unresolved(velocity, unclear, scaled, cutoff * time_scale).astype(np.float64)
    warnings = [] if still.mean() < SELDOM else [_at_rest(source, float(still.mean()))]
    left = _beyond(force, np.stack([acceleration, velocity], axis=1))
    signals = position, velocity, acceleration, force
    if period is not None:
        noise = _repeatability(left, period, scaled)
        found = DrivenMotion(source, step, *signals, period * step, noise, still, tuple(warnings))
        return _moving(replace(found, time_scale=time_scale))
    noise = roughness(_thinned(left, scaled))
    assumed = DataWarning(
        "noise_assumed",
        "the motion does not repeat: its noise is taken from what is rough in the force, as if it were white",
        source=source,
        remedy="record the same motion twice, so that the noise is measured",
    )
    whole = measured.size * step
    found = DrivenMotion(source, step, *signals, whole, noise, still, (assumed, *warnings))
    return _moving(replace(found, time_scale=time_scale))


def _moving(motion: DrivenMotion) -> DrivenMotion:
    """The motion, if it has rows in which it moves."""
    if motion.row_times.size < _FEWEST:
        raise InputError(
            "is slower than its sensor resolves nearly all the time",
            source=motion.source,
            remedy="measure finer, or move faster",
        )
    return motion


def _at_rest(source: str, share: float) -> DataWarning:
    return DataWarning(
        "slower_than_resolved",
        f"for {100.0 * share:.0f} % of the time the motion is slower than its sensor resolves, so that the friction "
        "there may be anything; left out",
        source=source,
        remedy="measure finer, or move faster",
    )


def period_of(reference: NDArray[np.float64], same: float) -> int | None:
    """Samples in a cycle of a reference (n,) of any unit, two of which differ by no more than ``same``; None if none.

    ``same`` is a mean square in the variance of the reference.
    """
    x = reference - reference.mean()
    count, variance = x.size, float(np.mean(x**2))
    lags = np.arange(1, count // 2)
    spectrum = np.fft.rfft(x, 2 * count)
    products = np.fft.irfft(np.abs(spectrum) ** 2)[lags]
    squares = np.concatenate([[0.0], np.cumsum(x**2)])
    apart = (squares[count - lags] + squares[count] - squares[lags] - 2.0 * products) / (count - lags)
    left = np.flatnonzero(apart > variance)
    again = np.flatnonzero(apart[left[0] :] < same * variance) if left.size else left
    if again.size == 0:
        return None
    near = left[0] + again[0] + np.arange(count // 1000 + 2)
    near = near[near < lags.size]
    return int(lags[near[np.argmin(apart[near])]])


def _beyond(force: NDArray[np.float64], inertial: NDArray[np.float64]) -> NDArray[np.float64]:
    """What an inertia and a viscous friction leave of the force [N], (n,)."""
    explained, *_ = np.linalg.lstsq(inertial, force, rcond=None)
    return np.asarray(force - inertial @ explained)


def _repeatability(left: NDArray[np.float64], period: int, step: float) -> float:
    """Standard deviation of a row's noise [N], from what does not repeat after ``period`` samples."""
    apart = _thinned(left[period:] - left[:-period], step)
    return float(NORMAL * np.median(np.abs(apart)) / np.sqrt(2.0))


def _samples_to_a_row(step: float) -> int:
    return max(round(1.0 / (ROWS_HZ * step)), 1)


def _thinned(signals: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    every = _samples_to_a_row(step)
    if every > 1:
        signals = _low_passed(PASSED / every, signals)
    edge = round(CUT_S / step)
    return signals[..., edge : signals.shape[-1] - edge : every]


def _low_passed(cutoff: float, signals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signals (..., n) without what is faster than ``cutoff``, a share of half the sampling rate, and no later."""
    # Takes a second to import, which a diagnosis on dwells would wait for.
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(_ORDER, cutoff, output="sos"), signals, axis=-1))
