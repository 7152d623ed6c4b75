"""Options of a fit."""

from dataclasses import dataclass, field
from typing import Literal

from savgs_ident.simulate.periodic import PeriodicSettings

Quantity = Literal["harmonics", "peak_to_peak"]


@dataclass(frozen=True)
class FitSettings:
    """How to fit.

    Attributes:
        orders: highest harmonic order that is compared.
        fixed_tolerances: take the parameters with a tolerance as exact instead of estimating them along.
        quantity: compare complex harmonics, or peak-to-peak values only, as the paper did.
        starts: most starting points of the optimisation; the rig file's values are the first, and further ones
            are tried if that does not explain the data.
        steps: most steps from one start.
        periodic: how finely to solve the model.
    """

    orders: int = 9
    fixed_tolerances: bool = False
    quantity: Quantity = "harmonics"
    starts: int = 3
    steps: int = 40
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)
