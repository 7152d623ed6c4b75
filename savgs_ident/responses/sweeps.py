"""Sweeps to a response: the local first harmonic relative to the road, at the road's instantaneous phase.

The phase comes from the road's crossings of mid stroke, refined within windows of a few cycles
(:mod:`sweep_phase`); within the same windows every channel is fitted by harmonics of that phase (:mod:`sweep_fit`),
spikes and dropouts left out (:mod:`robust_sweep`).
"""

import numpy as np

from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.harmonic_response import SweepResponse
from savgs_ident.responses.outliers import check_outliers
from savgs_ident.responses.robust_sweep import (
    find_channel_outliers,
    follow_road_robustly,
    relative_miss,
    without,
)
from savgs_ident.responses.sweep_fit import channel_response
from savgs_ident.responses.sweep_phase import RoadPhase

_MISS, _TYPICAL_MISSES, _LARGEST_MISS = 0.05, 5.0, 0.35
"""What the fit may leave of the road in a window, rms over amplitude: so much more than so many times the median over
the windows, and at most half of what it leaves where it explains nothing."""
_MOST_LOST = 0.5
"""Share of the windows in which the road may not be followed."""


def estimate_sweep_response(
    recording: Recording, driven: str, cycles: float = 4.0, overlap: float = 0.5, source: str = ""
) -> SweepResponse:
    """First harmonic of each channel per unit of the input ``driven``, called the road below, along one sweep.

    ``cycles`` is the length of a window in cycles of the road, ``overlap`` the share that neighbours have in
    common (their errors are correlated accordingly). The road's amplitude is taken as constant within a
    window, as a cam makes it.

    The standard deviation comes from the residual between the harmonics (orders 1/2, 3/2, 5/2), averaged over
    three windows to either side: about 20 degrees of freedom. It does not contain two biases. First, the
    response to a sweep is not the steady one: for a linear system H it is H - (i/2) (dw/dt) H''(w) + ..., so
    that peaks come later in the direction of the sweep, the more the faster it is and the sharper they are;
    and the transient of the start has to die out. Second, curvature of the response within a window, about
    H''(w) (dw/dt)^2 T^2 / 24 for a window of T seconds. Compare a sweep with a simulated sweep that went
    through this same function: both biases then cancel.

    Spikes and dropouts are left out with the warning ``outlying_samples`` or ``unreliable_sensor``, windows in
    which the road does not oscillate with ``road_not_followed``.

    Raises :class:`InputError` when the road is missing, moves fewer than ``cycles`` + 1 cycles or cannot be followed.
    """
    road = _usable(recording.channels.get(driven))
    if road is None or np.ptp(road.values) == 0.0:
        raise InputError(
            "the sweep has no road motion to refer to",
            source=source,
            test=recording.name,
            channel=driven,
            remedy="map the road channel, or leave this test out",
        )
    phase, out = follow_road_robustly(recording.name, road, cycles, overlap, source)
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
        road_amplitude=np.array([abs(local.amplitude) for local in phase.local]),
        response=np.stack([column[0] for column in columns], axis=1),
        response_sd=np.stack([column[1] for column in columns], axis=1),
        valid=np.stack([column[2] for column in columns], axis=1),
        warnings=(*check_outliers(source, recording, outliers), *lost),
    )


def _followed(
    test: str, driven: str, phase: RoadPhase, source: str
) -> tuple[RoadPhase, tuple[DataWarning, ...]]:
    """The windows in which the phase follows the road, with a warning about the others.

    Raises :class:`InputError` where these are the most.
    """
    miss = relative_miss(phase)
    kept = miss <= min(_MISS + _TYPICAL_MISSES * float(np.median(miss)), _LARGEST_MISS)
    lost = int(np.count_nonzero(~kept))
    if lost == 0:
        return phase, ()
    what = f"the road does not oscillate steadily in {lost} of {kept.size} windows"
    first = phase.local[int(np.argmin(kept))].middle
    remedy = "check the sensor of the road and the logger"
    if lost > _MOST_LOST * kept.size:
        raise InputError(what, source=source, test=test, channel=driven, time=first, remedy=remedy)
    code = "road_not_followed"
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
