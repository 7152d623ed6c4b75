"""What is compared: measured against predicted harmonics, in standard deviations.

A target maps predicted harmonics (D, 2, n + 1) to residuals that are independent with unit variance if the
model is true. Both kinds see the two response channels only, as far as the measurement carries them.
"""

from typing import Any, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.peak_to_peak import peak_to_peak


class HarmonicTarget(eqx.Module):
    """Complex harmonics of orders 1..n with their 2 x 2 covariances.

    ``whitening`` (D, 2, n + 1, 2, 2) is the inverse Cholesky factor of the covariance, 0 where not
    ``used``. Harmonics are in the unit of their reading, ``whitening`` in one over it.
    """

    measured: Complex[Array, "D C K"]
    whitening: Float[Array, "D C K 2 2"]
    used: np.ndarray = eqx.field(static=False)

    def __call__(self, predicted: Complex[Array, "D C K"]) -> Float[Array, " m"]:
        """Residuals in standard deviations, (D * 2 * (n + 1) * 2,)."""
        miss = predicted - self.measured
        parts = jnp.stack([miss.real, miss.imag], axis=-1)
        return jnp.einsum("dckij,dckj->dcki", self.whitening, parts).ravel()

    @property
    def size(self) -> int:
        """Residuals, those of unused entries included."""
        return 2 * int(np.size(self.used))

    @property
    def entries(self) -> int:
        """Real numbers compared."""
        return 2 * int(self.used.sum())


class PeakToPeakTarget(eqx.Module):
    """Peak-to-peak values of the waveforms, truncated on both sides to the orders that the sensor carries.

    ``measured`` is in the unit of each reading, ``weight`` in one over it; ``used`` (D, 2) says which
    count.
    """

    measured: Float[Array, "D C"]
    weight: Float[Array, "D C"]
    used: np.ndarray = eqx.field(static=False)

    def __call__(self, predicted: Complex[Array, "D C K"]) -> Float[Array, " m"]:
        """Residuals in standard deviations, (D * 2,)."""
        # It is written against the array API, its types name NumPy's arrays.
        reach = cast(Any, peak_to_peak)(predicted, jnp.asarray(self.used))
        return jnp.ravel((reach - self.measured) * self.weight)

    @property
    def size(self) -> int:
        """Residuals, those of unused entries included."""
        return int(np.size(self.weight))

    @property
    def entries(self) -> int:
        """Real numbers compared."""
        return int((np.asarray(self.weight) > 0.0).sum())


Target = HarmonicTarget | PeakToPeakTarget


def response_channels(measured: HarmonicResponse) -> tuple[NDArray[np.bool_], list[int]]:
    """Which response channels were recorded, (2,), and a stand-in index for those that were not."""
    present = np.array([name in measured.channels for name in RESPONSE_CHANNELS])
    if not present.any():
        raise InputError(
            "neither sprung_accel nor susp_deflection was recorded",
            remedy="map at least one of them in channels.toml",
        )
    return present, [measured.channel(n) if n in measured.channels else 0 for n in RESPONSE_CHANNELS]


def harmonic_target(measured: HarmonicResponse, orders: int) -> HarmonicTarget:
    """Orders 1..``orders`` of the recorded response channels.

    Raises :class:`InputError` if none can be used.
    """
    present, places = response_channels(measured)
    kept = min(orders, measured.orders) + 1
    covariance = measured.covariance[:, places, :kept]
    used = measured.valid[:, places, :kept] & present[None, :, None]
    used[:, :, 0] = False
    used &= (np.linalg.det(covariance) > 0.0) & np.isfinite(covariance).all(axis=(-2, -1))
    if not used.any():
        raise InputError("no harmonic of the response can be used", remedy="record longer dwells")
    safe = np.where(used[..., None, None], covariance, np.eye(2))
    whitening = np.linalg.inv(np.linalg.cholesky(safe)) * used[..., None, None]
    harmonics = np.where(used, measured.harmonics[:, places, :kept], 0.0)
    return HarmonicTarget(jnp.asarray(harmonics), jnp.asarray(whitening), used)


def peak_to_peak_target(measured: HarmonicResponse) -> PeakToPeakTarget:
    """Peak-to-peak values of the recorded response channels, all orders that the measurement holds.

    Raises :class:`InputError` if none can be used.
    """
    present, places = response_channels(measured)
    sd = measured.peak_to_peak_sd[:, places]
    used = measured.valid[:, places] & present[None, :, None]
    used[:, :, 0] = False
    told = used[:, :, 1] & (sd > 0.0)
    if not told.any():
        raise InputError("no peak-to-peak value of the response can be used", remedy="record longer dwells")
    weight = np.where(told, 1.0 / np.where(told, sd, 1.0), 0.0)
    return PeakToPeakTarget(jnp.asarray(measured.peak_to_peak[:, places]), jnp.asarray(weight), used)
