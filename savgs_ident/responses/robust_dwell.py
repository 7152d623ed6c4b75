"""One dwell without its spikes and dropouts.

The outliers of every channel (:mod:`outliers`) are found in the residual of the plain fit and left out of another
fit, until the same samples stand out of two fits in turn: outliers of the driven channel move the fundamental, which
moves the residuals of all channels. A dwell in which no sample stands out keeps the plain fit, number for number.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.dwell_fit import DwellFit, fit_dwell, smallest_density
from savgs_ident.responses.fundamental import ClockGroup
from savgs_ident.responses.outliers import Outliers, WaveformSamples, can_leave_out, find_outliers
from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis, signals

_MOST_REFITS = 4


@dataclass(frozen=True)
class RobustDwell:
    """A dwell fitted without its outliers.

    Attributes:
        fit: of the samples that are not outliers.
        groups: all samples, the outliers replaced by the fitted waveform.
        outliers: by channel.
    """

    fit: DwellFit
    groups: tuple[ClockGroup, ...]
    outliers: Outliers


def fit_robust_dwell(groups: tuple[ClockGroup, ...], road: str, start: float, orders: int) -> RobustDwell:
    """Fit all channels of a dwell near ``start`` [Hz] up to ``orders``, outliers left out.

    Raises :class:`numpy.linalg.LinAlgError` when the stamps do not determine the harmonics.
    """
    fit = fit_dwell(groups, road, start, orders)
    outliers = _first_outliers(groups, fit)
    for _ in range(_MOST_REFITS):
        if not outliers:
            break
        fit = fit_dwell(_without(groups, outliers), road, start, orders)
        before, outliers = outliers, _further_outliers(groups, fit, outliers)
        if _same(before, outliers):
            break
    return RobustDwell(fit, _mended(groups, fit, outliers) if outliers else groups, outliers)


def _first_outliers(groups: tuple[ClockGroup, ...], fit: DwellFit) -> Outliers:
    found = {}
    for group in groups:
        for name in (name for name in group.names if name in fit.channels):
            none = np.zeros(group.time.size, dtype=np.bool_)
            found[name] = _outliers(group, name, fit, fit.channels[name].residual, none)
    return {name: mask for name, mask in found.items() if np.any(mask)}


def _further_outliers(groups: tuple[ClockGroup, ...], fit: DwellFit, outliers: Outliers) -> Outliers:
    """The outliers at the fundamental of ``fit``, found from ``outliers`` on."""
    found = {}
    for group in groups:
        for name in (name for name in group.names if name in fit.channels):
            out = outliers.get(name, np.zeros(group.time.size, dtype=np.bool_))
            if can_leave_out(out):
                out = _outliers(group, name, fit, residual_without(group, name, fit, out), out)
            found[name] = out
    return {name: mask for name, mask in found.items() if np.any(mask)}


def _outliers(
    group: ClockGroup, name: str, fit: DwellFit, residual: NDArray[np.float64], out: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """As :func:`find_outliers`; none where the samples left would not determine the harmonics."""
    i = group.names.index(name)
    floor = float(np.sqrt(smallest_density(group.values[i : i + 1])[0]))
    samples = WaveformSamples(group.time, group.values[i], fit.frequency * group.time, floor)
    try:
        return find_outliers(samples, residual, out, lambda mask: residual_without(group, name, fit, mask))
    except np.linalg.LinAlgError:
        return np.zeros_like(out)


def residual_without(
    group: ClockGroup, name: str, fit: DwellFit, out: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Residual of all samples of a channel, (N,) [unit], from a fit to those that are not ``out`` (N,).

    The fundamental and the orders are those of ``fit``. Raises :class:`numpy.linalg.LinAlgError` when the samples
    left do not determine the harmonics.
    """
    highest, values = fit.channels[name].highest, group.values[group.names.index(name)]
    some = fit_periodic(
        plan_basis(group.time[~out], fit.frequency, highest), values[None, ~out], highest, gains_to=0
    )
    everywhere = plan_basis(group.time, fit.frequency, highest)
    fitted = signals(everywhere.plan, some.amplitude)[0] + some.slope[0] * group.time
    residual: NDArray[np.float64] = values - fitted
    return residual


def _same(one: Outliers, other: Outliers) -> bool:
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


def _without(groups: tuple[ClockGroup, ...], outliers: Outliers) -> tuple[ClockGroup, ...]:
    """The groups without ``outliers``, each channel with outliers by itself.

    A channel with too many of them keeps all its samples.
    """
    parts: list[ClockGroup] = []
    for group in groups:
        cleaned = [name for name in group.names if name in outliers and can_leave_out(outliers[name])]
        whole = [i for i, name in enumerate(group.names) if name not in cleaned]
        if whole:
            names = tuple(group.names[i] for i in whole)
            parts.append(ClockGroup(names, group.time, group.values[whole]))
        for name in cleaned:
            used = ~outliers[name]
            values = group.values[group.names.index(name)][None, used]
            left_out = int(np.count_nonzero(outliers[name]))
            parts.append(ClockGroup((name,), group.time[used], values, left_out))
    return tuple(parts)


def _mended(groups: tuple[ClockGroup, ...], fit: DwellFit, outliers: Outliers) -> tuple[ClockGroup, ...]:
    """The groups with outliers that were left out replaced by the fitted waveform."""
    mended = []
    for group in groups:
        values = group.values.copy()
        for i, name in enumerate(group.names):
            if name in outliers and name in fit.channels and can_leave_out(outliers[name]):
                out = outliers[name]
                values[i, out] -= residual_without(group, name, fit, out)[out]
        mended.append(replace(group, values=values))
    return tuple(mended)
