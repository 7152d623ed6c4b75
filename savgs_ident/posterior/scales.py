"""The scales of the likelihood: how noisy the measurement is and how far off the model may be.

Both are estimated. Their coordinates a and b come last in a point and have the unit normal for prior:

    noise scale s = exp(noise_trust a),      discrepancy d = discrepancy |b|.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

NUISANCE = ("noise_scale", "discrepancy")
"""Their names, in the order of their coordinates."""


class Scales(NamedTuple):
    """Priors of the scales.

    ``noise_trust`` is the standard deviation of the logarithm of the noise scale [1]: the noise covariance was
    estimated, from what does not repeat. ``discrepancy`` is the scale of the half-normal prior of the model
    discrepancy [1]: a model that misses more than a tenth of the response is the wrong model.
    """

    noise_trust: float = 0.1
    discrepancy: float = 0.05

    def noise_scale(self, points: Float[Array, "*w n+2"]) -> Float[Array, "*w"]:
        """Factor on the measured noise's standard deviation [1]."""
        return jnp.exp(self.noise_trust * points[..., -2])

    def miss(self, points: Float[Array, "*w n+2"]) -> Float[Array, "*w"]:
        """Relative rms by which the model misses, beyond the noise [1]."""
        return self.discrepancy * jnp.abs(points[..., -1])
