"""What a fit gives: estimates with their covariance, residuals, and what the data can and cannot tell."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.rig import Rig
from savgs_ident.core.status import Status
from savgs_ident.responses.harmonic_response import HarmonicResponse


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter in SI.

    ``stderr`` is its standard error; ``free`` tells an identified parameter from one that was known to a
    tolerance and estimated along. For the latter ``prior`` and ``prior_sd`` say what was known before.
    """

    name: str
    value: float
    stderr: float
    unit: str
    free: bool
    prior: float
    prior_sd: float


@dataclass(frozen=True)
class Verdict:
    """What the data can tell, in words.

    Attributes:
        identifiable: whether every free parameter is told.
        sentences: the verdict, one statement each.
        confounded: groups of free parameters that trade off against each other.
    """

    identifiable: bool
    sentences: tuple[str, ...]
    confounded: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True)
class Fit:
    """A finished fit; arrays are read-only.

    Attributes:
        rig: the rig with the estimated values in place of the assumed ones.
        effects: names of the effects in the model, () for SimQC.
        estimates: all estimated parameters, free ones first.
        covariance: of the estimates in their order [products of their units], (n, n).
        chi2: weighted sum of squared residuals of the data alone.
        dof: real data entries less free parameters.
        prior_chi2: squared deviations of the tolerance parameters in their standard deviations.
        status: how the optimisation ended, over all dwells.
        dwell_status: whether the model's periodic solution converged, per dwell.
        verdict: what the data can and cannot tell.
        measured: the response that was fitted.
        orders: highest harmonic order used.
        used: which entries of ``predicted`` were fitted, (D, 2, orders + 1).
        predicted: identified model, complex [unit of the reading], (D, 2, orders + 1), channels as in
            :data:`savgs_ident.model.sensors.RESPONSE_CHANNELS`.
        frictionless: SimQC at the same estimates [unit of the reading], (D, 2, orders + 1).
        as_given: the model before fitting [unit of the reading], (D, 2, orders + 1).
        starts: (chi2 reached, status) of each start of the optimisation.
        quantity: "harmonics" or "peak_to_peak", what was fitted.
        wall_s: time taken [s].
    """

    rig: Rig
    effects: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    covariance: NDArray[np.float64]
    chi2: float
    dof: int
    prior_chi2: float
    status: Status
    dwell_status: tuple[Status, ...]
    verdict: Verdict
    measured: HarmonicResponse
    orders: int
    used: NDArray[np.bool_]
    predicted: NDArray[np.complex128]
    frictionless: NDArray[np.complex128]
    as_given: NDArray[np.complex128]
    starts: tuple[tuple[float, Status], ...]
    quantity: str
    wall_s: float

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def trusted(self) -> bool:
        """Whether the fit converged everywhere and every free parameter is told by the data."""
        return self.status.ok and all(each.ok for each in self.dwell_status) and self.verdict.identifiable

    @property
    def by_name(self) -> Mapping[str, Estimate]:
        """The estimates by parameter name."""
        return {estimate.name: estimate for estimate in self.estimates}

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the identified parameters."""
        return tuple(estimate.name for estimate in self.estimates if estimate.free)

    @property
    def correlation(self) -> NDArray[np.float64]:
        """Correlation of the estimates [1], (n, n)."""
        sd = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(sd, sd))
