"""Sweeps to a response: the local first harmonic relative to the driven input, at its instantaneous phase.

The phase comes from the crossings of mid stroke, refined within windows of a few cycles (:mod:`sweep_phase`).
Within the same windows every channel is fitted by

    y(t) = sum_{h=1..m} Re[(Y_h + Y'_h s) exp(i h theta(s))] + offset + drift s,

theta being the phase of the driven input and s the time since the middle of the window; the response is Y_1 over its
amplitude there.

Spikes and dropouts (:mod:`outliers`) are found in the residual of a channel's local fits and left out of others. The
steps of a friction, which have more orders than the fits, are found again at the same phase of the periods nearby.
Outliers of the driven channel come first, because they move the phase that all fits follow. Median filters make first
guesses of the phase, the one that fits the filtered input best is taken, then outliers and phase are found in turn
until the same samples stand out. The phase that is used is that of the recorded samples without the outliers; a sweep
in which no sample stands out keeps its plain response, number for number.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.dwell_fit import smallest_density
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.responses.outliers import WaveformSamples, can_leave_out, check_outliers, find_outliers
from savgs_ident.responses.sweep_phase import InputPhase, LocalPhase, follow_input, normal_products

_MISS, _TYPICAL_MISSES, _LARGEST_MISS = 0.05, 5.0, 0.35
"""What the fit may leave of the driven input in a window, rms over amplitude: so much more than so many times the
median over the windows, and at most half of what it leaves where it explains nothing."""
_MOST_LOST = 0.5
"""Share of the windows in which the driven input may not be followed."""
_NOT_FOLLOWED = {"road_height": "road_not_followed"}
"""Codes of warnings are contract: that of the road is older than sweeps of other inputs."""


def estimate_sweep_response(
    recording: Recording, driven: str, cycles: float = 4.0, overlap: float = 0.5, source: str = ""
) -> SweepResponse:
    """First harmonic of each channel per unit of the input ``driven`` along one sweep.

    ``cycles`` is the length of a window in cycles of that input, ``overlap`` the share that neighbours have in
    common (their errors are correlated accordingly). Its amplitude is taken as constant within a window.

    The standard deviation comes from the residual between the harmonics (orders 1/2, 3/2, 5/2), averaged over
    three windows to either side: about 20 degrees of freedom. It does not contain two biases. First, the
    response to a sweep is not the steady one: for a linear system H it is H - (i/2) (dw/dt) H''(w) + ..., so
    that peaks come later in the direction of the sweep, the more the faster it is and the sharper they are;
    and the transient of the start has to die out. Second, curvature of the response within a window, about
    H''(w) (dw/dt)^2 T^2 / 24 for a window of T seconds. Compare a sweep with a simulated sweep that went
    through this same function: both biases then cancel.

    Spikes and dropouts are left out with the warning ``outlying_samples`` or ``unreliable_sensor``, windows in
    which the driven input does not oscillate with ``road_not_followed`` (``input_not_followed`` where it is no road).

    Raises :class:`InputError` when that input is missing, moves fewer than ``cycles`` + 1 cycles or cannot be
    followed.
    """
    lead = _usable(recording.channels.get(driven))
    if lead is None or np.ptp(lead.values) == 0.0:
        raise InputError(
            f"the sweep has no motion of {driven} to refer to",
            source=source,
            test=recording.name,
            channel=driven,
            remedy="map its channel, or leave this test out",
        )
    phase, out = follow_input_robustly(recording.name, lead, cycles, overlap, source)
    phase, lost = _followed(recording.name, driven, phase, source)
    names = [name for name in recording.channels if name != driven]
    usable = {name: each for name in names if (each := _usable(recording.channels[name])) is not None}
    found = {name: find_channel_outliers(each, phase) for name, each in usable.items()}
    kept = {name: without(each, found[name]) for name, each in usable.items()}
    columns = [channel_response(kept.get(name), phase) for name in names]
    outliers = {name: mask for name, mask in ({driven: out} | found).items() if np.any(mask)}
    return SweepResponse(
        test=recording.name,
        channels=tuple(names),
        time=np.array([local.middle for local in phase.local]),
        frequency=np.array([local.speed for local in phase.local]) / (2 * np.pi),
        frequency_sd=np.array([local.speed_sd for local in phase.local]) / (2 * np.pi),
        sweep_rate=np.array([local.acceleration for local in phase.local]) / (2 * np.pi),
        window_s=phase.windows[:, 1] - phase.windows[:, 0],
        input_amplitude=np.array([abs(local.amplitude) for local in phase.local]),
        response=np.stack([column[0] for column in columns], axis=1),
        response_sd=np.stack([column[1] for column in columns], axis=1),
        valid=np.stack([column[2] for column in columns], axis=1),
        warnings=(*check_outliers(source, recording, outliers), *lost),
    )


def _followed(
    test: str, driven: str, phase: InputPhase, source: str
) -> tuple[InputPhase, tuple[DataWarning, ...]]:
    """The windows in which the phase follows the driven input, with a warning about the others.

    Raises :class:`InputError` where these are the most.
    """
    miss = relative_miss(phase)
    kept = miss <= min(_MISS + _TYPICAL_MISSES * float(np.median(miss)), _LARGEST_MISS)
    lost = int(np.count_nonzero(~kept))
    if lost == 0:
        return phase, ()
    what = f"{driven} does not oscillate steadily in {lost} of {kept.size} windows"
    first = phase.local[int(np.argmin(kept))].middle
    remedy = f"check the sensor of {driven} and the logger"
    if lost > _MOST_LOST * kept.size:
        raise InputError(what, source=source, test=test, channel=driven, time=first, remedy=remedy)
    code = _NOT_FOLLOWED.get(driven, "input_not_followed")
    return phase.only(kept), (DataWarning(code, f"{what}, left out", source, test, driven, first, remedy),)


def _usable(channel: RecordedChannel | None) -> RecordedChannel | None:
    """The channel without samples that are not finite."""
    if channel is None:
        return None
    keep = np.isfinite(channel.values) & np.isfinite(channel.time)
    if np.count_nonzero(keep) < 2:
        return None
    return RecordedChannel(
        channel.name, channel.unit, channel.time[keep], channel.values[keep], channel.source
    )


_ORDERS = 7
_TRUSTED_SHARE = 0.40
_HALF_ORDERS = (0.5, 1.5, 2.5)
_NEIGHBOURS = 3


def channel_response(
    channel: RecordedChannel | None, along: InputPhase
) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
    """Response, standard deviation and validity of one channel at every window, each (W,)."""
    count = len(along.local)
    response = np.zeros(count, dtype=np.complex128)
    gain, density = np.zeros(count), np.full(count, np.nan)
    if channel is None:
        return response, gain, np.zeros(count, dtype=np.bool_)
    for w, (phase, (start, end)) in enumerate(zip(along.local, along.windows, strict=True)):
        inside = slice(*np.searchsorted(channel.time, [start, end]))
        time = channel.time[inside]
        orders = _sampled_orders(time, phase.speed / (2 * np.pi))
        if orders < 1:
            continue
        first, gain[w], density[w] = _local_harmonic(time, channel.values[inside], phase, orders)
        response[w] = first / phase.amplitude
        gain[w] /= abs(phase.amplitude)
    valid = np.isfinite(density)
    return response, gain * np.sqrt(_moving_mean(density)), valid


def _sampled_orders(time: NDArray[np.float64], frequency: float) -> int:
    """Orders to fit in a window, 0 if the sampling does not resolve the first."""
    if time.size < 8:
        return 0
    rate = (time.size - 1) / float(time[-1] - time[0])
    by_rate = int(_TRUSTED_SHARE * rate / frequency)
    by_count = (time.size // 3 - 2) // 4
    return max(min(_ORDERS, by_rate, by_count), 0)


def _local_harmonic(
    time: NDArray[np.float64], values: NDArray[np.float64], phase: LocalPhase, orders: int
) -> tuple[complex, float, float]:
    """First harmonic at mid-window, its standard deviation for unit noise, and the noise density [unit^2].

    All products of basis, probes between the harmonics and signal are taken at once. The probes' part that
    is orthogonal to the basis has the products S = G_pp - G_pb G_bb^-1 G_bp, and with the residual v; the noise
    power estimated with m probes is v' S^-1 v / m.
    """
    halves = [half for half in _HALF_ORDERS if half < orders + 1]
    basis, probes = _local_basis(time, phase, orders), _waves(phase.at(time), halves)
    products = normal_products(np.column_stack([basis, probes, values]))
    size = basis.shape[1]
    inverse = np.linalg.inv(products[:size, :size])
    weights = inverse @ products[:size, -1]
    across = products[size:-1, :size]
    innovation = products[size:-1, -1] - across @ weights
    free = products[size:-1, size:-1] - across @ inverse @ across.T
    density = float(innovation @ np.linalg.solve(free, innovation)) / innovation.size
    spread = 0.5 * (inverse[0, 0] + inverse[orders, orders])
    return complex(weights[0], -weights[orders]), float(np.sqrt(spread)), density


def _local_basis(time: NDArray[np.float64], phase: LocalPhase, orders: int) -> NDArray[np.float64]:
    """Columns of the fit at ``time`` [s], (n,): waves, waves times s, 1 and s, all within 1; (n, 4 orders + 2)."""
    unit = (time - phase.middle) / float(np.max(np.abs(time - phase.middle)))
    waves = _waves(phase.at(time), range(1, orders + 1))
    return np.column_stack([waves, waves * unit[:, None], np.ones_like(unit), unit])


def _waves(angle: NDArray[np.float64], orders: Sequence[float]) -> NDArray[np.float64]:
    """Cosines, then sines, of the ``orders`` of an ``angle`` [rad], (n,); (n, 2 orders)."""
    turns = np.exp(1j * np.outer(angle, orders))
    return np.concatenate([turns.real, turns.imag], axis=1)


def _moving_mean(density: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean over the known values of the windows nearby; 0 where none is known."""
    known = np.isfinite(density)
    ones = np.ones(2 * _NEIGHBOURS + 1)
    total = np.convolve(np.where(known, density, 0.0), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    count = np.convolve(known.astype(np.float64), ones, mode="full")[_NEIGHBOURS:-_NEIGHBOURS]
    mean: NDArray[np.float64] = total / np.maximum(count, 1.0)
    return mean


@dataclass(frozen=True)
class WindowBasis:
    """The samples ``inside`` a window, those ``nearest`` to its middle, and the columns of the fit, (n, p)."""

    inside: slice
    nearest: slice
    columns: NDArray[np.float64]


def window_bases(time: NDArray[np.float64], along: InputPhase) -> tuple[WindowBasis, ...]:
    """The windows of a channel sampled at ``time`` [s], (N,), those without a resolved order left out."""
    middles = np.array([phase.middle for phase in along.local])
    bounds = np.concatenate([along.windows[:1, 0], 0.5 * (middles[1:] + middles[:-1]), along.windows[-1:, 1]])
    first, last = np.searchsorted(time, along.windows.T)
    halfway = np.searchsorted(time, bounds)
    bases = []
    for w, phase in enumerate(along.local):
        inside = slice(int(first[w]), int(last[w]))
        nearest = slice(max(int(halfway[w]), inside.start), min(int(halfway[w + 1]), inside.stop))
        orders = _sampled_orders(time[inside], phase.speed / (2 * np.pi))
        if orders >= 1:
            bases.append(WindowBasis(inside, nearest, _local_basis(time[inside], phase, orders)))
    return tuple(bases)


def local_residual(
    values: NDArray[np.float64], bases: tuple[WindowBasis, ...], out: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Residual of each sample [unit], (N,), from the fit of the window nearest to it, 0 outside the windows.

    The fits are without the samples that are ``out``, (N,). Raises :class:`numpy.linalg.LinAlgError` when those left
    do not determine one.
    """
    residual = np.zeros_like(values)
    for basis in bases:
        inside, nearest, used = values[basis.inside], basis.nearest, ~out[basis.inside]
        products = normal_products(np.column_stack([basis.columns, inside])[used])
        weights = np.linalg.solve(products[:-1, :-1], products[:-1, -1])
        start = basis.inside.start
        columns = basis.columns[nearest.start - start : nearest.stop - start]
        residual[nearest] = values[nearest] - np.sum(columns * weights, axis=1)
    return residual


_FILTERS = (11, 5, 1)
"""Samples of the median filters: dropouts of five and of two samples do not pass, and everything does."""
_MOST_REFITS = 4
_ALIKE, _DRIFT = 3.0, 0.01
"""Periods to either side that have nearly the same waveform, and how far [periods] its features move meanwhile."""
_OFF_FILTERED = 0.1
"""How far a sample before or after the windows may be off the filtered input, in peak-to-peak values."""


def follow_input_robustly(
    test: str, lead: RecordedChannel, cycles: float, overlap: float, source: str
) -> tuple[InputPhase, NDArray[np.bool_]]:
    """Phase of the driven channel as :func:`follow_input` has it, and which of its samples are outliers, (N,).

    Raises :class:`InputError` as :func:`follow_input` does.
    """
    smooth, phase = _first_phase(test, lead, cycles, overlap, source)
    out = np.zeros(lead.values.size, dtype=np.bool_)
    for _ in range(_MOST_REFITS):
        before, out = out, _outliers_of_input(lead, smooth, phase)
        phase = follow_input(test, without(lead, out), cycles, overlap, source)
        if np.array_equal(before, out):
            break
    return phase, out


def _first_phase(
    test: str, lead: RecordedChannel, cycles: float, overlap: float, source: str
) -> tuple[RecordedChannel, InputPhase]:
    """The median-filtered input that a phase follows best, and this phase."""
    # A fifth of a second to import, for sweeps alone.
    from scipy.ndimage import median_filter

    guesses = []
    for width in _FILTERS:
        smooth = replace(lead, values=median_filter(lead.values, width))
        try:
            guesses.append((smooth, follow_input(test, smooth, cycles, overlap, source)))
        except InputError as error:
            refusal = error
    if not guesses:
        raise refusal
    return min(guesses, key=lambda guess: float(np.mean(relative_miss(guess[1]))))


def relative_miss(phase: InputPhase) -> NDArray[np.float64]:
    """What the fit leaves of the driven input in each window, rms over amplitude [1], (W,)."""
    miss = np.array([local.miss for local in phase.local])
    size = np.array([abs(local.amplitude) for local in phase.local])
    relative: NDArray[np.float64] = np.divide(miss, size, out=np.full_like(miss, np.inf), where=size > 0.0)
    return relative


def _outliers_of_input(
    lead: RecordedChannel, smooth: RecordedChannel, phase: InputPhase
) -> NDArray[np.bool_]:
    """The outliers within the windows, and before and after them what is far off the ``smooth`` input, (N,)."""
    outside = (lead.time < phase.windows[0, 0]) | (lead.time > phase.windows[-1, 1])
    far = np.abs(lead.values - smooth.values) > _OFF_FILTERED * np.ptp(smooth.values)
    out: NDArray[np.bool_] = find_channel_outliers(lead, phase) | (outside & far)
    return out


def find_channel_outliers(channel: RecordedChannel, along: InputPhase) -> NDArray[np.bool_]:
    """Which samples of a channel within the windows are outliers, (N,).

    There are none where the samples left would not determine the fits.
    """
    out = np.zeros(channel.values.size, dtype=np.bool_)
    bases = window_bases(channel.time, along)
    fitted = _fitted(out.size, bases)
    if not np.any(fitted):
        return out
    time, values = channel.time[fitted], channel.values[fitted]

    def refit(some: NDArray[np.bool_]) -> NDArray[np.float64]:
        everywhere = np.zeros_like(out)
        everywhere[fitted] = some
        return local_residual(channel.values, bases, everywhere)[fitted]

    floor = float(np.sqrt(smallest_density(values[None])[0]))
    samples = WaveformSamples(time, values, along.periods_at(time), floor, _ALIKE, _DRIFT)
    none = np.zeros(time.size, dtype=np.bool_)
    try:
        out[fitted] = find_outliers(samples, refit(none), none, refit)
    except np.linalg.LinAlgError:
        return out
    return out


def _fitted(count: int, bases: tuple[WindowBasis, ...]) -> NDArray[np.bool_]:
    """Which of ``count`` samples are in a window."""
    fitted = np.zeros(count, dtype=np.bool_)
    for basis in bases:
        fitted[basis.nearest] = True
    return fitted


def without(channel: RecordedChannel, out: NDArray[np.bool_]) -> RecordedChannel:
    """The channel without the samples that are ``out``, (N,); the whole of it where they are too many."""
    if not can_leave_out(out):
        return channel
    return replace(channel, time=channel.time[~out], values=channel.values[~out])
