"""How well a constant or a parabola in the link angle stands for a quantity of the linear equivalent.

parabola = approximate(angle, alpha, degree=2)
parabola(1.2), parabola.rms, parabola.largest
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Approximation:
    """A polynomial in the link angle, and what it leaves.

    Attributes:
        coefficients: powers of the link angle [rad], constant first, in the quantity's unit.
        rms: root mean square of what is left, as a share of the quantity's greatest magnitude [1].
        largest: the largest of what is left, as the same share [1].
    """

    coefficients: tuple[float, ...]
    rms: float
    largest: float

    def __call__(self, angle: ArrayLike) -> NDArray[np.float64]:
        """The approximated quantity at link angles [rad], any shape; the result has the same."""
        return np.asarray(Polynomial(self.coefficients)(np.asarray(angle, dtype=np.float64)))


def approximate(angle: NDArray[np.float64], values: NDArray[np.float64], degree: int) -> Approximation:
    """The polynomial of a ``degree`` nearest to ``values`` (n,) at link angles (n,) [rad], in least squares."""
    polynomial = Polynomial.fit(angle, values, degree).convert()
    left = np.abs(values - polynomial(angle)) / np.max(np.abs(values))
    return Approximation(
        tuple(float(c) for c in polynomial.coef), float(np.sqrt(np.mean(left**2))), float(np.max(left))
    )
