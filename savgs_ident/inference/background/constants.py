"""The constants of the background: how large the small errors of any model are, and of what they consist.

They are part of what decides a diagnosis (:mod:`savgs_ident.diagnosis.thresholds`), and of every likelihood.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class BackgroundConstants:
    """Sizes of small errors, relative [1], and the functions that they may follow."""

    material_error: float = 0.002
    """Width of the prior of the errors that a model has at each port, as a share of the response.

    Origin: by choice, two thirds of what an effect must change to matter.
    """

    input_error: float = 0.0005
    """The same of the amplitude and the phase [rad] of a test's input.

    Origin: by choice: a recorded road is known to half a per mille.
    """

    independent_error: float = 0.3
    """Errors that each harmonic has by itself, in those that it shares with others.

    Origin: by choice, so that they stay below the noise of a campaign at the material size.
    """

    curve_tolerance: float = 0.02
    """Tolerance of a damper's curve, point by point, as a share of its force.

    Origin: by choice, what a dynamometer's table is good for.
    """

    curve_points: tuple[float, ...] = tuple(np.geomspace(0.01, 1.0, 16).tolist())
    """Points of a damper's curve to either side that err by themselves, as shares of the largest velocity.

    Origin: by choice, as dense as tables are.
    """

    curve_alike: float = 2.0
    """Ratio of two velocities at which the errors of a damper's curve are correlated by 1/e.

    Origin: by choice: what makes a table wrong, the oil's temperature or a friction in the dynamometer, makes a
    stretch of it wrong, not single points.
    """

    drift_tolerance: float = 0.05
    """Change of an identified parameter from the middle of a campaign to its ends, as a share of it.

    Origin: by choice: friction and damping of parts that become warm.
    """

    small_discrepancy: float = 1.96
    """Discrepancy of small errors at most, in the width of its prior. Origin: its 95 % quantile, half-normal."""

    simple_law_prior: float = 0.1
    """Prior probability of a family's simple laws together, relative to the sum of all its functions.

    Origin: by choice: most of what is so simple is in the catalogue. Halved or doubled: log odds between a simple
    law and a general one move by 0.7 nat.
    """

    resonances: tuple[float, ...] = (3.0, 4.0, 5.4, 7.3, 9.8, 13.0, 18.0, 24.0, 33.0, 50.0)
    """Natural frequencies [Hz] at which something is looked for that swings under its load.

    Origin: by choice, about a third apart.
    """

    resonance_damping: float = 0.1
    """Damping ratio of what swings there. Origin: by choice, that of slightly damped modes."""

    ripple_orders: tuple[int, ...] = (4, 5, 6, 7, 8, 9)
    """Orders of the ripple of an input. Origin: those compared, beyond the three of its shape."""

    free_orders: int = 9
    """Highest order of an input that is free in every dwell. Origin: the orders compared. It changes no verdict."""

    noisiest: float = 5.0
    """Noise of harmonics, over that which the recordings show, from which on it is none.

    Origin: by choice: what a standstill with the pumps off may lack. A model that misses most of a few windows was
    taken for one in 17 times the noise.
    """

    @property
    def largest_error(self) -> float:
        """Errors at each port, as a share of the response, from which on they are no small ones [1]."""
        return self.small_discrepancy * self.material_error


BACKGROUND = BackgroundConstants()
"""The constants unless others are given."""
