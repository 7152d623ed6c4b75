"""How a diagnosis is done."""

from dataclasses import dataclass, field

from savgs_ident.simulate.periodic import PeriodicSettings

FREE = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
"""Parameters that the baseline identifies where it has them."""


@dataclass(frozen=True)
class DiagnosisSettings:
    """How a diagnosis is done.

    Attributes:
        model: name of the baseline, for the report.
        baseline: effects in the baseline.
        free: parameters that recalibration identifies.
        orders: highest order of the harmonics that are compared.
        without: effects that are left out of the catalogue.
        periodic: how finely periodic motions are solved.
    """

    model: str = "simtr"
    baseline: tuple[str, ...] = ("rail_coulomb", "tyre_friction")
    free: tuple[str, ...] = FREE
    orders: int = 9
    without: tuple[str, ...] = ()
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)
