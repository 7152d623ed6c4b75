"""The part of a response that a command is asked to look at."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.responses.harmonic_response import HarmonicResponse

_FIELDS = (
    "frequency", "frequency_sd", "harmonics", "covariance", "valid", "peak_to_peak", "peak_to_peak_sd",
    "noise_sd", "periods",
)  # fmt: skip


def up_to_frequency(response: HarmonicResponse, highest: float | None) -> HarmonicResponse:
    """The dwells up to ``highest`` [Hz], all of them if it is None.

    Raises :class:`InputError` if none is left.
    """
    if highest is None:
        return response
    kept = np.flatnonzero(response.frequency <= highest * (1.0 + 1e-3))
    if kept.size == 0:
        raise InputError(
            f"no dwell is at {highest:g} Hz or below",
            source="--max-frequency",
            remedy=f"the slowest dwell is at {response.frequency[0]:.3g} Hz",
        )
    return _only(response, kept)


def every_so_many(response: HarmonicResponse, step: int) -> HarmonicResponse:
    """Every ``step``-th dwell, the last one among them: it is the fastest."""
    count = response.frequency.size
    return _only(response, np.arange((count - 1) % step, count, step))


def _only(response: HarmonicResponse, kept: NDArray[np.int64]) -> HarmonicResponse:
    dof = None if response.covariance_dof is None else response.covariance_dof[kept]
    return replace(
        response,
        tests=tuple(response.tests[d] for d in kept),
        covariance_dof=dof,
        **{name: getattr(response, name)[kept] for name in _FIELDS},
    )
