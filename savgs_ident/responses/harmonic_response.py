"""Measured responses: complex harmonics of dwells with their covariance, and local harmonics along a sweep.

Convention: a channel x(t) of a dwell with fundamental f is

    x(t) = X_0 + Re sum_{k=1..n} X_k exp(2 pi i k f t),

with the time origin of every dwell moved so that the fundamental of the driven input is real and positive.

:func:`peak_to_peak` evaluates a waveform from its harmonics. Measured and predicted responses use the same
function with the same orders, so that a steep flank, which needs many orders, is truncated alike on both sides.
Noise in the harmonics biases a measured peak-to-peak upwards; :func:`unbiased_peak_to_peak` subtracts that bias.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning


class ComparedPart(NamedTuple):
    """The part of each of D tests in which readings are compared, and at which frequencies.

    Attributes:
        begin: phase at which it begins [rad], (D,).
        end: phase at which it ends [rad], (D,).
        every: from one order of the readings to the next, in orders of the test [1], (D,).
        begins_at_rest: 1 where the plant rested when the window began, 0 elsewhere [1], (D,).
        begins_moving: 1 where the state with which the window begins is estimated, 0 elsewhere [1], (D,).

    How the motion began in a window that begins neither way nobody knows, and it is forgotten.

    Of a window it is a part. Of a dwell beside windows it begins so long before the period and ends so long after it
    (:data:`WHOLE_PERIOD`) that every instant counts alike, and every order is compared.
    """

    begin: NDArray[np.float64]
    end: NDArray[np.float64]
    every: NDArray[np.float64]
    begins_at_rest: NDArray[np.float64]
    begins_moving: NDArray[np.float64]

    @property
    def opens(self) -> NDArray[np.bool_]:
        """Which of the tests begin with a state that is known or estimated, (D,): they do not lead back to it."""
        return self.begins_at_rest + self.begins_moving > 0.0

    @property
    def repeats(self) -> NDArray[np.bool_]:
        """Which of the tests repeat, (D,): the dwells among them."""
        return self.end - self.begin > 2.0 * np.pi


WHOLE_PERIOD = ComparedPart(*(np.array([each]) for each in (-10.0 * np.pi, 12.0 * np.pi, 1.0, 0.0, 0.0)))
"""That of one dwell."""


@dataclass(frozen=True)
class InitialStates:
    """The states with which D tests begin, where they are estimated, and what others would change in C channels.

    Attributes:
        states: of the plant, (D, m), in SI; zero for tests of which none is estimated.
        changes: of the harmonics by a typical size of each state [unit of the channel], (D, C, K, m), channels in the
            order of the plant's.
    """

    states: NDArray[np.float64]
    changes: NDArray[np.complex128]

    def of_tests(self, kept: NDArray[np.integer]) -> "InitialStates":
        """Of some of the tests, by their places."""
        return InitialStates(self.states[kept], self.changes[kept])


@dataclass(frozen=True)
class HarmonicResponse:
    """Harmonics of D tests, C channels, orders 0..n: dwells, and after them windows of tests that do not repeat.

    Attributes:
        tests: names of the tests, length D, the dwells sorted by frequency.
        channels: names of the channels, length C.
        frequency: measured fundamental [Hz], (D,).
        frequency_sd: its standard deviation [Hz], (D,).
        harmonics: complex amplitudes [unit of the channel], (D, C, n + 1); order 0 is the (real) mean.
        covariance: covariance of (Re, Im) [unit^2], (D, C, n + 1, 2, 2).
        valid: which entries the sampling of the channel supports, (D, C, n + 1); the others are 0.
        peak_to_peak: of the harmonic reconstruction with valid orders, noise bias removed [unit], (D, C).
        peak_to_peak_sd: its standard deviation [unit], (D, C).
        noise_sd: standard deviation of the noise (what does not repeat) of one sample [unit], (D, C).
        periods: whole periods in the record, (D,).
        warnings: findings of the checks.
        covariance_dof: degrees of freedom of the noise level behind ``covariance``, (D, C, n + 1): its
            relative variance is 2 / dof. None where the covariance is known rather than estimated. A
            quadratic form weighted with the inverse of an estimated covariance is too large by
            dof / (dof - 2) on average.
        recorded: when each test was recorded, (D,): its start [s since 1970] where all tests but standstills have
            one, otherwise its place among them in the campaign [1]; None where neither is known.
        part: of each test that is compared: there the ``harmonics`` of readings are those of :func:`compared_share`
            times the reading, at every so many-th order; those of inputs are not. None where all tests are dwells.
        beside: mean of what was recorded beside the plant's channels in each test [its unit], (D,) by name; NaN
            where it was not.
        initial_states: the states with which tests begin that do not begin at rest; None where none is estimated.
    """

    tests: tuple[str, ...]
    channels: tuple[str, ...]
    frequency: NDArray[np.float64]
    frequency_sd: NDArray[np.float64]
    harmonics: NDArray[np.complex128]
    covariance: NDArray[np.float64]
    valid: NDArray[np.bool_]
    peak_to_peak: NDArray[np.float64]
    peak_to_peak_sd: NDArray[np.float64]
    noise_sd: NDArray[np.float64]
    periods: NDArray[np.int64]
    warnings: tuple[DataWarning, ...] = ()
    covariance_dof: NDArray[np.float64] | None = None
    recorded: NDArray[np.float64] | None = None
    part: ComparedPart | None = None
    beside: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    initial_states: InitialStates | None = None

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def orders(self) -> int:
        """The highest order held, n."""
        return int(self.harmonics.shape[2]) - 1

    @property
    def times(self) -> NDArray[np.float64]:
        """When each dwell was recorded, in any unit of time; their order where that is not known, (D,)."""
        return np.arange(float(len(self.tests))) if self.recorded is None else self.recorded

    @property
    def dwells(self) -> NDArray[np.intp]:
        """Places of the tests that repeat."""
        return np.flatnonzero(self._repeats)

    @property
    def windows(self) -> NDArray[np.intp]:
        """Places of the tests that do not, and are windows of longer ones."""
        return np.flatnonzero(~self._repeats)

    @property
    def _repeats(self) -> NDArray[np.bool_]:
        return np.ones(len(self.tests), np.bool_) if self.part is None else self.part.repeats

    @property
    def spacing(self) -> NDArray[np.float64]:
        """From one order of the readings to the next [Hz], (D,)."""
        return self.frequency if self.part is None else self.frequency * self.part.every

    def last_compared(self, places: Sequence[int]) -> int:
        """The highest order of the channels at these ``places`` in which anything can be compared.

        Inputs of windows hold many more, which ``orders`` counts.
        """
        return int(np.flatnonzero(self.valid[:, places].any(axis=(0, 1)))[-1])

    def channel(self, name: str) -> int:
        """The index of a channel on the second axis; raises ``ValueError`` if it is absent."""
        return self.channels.index(name)


@dataclass(frozen=True)
class SweepResponse:
    """Local first harmonics at W instants of a sweep, for C channels.

    Attributes:
        test: name of the test.
        channels: names of the channels, length C, without the driven input itself.
        time: middle of each window on the recording's own clock [s], (W,).
        frequency: instantaneous frequency of the driven input there [Hz], (W,).
        frequency_sd: its standard deviation [Hz], (W,).
        sweep_rate: its rate of change [Hz/s], (W,).
        window_s: duration of each window [s], (W,).
        input_amplitude: of the first harmonic of the driven input [its unit], (W,).
        response: complex first harmonic of the channel over that of the driven input [unit per its unit], (W, C).
        response_sd: standard deviation of its real part, equal to that of its imaginary part, (W, C).
        valid: which entries the sampling of the channel supports, (W, C); the others are 0.
        warnings: findings of the checks.
    """

    test: str
    channels: tuple[str, ...]
    time: NDArray[np.float64]
    frequency: NDArray[np.float64]
    frequency_sd: NDArray[np.float64]
    sweep_rate: NDArray[np.float64]
    window_s: NDArray[np.float64]
    input_amplitude: NDArray[np.float64]
    response: NDArray[np.complex128]
    response_sd: NDArray[np.float64]
    valid: NDArray[np.bool_]
    warnings: tuple[DataWarning, ...] = ()

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def channel(self, name: str) -> int:
        """The index of a channel on the second axis; raises ``ValueError`` if it is absent."""
        return self.channels.index(name)


def signal_to_noise(response: HarmonicResponse) -> NDArray[np.float64]:
    """|X_k| over the rms of its complex error, (D, C, n + 1); 0 where the entry is not valid.

    An order with a ratio below about 2 carries no information of its own. A covariance of zero (a noise-free
    response) gives infinity.
    """
    error = np.sqrt(np.trace(response.covariance, axis1=-2, axis2=-1))
    size = np.abs(response.harmonics)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = size / error
    return np.where(response.valid & (size > 0.0), ratio, 0.0)


TAPER = 0.05
"""Share of the part of a window that is compared in which its weight rises, and in which it falls."""


def compared_share(
    phase: NDArray[np.float64], begin: NDArray[np.float64] | float, end: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """With what share an instant counts [1] where readings are compared between two phases [rad]; smooth.

    All of one shape, (n,), or numbers. Written against the array API, as :func:`peak_to_peak` is.
    """
    xp = phase.__array_namespace__()
    rise = xp.minimum(phase - begin, end - phase) / (TAPER * (end - begin))
    share: NDArray[np.float64] = 0.5 - 0.5 * xp.cos(xp.pi * xp.clip(rise, 0.0, 1.0))
    return share


def share_amplitudes(part: ComparedPart, orders: int) -> NDArray[np.complex128]:
    """Orders 0..``orders`` of a reading that is one throughout each of D tests [1], (D, orders + 1)."""
    count = 8 * (1 + int(np.max(part.every)) * (orders + 1))
    phase = 2.0 * np.pi * np.arange(count) / count
    found = np.zeros((part.begin.size, orders + 1), np.complex128)
    for place, (begin, end, every) in enumerate(zip(part.begin, part.end, part.every, strict=True)):
        spectrum = 2.0 / count * np.fft.rfft(compared_share(phase, begin, end))
        found[place] = spectrum[:: int(every)][: orders + 1]
    found[:, 0] *= 0.5
    return found


DEFAULT_SAMPLES = 512
"""Points in a period: the extreme of a component of order k is found to within (pi k / 512)^2 / 2 of its own
amplitude."""


def peak_to_peak(
    harmonics: NDArray[np.complex128], valid: NDArray[np.bool_], samples: int = DEFAULT_SAMPLES
) -> NDArray[np.float64]:
    """Largest less smallest value of Re sum_k X_k exp(2 pi i k s), 0 <= s < 1, over orders 1..n.

    ``harmonics`` and ``valid`` have shape (..., n + 1), the mean first, n < ``samples`` / 2; orders that are
    not ``valid`` are left out. Returns shape (...), in the unit of ``harmonics``. Written against the array
    API: arrays of another library that follows it pass through, and stay differentiable there.
    """
    xp = harmonics.__array_namespace__()
    kept = harmonics * valid
    wave = xp.fft.irfft(kept, n=samples) * (0.5 * samples)
    extent: NDArray[np.float64] = xp.max(wave, axis=-1) - xp.min(wave, axis=-1)
    return extent


_PAIRS = 64
_SEED = 20170709


def unbiased_peak_to_peak(
    harmonics: NDArray[np.complex128], covariance: NDArray[np.float64], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Peak-to-peak with the noise bias subtracted, and its standard deviation, both (C,).

    Noise moves the extremes of the waveform, and the largest value of a noisy curve is on average too large. Bias
    and deviation are found by adding the estimated noise, with fixed draws in antithetic pairs (the part linear in
    the noise cancels in the mean exactly), to a waveform near the truth: each harmonic shrunk by its share of
    noise, 1 - E|dX|^2 / |X|^2 or zero, because orders of pure noise would otherwise hide part of the bias.

    ``harmonics`` and ``valid`` (C, n + 1), ``covariance`` (C, n + 1, 2, 2). Where noise dominates the
    waveform, only part of the bias can be removed; the result is never negative.
    """
    measured = peak_to_peak(harmonics, valid)
    draws = np.random.default_rng(_SEED).standard_normal((_PAIRS, harmonics.shape[1], 2))
    draws = np.concatenate([draws, -draws])
    noise, power = np.trace(covariance, axis1=-2, axis2=-1), np.abs(harmonics) ** 2
    shrunk = harmonics * np.maximum(1.0 - noise / np.where(power > 0.0, power, 1.0), 0.0)
    size, direction = np.linalg.eigh(covariance)
    root = direction * np.sqrt(np.maximum(size, 0.0))[..., None, :]
    shift = np.einsum("ckij,bkj->cbki", root, draws)
    noisy = shrunk[:, None] + shift[..., 0] + 1j * shift[..., 1]
    noisy_peaks = peak_to_peak(noisy, valid[:, None])
    bias = np.mean(noisy_peaks, axis=1) - peak_to_peak(shrunk, valid)
    return np.maximum(measured - bias, 0.0), np.std(noisy_peaks, axis=1)
