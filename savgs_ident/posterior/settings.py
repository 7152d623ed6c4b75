"""Options of sampling."""

from dataclasses import dataclass, field

from savgs_ident.posterior.result import Sampler
from savgs_ident.simulate.periodic import PeriodicSettings


@dataclass(frozen=True)
class SamplingSettings:
    """How to sample.

    Attributes:
        sampler: "emcee" or "nuts".
        target_ess: effective sample size, bulk and tail, that every identified parameter is to reach [1].
        time_limit_s: time after which sampling ends without [s].
        patience_s: time up to which sampling goes on beyond the target [s], until the Monte-Carlo error of every
            median is below :data:`savgs_ident.posterior.diagnostics.PRECISE`.
        fixed_tolerances: take the parameters with a tolerance as exact instead of marginalising over them.
        orders: highest harmonic order that is compared.
        seed: of all random numbers.
        predictive_draws: draws at which the model's prediction is kept.
        periodic: how finely to solve the model.
    """

    sampler: Sampler = "emcee"
    target_ess: float = 1000.0
    time_limit_s: float = 600.0
    patience_s: float = 85.0
    fixed_tolerances: bool = False
    orders: int = 9
    seed: int = 1
    predictive_draws: int = 200
    periodic: PeriodicSettings = field(default_factory=PeriodicSettings)
