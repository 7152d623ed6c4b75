"""The noise of the sensors at rest: what a straight line leaves of a standstill, spikes and dropouts left out."""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwell_fit import smallest_density
from savgs_ident.responses.outliers import WaveformSamples, can_leave_out, check_outliers, find_outliers

_FEWEST_SAMPLES = 16


def estimate_standstill_noise(campaign: Campaign) -> tuple[dict[str, float], tuple[DataWarning, ...]]:
    """Standard deviation of each channel about its trend, the largest over the standstill records [its unit].

    With a warning for every channel of a record in which samples are left out.
    """
    noise: dict[str, float] = {}
    warnings: tuple[DataWarning, ...] = ()
    for recording in campaign.of_kind("standstill"):
        outliers = {}
        for name, channel in recording.channels.items():
            usable = np.isfinite(channel.values)
            if np.count_nonzero(usable) < _FEWEST_SAMPLES:
                continue
            spread, out = _spread(channel.time[usable], channel.values[usable])
            noise[name] = max(spread, noise.get(name, 0.0))
            if np.any(out):
                outliers[name] = out
        warnings += check_outliers(campaign.source, recording, outliers)
    return noise, warnings


def _spread(time: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[float, NDArray[np.bool_]]:
    """Standard deviation [unit] of ``values`` about their trend over ``time`` [s], and the outliers, both (N,)."""

    def residual(out: NDArray[np.bool_]) -> NDArray[np.float64]:
        trend = np.polynomial.Polynomial.fit(time[~out], values[~out], 1)
        left: NDArray[np.float64] = values - trend(time)
        return left

    none = np.zeros(time.size, dtype=np.bool_)
    floor = float(np.sqrt(smallest_density(values[None])[0]))
    out = find_outliers(WaveformSamples(time, values, None, floor), residual(none), none, residual)
    left_out = out if can_leave_out(out) else none
    return float(np.std(residual(left_out)[~left_out])), out
