"""What a fit gives: estimates with their covariance, residuals, and what the data identify and what they do not."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.files import spelled_out
from savgs_ident.core.presentation import Result, package_versions
from savgs_ident.core.status import Status
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse

PACKAGES = ("jax", "optimistix", "numpy", "scipy")
"""Whose version matters to a fit."""


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter in SI.

    ``stderr`` is its standard error, which contains what the model leaves unexplained; ``free`` distinguishes an
    identified parameter from one that was known to a tolerance and estimated along. For the latter ``prior`` and
    ``prior_sd`` say what was known before.
    """

    name: str
    value: float
    stderr: float
    unit: str
    free: bool
    prior: float
    prior_sd: float


UNEXPLAINED = "the model does not explain the data"


@dataclass(frozen=True)
class Verdict:
    """What the data identify, in words.

    Attributes:
        identifiable: whether every free parameter is identified.
        sentences: the verdict, one statement each.
        confounded: groups of free parameters that trade off against each other.
        explained: whether the model explains the data, but for small errors that every model has.
    """

    identifiable: bool
    sentences: tuple[str, ...]
    confounded: tuple[tuple[str, ...], ...] = ()
    explained: bool = True

    def __str__(self) -> str:
        return "\n".join(self.sentences)


@dataclass(frozen=True)
class Fit(Result):
    """A finished fit; arrays are read-only.

    Attributes:
        estimated: the model with the estimated values in place of the assumed ones.
        estimates: all estimated parameters, free ones first.
        covariance: of the estimates in their order [products of their units], (n, n).
        chi2: weighted sum of squared residuals of the data alone.
        dof: real data entries less free parameters.
        prior_chi2: squared deviations of all parameters from what was known before, in its standard deviations.
        status: how the optimisation ended, over all dwells.
        dwell_status: whether the model's periodic solution converged, per dwell.
        verdict: what the data identify and what they do not.
        measured: the response that was fitted.
        orders: highest harmonic order used.
        used: which entries of ``predicted`` were fitted, (D, C, orders + 1).
        predicted: identified model, complex [unit of the reading], (D, C, orders + 1), in the plant's channels.
        frictionless: the plant without effects at the same estimates [unit of the reading], (D, C, orders + 1).
        frictionless_status: whether the periodic solution of that converged, per dwell; it is NaN where not.
        as_given: the model before fitting [unit of the reading], (D, C, orders + 1).
        starts: (chi2 reached, status) of each start of the optimisation.
        quantity: "harmonics" or "peak_to_peak", what was fitted.
        wall_s: time taken [s].

    ``fit["mu_r"].value`` is an estimate, ``fit.model`` the identified model.
    """

    presenter: ClassVar[str] = "FIT"

    estimated: Model
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
    frictionless_status: tuple[Status, ...]
    as_given: NDArray[np.complex128]
    starts: tuple[tuple[float, Status], ...]
    quantity: str
    wall_s: float

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter; raises ``KeyError`` for one that was not estimated."""
        return self.by_name[name]

    @property
    def model(self) -> Any:
        """The identified model, of the kind that was fitted, which remembers where its numbers come from."""
        return self.estimated.with_provenance(self._provenance())

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.estimated.effects

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the C channels of the plant."""
        return tuple(each.name for each in self.estimated.channels)

    @property
    def trusted(self) -> bool:
        """Whether the fit converged everywhere, the model explains the data, and they identify what is free."""
        return not self.doubt

    @property
    def doubt(self) -> str:
        """The first reason why the fit is not to be trusted; empty if it is."""
        if not self.status.ok:
            return self.status.advice
        if not all(each.ok for each in self.dwell_status):
            return "the model's periodic motion was not found in every dwell"
        if not self.verdict.explained:
            return UNEXPLAINED
        return "" if self.verdict.identifiable else "the data do not identify every free parameter"

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

    def _provenance(self) -> dict[str, object]:
        """The table ``[provenance]`` of a ``model.toml``.

        ``before`` holds the values that the estimated parameters had before the fit, the centres of their priors;
        the covariance is in the order of its names. SI.
        """
        return {
            "command": spelled_out(self.origin.command_line),
            "data": spelled_out(self.origin.data),
            "data_sha256": self.origin.data_sha256,
            "effects": list(self.effects),
            "free": list(self.free_names),
            "known_to_tolerance": [each.name for each in self.estimates if not each.free],
            "quantity": self.quantity,
            "orders": self.orders,
            "chi2": float(self.chi2),
            "dof": int(self.dof),
            "status": self.status.name.lower(),
            "trusted": self.trusted,
            **({"doubt": self.doubt} if self.doubt else {}),
            "before": {each.name: each.prior for each in self.estimates},
            "versions": package_versions(PACKAGES),
            "covariance": {
                "names": [each.name for each in self.estimates],
                "matrix": self.covariance.tolist(),
            },
        }
