"""What every fit gives: a model with estimated values, their covariance, what the data identify, whether to trust it.

A fit of harmonics (:class:`savgs_ident.fit.result.Fit`) and one along a measured motion
(:class:`savgs_ident.fit.along_motion.MotionFit`) say besides what they were held against.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.files import spelled_out
from savgs_ident.core.presentation import Result, package_versions
from savgs_ident.core.status import Status
from savgs_ident.fit.estimate import FAR_OFF, Estimate, far_off_sentence
from savgs_ident.inference.result import UNEXPLAINED
from savgs_ident.plants.model import Model

PACKAGES = ("jax", "optimistix", "numpy", "scipy")
"""Whose version matters to a fit."""


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
class Identified(Result):
    """What all fits have; arrays are read-only.

    Attributes:
        estimated: the model with the estimated values in place of the assumed ones.
        estimates: all estimated parameters, free ones first.
        covariance: of the estimates in their order [products of their units], (n, n).
        chi2: weighted sum of squared residuals of the data alone.
        dof: real data entries less free parameters.
        status: how the optimisation ended.
        verdict: what the data identify and what they do not.
        wall_s: time taken [s].

    ``fit["mu_r"].value`` is an estimate, ``fit.model`` the identified model.
    """

    estimated: Model
    estimates: tuple[Estimate, ...]
    covariance: NDArray[np.float64]
    chi2: float
    dof: int
    status: Status
    verdict: Verdict
    wall_s: float

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __getitem__(self, name: str) -> Estimate:
        """The estimate of a parameter; raises ``KeyError`` for one that was not estimated."""
        return self.by_name[name]

    @property
    def model(self) -> Model:
        """The identified model, of the kind that was fitted, which remembers where its numbers come from."""
        return self.estimated.with_provenance(self._provenance())

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.estimated.effects

    @property
    def trusted(self) -> bool:
        """Whether the fit converged everywhere, the model explains the data, and they identify what is free."""
        return not self.doubt

    @property
    def far_off(self) -> tuple[Estimate, ...]:
        """What is known to a tolerance and would be off its sheet by more than is believed, farthest first."""
        off = [each for each in self.estimates if not each.free and each.tolerances_off > FAR_OFF]
        return tuple(sorted(off, key=lambda each: -each.tolerances_off))

    @property
    def doubt(self) -> str:
        """The first reason why the fit is not to be trusted; empty if it is.

        Where the model does not explain the data, that steps, motions or numbers are lacking is no advice: parameters
        that are to make up for what is missing lead far away. Nor is that something is missing where the recordings,
        or a number, are off as by a wrong unit.
        """
        if self.mistaken and not self.verdict.explained:
            return self.mistaken
        if self.far_off and (self.far_off[0].unit_taken or self.verdict.explained):
            return far_off_sentence(self.far_off[0])
        if not self.verdict.explained:
            return UNEXPLAINED
        if not self.status.ok:
            return self.status.advice
        if self.unsolved:
            return self.unsolved
        return "" if self.verdict.identifiable else "the data do not identify every free parameter"

    @property
    def mistaken(self) -> str:
        """What was probably recorded otherwise than it is said to be, in words; empty where nothing tells."""
        return ""

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

    @property
    @abstractmethod
    def unsolved(self) -> str:
        """Where the model had no solution, in words; empty if nowhere."""

    @property
    @abstractmethod
    def compared(self) -> Mapping[str, object]:
        """What was compared, as the provenance of the identified model says it."""

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
            **self.compared,
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
