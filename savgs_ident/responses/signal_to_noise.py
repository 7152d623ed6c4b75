"""How far each harmonic stands above its noise."""

import numpy as np
from numpy.typing import NDArray

from savgs_ident.responses.harmonic_response import HarmonicResponse


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
