"""The measured motion of a servo axis, and the force that its drive needed for it.

Under closed loop the position hides what a model lacks: the controller makes the carriage follow whatever the
friction. The force shows it. So the measured motion is taken as it is, and the force that a model says it takes is
compared with the force that it did take.

The position is filtered without phase and differentiated centrally
(:class:`savgs_ident.responses.driven_motion.DrivenMotion`).

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

from collections.abc import Sequence
from dataclasses import replace
from math import ceil, log2
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.axis_recording import AxisRecording, is_axis, read_axis
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.driven_motion import (
    CUT_S,
    UNEVEN,
    DrivenMotion,
    low_passed,
    samples_to_a_row,
    thinned,
)
from savgs_ident.responses.resolution import NORMAL, noise_of_rate, noise_of_speed, roughness, unresolved

CUTOFF_HZ = 100.0
"""The position passes up to here [Hz]."""

SHARE_OF_RATE = 0.4
"""Or up to this share of the sampling rate, where that is less."""

FAST_HZ = 5.0
"""Above this the middle of a motion's spectrum [Hz] is that of a fast one: a row and a cutoff of twenty a period."""

SAME = 1e-6
"""Mean square difference between two cycles of the reference, in its variance, up to which they are the same."""

SAME_AS_MEASURED = 1e-4
"""The same of a measured motion, which has noise and is not led the same way twice."""

SELDOM = 0.05
"""Share of the time at rest from which on it is said."""

_FEWEST = 100


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
    if measured.size * scaled < 2.0 * CUT_S + _FEWEST * samples_to_a_row(scaled) * scaled:
        raise InputError("is too short", source=source, remedy="record some seconds at least")
    cutoff = _cutoff(step, time_scale)
    position = low_passed(2.0 * cutoff * step, measured)
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
    noise = roughness(thinned(left, scaled))
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
    apart = thinned(left[period:] - left[:-period], step)
    return float(NORMAL * np.median(np.abs(apart)) / np.sqrt(2.0))
