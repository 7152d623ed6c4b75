"""The measured motion of a plant with one coordinate, and the force that its drive needed for it.

A friction is sharper than the rows are dense, so that a model is evaluated at every sample, and its force goes
through the same low-pass and thinning as the measured one: both sides of M a + ... = F see the same filter, and it
moves no parameter. How a motion is made of a recording is in :mod:`savgs_ident.responses.recorded_motion`.

Times and frequencies below are those of a slow motion; a faster one has a time scale of its own, by which its times
are multiplied and its frequencies divided.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning

ROWS_HZ = 100.0
"""Rows per second [Hz]."""

BLOCK_S = 1.0
"""Rows of so much time [s] are left out together, as one test."""

PASSED = 0.8
"""The rows' low-pass, as a share of half their rate."""

CUT_S = 0.2
"""What is cut off at both ends, where the filters have no neighbours [s]."""

UNEVEN = 0.01
"""Largest departure of a time from an even grid, in steps, up to which samples are taken as they are."""

UNSEEN = 0.02
"""Share of a row that may be of samples at rest."""

_ORDER = 4


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
        return samples_to_a_row(self._scaled_step)

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
            [thinned(signals[..., test], self._scaled_step) for test in self._tests], axis=-1
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
    weights, scale = (
        np.array([each.row_times.size for each in motions]),
        min(each.time_scale for each in motions),
    )
    # A row of fewer samples has more of their noise.
    spacing = samples_to_a_row(step / scale) * step
    noises = [each.noise * np.sqrt(each.every * each.step / spacing) for each in motions]
    noise = float(np.sqrt(np.average(np.square(noises), weights=weights)))
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
        scale,
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


def samples_to_a_row(step: float) -> int:
    """Samples to a row, where there is one every ``step`` [s] on a time scale of 1."""
    return max(round(1.0 / (ROWS_HZ * step)), 1)


def thinned(signals: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Signals (..., n) of any unit, a sample every ``step`` [s] on a time scale of 1, as rows (..., m)."""
    every = samples_to_a_row(step)
    if every > 1:
        signals = low_passed(PASSED / every, signals)
    edge = round(CUT_S / step)
    return signals[..., edge : signals.shape[-1] - edge : every]


def low_passed(cutoff: float, signals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Signals (..., n) without what is faster than ``cutoff``, a share of half the sampling rate, and no later."""
    # Takes a second to import, which a diagnosis on dwells would wait for.
    from scipy.signal import butter, sosfiltfilt

    return np.asarray(sosfiltfilt(butter(_ORDER, cutoff, output="sos"), signals, axis=-1))
