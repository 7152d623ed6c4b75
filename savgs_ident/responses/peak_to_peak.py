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

    ``harmonics`` and ``valid`` have shape (..., n + 1), the mean first, n < ``samples`` / 2; orders that are
    not ``valid`` are left out. Returns shape (...), in the unit of ``harmonics``. Written against the array
    API: arrays of another library that follows it pass through, and stay differentiable there.
    """
    xp = harmonics.__array_namespace__()
    kept = harmonics * valid
    wave = xp.fft.irfft(kept, n=samples) * (0.5 * samples)
    reach: NDArray[np.float64] = xp.max(wave, axis=-1) - xp.min(wave, axis=-1)
    return reach
