"""Peak-to-peak of a waveform given by its harmonics.

Measured and predicted responses go through this same evaluation with the same orders, so that a steep
flank, which needs many orders, is cut off alike on both sides.
"""

import numpy as np
from numpy.typing import NDArray

DEFAULT_SAMPLES = 512
"""Points in a period: a component of order k is seen to within (pi k / 512)^2 / 2 of its own amplitude."""


def peak_to_peak(
    harmonics: NDArray[np.complex128], valid: NDArray[np.bool_], samples: int = DEFAULT_SAMPLES
) -> NDArray[np.float64]:
    """Largest less smallest value of Re sum_k X_k exp(2 pi i k s), 0 <= s < 1, over orders 1..n.

    ``harmonics`` and ``valid`` have shape (..., n + 1), the mean first; orders that are not ``valid`` are
    left out. Returns shape (...), in the unit of ``harmonics``. Only operators are used on the arguments:
    arrays of another library (JAX) pass through and stay differentiable.
    """
    order = np.arange(harmonics.shape[-1])
    angle = 2.0 * np.pi * np.outer(order, np.arange(samples)) / samples
    kept = harmonics * valid
    wave = kept.real @ np.cos(angle) - kept.imag @ np.sin(angle)
    reach: NDArray[np.float64] = wave.max(-1) - wave.min(-1)
    return reach
