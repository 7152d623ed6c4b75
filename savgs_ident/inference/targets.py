"""What of a response is compared, and how predictions become residuals that are independent with unit variance.

They are complex harmonics with their covariances, less what nuisances make of them, or peak-to-peak values.
"""

from collections.abc import Sequence
from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.inference.observations import spanned
from savgs_ident.plants.base import Channel
from savgs_ident.responses.harmonic_response import HarmonicResponse, peak_to_peak, share_amplitudes

UNSEEN = 1e-6
"""Change [sd] of all that is compared of a test by a typical size of a state up to which nobody sees that state."""


class HarmonicTarget(eqx.Module):
    """Complex harmonics of orders 1..n with their 2 x 2 covariances.

    ``whitening`` (D, C, n + 1, 2, 2) is the inverse Cholesky factor of the covariance, 0 where not
    ``used``. Harmonics are in the unit of their reading, ``whitening`` in one over it. ``decay`` (C,) is the power
    of the order with which a discrepancy of the model falls in each channel of dwells; in ``windows``, by their
    places, it is a share of what is near it. ``nuisance`` (m, t) are directions of the residuals, perpendicular and
    of length one, in which these say nothing: what offsets of sensors and other initial states would change.
    """

    measured: Complex[Array, "D C K"]
    whitening: Float[Array, "D C K 2 2"]
    used: np.ndarray = eqx.field(static=False)
    decay: tuple[int, ...] = eqx.field(static=True)
    windows: tuple[int, ...] = eqx.field(static=True)
    nuisance: Float[Array, "m t"] | None = None

    def __call__(self, predicted: Complex[Array, "D C K"]) -> Float[Array, " m"]:
        """Residuals in standard deviations, (D * C * (n + 1) * 2,)."""
        miss = predicted - self.measured
        parts = jnp.stack([miss.real, miss.imag], axis=-1)
        return self.projected(jnp.einsum("dckij,dckj->dcki", self.whitening, parts).ravel())

    def projected(self, residuals: Float[Array, " m"]) -> Float[Array, " m"]:
        """Residuals, or changes of them, [sd] without what nuisances make of them."""
        if self.nuisance is None:
            return residuals
        # Directions lead through one test each: one that was not solved takes no other along.
        solved = jnp.where(jnp.isfinite(residuals), residuals, 0.0)
        return residuals - self.nuisance @ (self.nuisance.T @ solved)

    def with_nuisances(self, predicted: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Predicted harmonics (D, C, K) [unit of each] as near the measured ones as nuisances make them."""
        if self.nuisance is None:
            return predicted
        whitening, measured = np.asarray(self.whitening), np.asarray(self.measured)
        miss = np.stack([(predicted - measured).real, (predicted - measured).imag], axis=-1)
        rows = np.einsum("dckij,dckj->dcki", whitening, miss).ravel()
        solved = np.where(np.isfinite(rows), rows, 0.0)
        along = np.asarray(self.nuisance) @ (np.asarray(self.nuisance).T @ solved)
        unused = np.all(whitening == 0.0, axis=(-2, -1), keepdims=True)
        back = np.linalg.inv(whitening + unused * np.eye(2))
        parts = np.einsum("dckij,dckj->dcki", back, along.reshape(miss.shape))
        return np.asarray(predicted - (parts[..., 0] + 1j * parts[..., 1]))

    @property
    def size(self) -> int:
        """Residuals, those of unused entries included."""
        return 2 * int(np.size(self.used))

    @property
    def entries(self) -> int:
        """Real numbers compared, less those that nuisances could make anything."""
        return 2 * int(self.used.sum()) - (0 if self.nuisance is None else self.nuisance.shape[1])


class PeakToPeakTarget(eqx.Module):
    """Peak-to-peak values of the waveforms, truncated on both sides to the orders that the sensor carries.

    ``measured`` is in the unit of each reading, ``weight`` in one over it; ``used`` (D, C) says which
    count.
    """

    measured: Float[Array, "D C"]
    weight: Float[Array, "D C"]
    used: np.ndarray = eqx.field(static=False)

    def __call__(self, predicted: Complex[Array, "D C K"]) -> Float[Array, " m"]:
        """Residuals in standard deviations, (D * C,)."""
        # It is written against the array API, its types name NumPy's arrays.
        discrepancy_scale = cast(Any, peak_to_peak)(predicted, jnp.asarray(self.used))
        return jnp.ravel((discrepancy_scale - self.measured) * self.weight)

    @property
    def size(self) -> int:
        """Residuals, those of unused entries included."""
        return int(np.size(self.weight))

    @property
    def entries(self) -> int:
        """Real numbers compared."""
        return int((np.asarray(self.weight) > 0.0).sum())


Target = HarmonicTarget | PeakToPeakTarget


def response_channels(
    measured: HarmonicResponse, channels: Sequence[Channel]
) -> tuple[NDArray[np.bool_], list[int]]:
    """Which of a plant's channels were recorded, (C,), and a stand-in index for those that were not.

    Raises :class:`InputError` if none was.
    """
    names = [each.name for each in channels]
    present = np.array([name in measured.channels for name in names])
    if not present.any():
        what = f"neither {' nor '.join(names)} was" if len(names) > 1 else f"{names[0]} was not"
        raise InputError(f"{what} recorded", remedy="map at least one of them in channels.toml")
    return present, [measured.channel(name) if name in measured.channels else 0 for name in names]


def harmonic_target(measured: HarmonicResponse, channels: Sequence[Channel], orders: int) -> HarmonicTarget:
    """Orders 1..``orders`` of those of a plant's channels that were recorded; of windows those that they compare.

    Raises :class:`InputError` if none can be used.
    """
    present, places = response_channels(measured, channels)
    recorded = [place for place, there in zip(places, present, strict=True) if there]
    count = 1 + (min(orders, measured.orders) if measured.part is None else measured.last_compared(recorded))
    covariance = measured.covariance[:, places, :count]
    used = measured.valid[:, places, :count] & present[None, :, None]
    used[:, :, 0] = False
    used[measured.dwells, :, orders + 1 :] = False
    used &= (np.linalg.det(covariance) > 0.0) & np.isfinite(covariance).all(axis=(-2, -1))
    if not used.any():
        raise InputError("no harmonic of the response can be used", remedy="record longer dwells")
    safe = np.where(used[..., None, None], covariance, np.eye(2))
    whitening = np.linalg.inv(np.linalg.cholesky(safe)) * used[..., None, None]
    harmonics = np.where(used, measured.harmonics[:, places, :count], 0.0)
    return HarmonicTarget(
        jnp.asarray(harmonics),
        jnp.asarray(whitening),
        used,
        tuple(each.decay for each in channels),
        tuple(measured.windows.tolist()),
        _nuisances(np.asarray(whitening, np.float64), measured, len(channels), count - 1),
    )


def _nuisances(
    whitening: NDArray[np.float64], measured: HarmonicResponse, channels: int, orders: int
) -> Float[Array, "m t"] | None:
    """Directions of the residuals, perpendicular and of length one, in which tests that begin moving say nothing.

    What other initial states would change, where these are known, and offsets of sensors: a decay is short, and its
    mean no mean over time. None where no test begins so.
    """
    if measured.part is None or not measured.part.begins_moving.any():
        return None
    tests, count = len(measured.tests), orders + 1
    moving = np.flatnonzero(measured.part.begins_moving)
    offsets = np.zeros((tests, channels, count, channels), np.complex128)
    offsets[moving] = np.einsum(
        "dk,ce->dcke", share_amplitudes(measured.part, orders)[moving], np.eye(channels)
    )
    changes = offsets
    if measured.initial_states is not None:
        changes = np.concatenate([offsets, measured.initial_states.changes[:, :, :count]], axis=-1)
    found = []
    for place, each in enumerate(whitened(whitening, changes)):
        # A state that changes nothing has a direction all the same, that of rounding.
        seen = np.linalg.norm(each, axis=0) > UNSEEN
        kept = spanned(each[:, seen | (np.arange(seen.size) < channels)])
        columns = np.zeros((tests, *kept.shape))
        columns[place] = kept
        found.append(columns.reshape(tests * kept.shape[0], kept.shape[1]))
    return jnp.asarray(np.concatenate(found, axis=1))


def whitened(whitening: NDArray[np.float64], changes: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Changes of harmonics (D, C, K, m) [unit of the channel per unit] in standard deviations, (D, rows, m)."""
    parts = np.stack([changes.real, changes.imag], axis=-2)
    rows = np.einsum("dckij,dckjm->dckim", whitening, parts)
    return np.asarray(rows.reshape(rows.shape[0], -1, rows.shape[-1]))


def peak_to_peak_target(measured: HarmonicResponse, channels: Sequence[Channel]) -> PeakToPeakTarget:
    """Peak-to-peak values of those of a plant's channels that were recorded, all orders that the measurement holds.

    Raises :class:`InputError` if none can be used.
    """
    present, places = response_channels(measured, channels)
    sd = measured.peak_to_peak_sd[:, places]
    used = measured.valid[:, places] & present[None, :, None]
    used[:, :, 0] = False
    known = used[:, :, 1] & (sd > 0.0)
    if not known.any():
        raise InputError("no peak-to-peak value of the response can be used", remedy="record longer dwells")
    weight = np.where(known, 1.0 / np.where(known, sd, 1.0), 0.0)
    return PeakToPeakTarget(jnp.asarray(measured.peak_to_peak[:, places]), jnp.asarray(weight), used)
