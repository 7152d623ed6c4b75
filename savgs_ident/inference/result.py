"""What sampling gives: draws with their convergence, marginals, predictions, and what they mean."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Result
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.plants.model import Model
from savgs_ident.responses.driven_motion import DrivenMotion
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests

if TYPE_CHECKING:
    import xarray as xr


Sampler = Literal["emcee", "nuts"]
"""The samplers there are."""

Role = Literal["identified", "tolerated", "typical", "nuisance"]
"""Identified by the data alone, known to a tolerance or an order of magnitude before, a scale of the likelihood."""


@dataclass(frozen=True)
class ProfileLine:
    """How much -2 log density rises (k,) [1] with a parameter held at ``values`` (k,) [its unit], others refitted."""

    values: NDArray[np.float64]
    rise: NDArray[np.float64]


@dataclass(frozen=True)
class Marginal:
    """One parameter's posterior; all values in [``unit``].

    Attributes:
        name: the parameter.
        unit: its SI unit.
        about: what it is.
        role: how it came into the posterior.
        median: of the draws.
        sd: standard deviation of the draws.
        q025: lower end of the central 95 % interval.
        q975: its upper end.
        prior: the central 95 % interval before the data.
        contraction: share by which that interval has shrunk [1].
        laplace_value: the value at the posterior's mode.
        laplace_sd: the standard deviation that its curvature there promises.
        ess_bulk: effective sample size of the middle of the distribution, rank-normalised [1].
        ess_tail: the same of its 5 % and 95 % quantiles [1].
        r_hat: rank-normalised split R-hat [1].
        autocorrelation: integrated autocorrelation time [draws].
        profile: profile of the density; None but for identified parameters.
    """

    name: str
    unit: str
    about: str
    role: Role
    median: float
    sd: float
    q025: float
    q975: float
    prior: tuple[float, float]
    contraction: float
    laplace_value: float
    laplace_sd: float
    ess_bulk: float
    ess_tail: float
    r_hat: float
    autocorrelation: float
    profile: ProfileLine | None = None


@dataclass(frozen=True)
class Convergence:
    """Whether the draws may be used.

    Attributes:
        converged: whether they may.
        reasons: why not, a sentence each.
        target_ess: effective sample size that was asked for [1].
        ess_min: the least of bulk and tail over the identified parameters [1].
        r_hat_max: the largest over all parameters [1].
        acceptance: share of proposals that the exact model accepted [1].
        divergences: diverging trajectories of the gradient-based sampler; 0 for emcee, which has none.
        pareto_k: tail index of the weights, the ratios of exact to surrogate density at the proposals [1]; the
            proposals cover the posterior if it is below 0.7, or if the weights are nearly equal.
        heaviest_weight: the largest of these over their mean [1].
        evaluations: responses of the exact model, all dwells each.
        unsolved: proposals at which the model found no periodic motion; they were rejected.
    """

    converged: bool
    reasons: tuple[str, ...]
    target_ess: float
    ess_min: float
    r_hat_max: float
    acceptance: float
    divergences: int
    pareto_k: float
    heaviest_weight: float
    evaluations: int
    unsolved: int


@dataclass(frozen=True)
class Predictive:
    """What the posterior predicts for a repetition of the campaign.

    S draws, D dwells, the C channels of the plant, orders 0..K-1, complex, in the channels' SI units.

    Attributes:
        model: harmonics of the model at the draws, (S, D, C, K).
        replicated: the same with the noise and the discrepancy that a repetition would have, (S, D, C, K).
        used: which entries the likelihood compares, (D, C, K).
        inside: whether the measured magnitude and phase lie within 95 % of ``replicated``: whether the measured
            phasor is no further from their mean than 95 % of them, in their own covariance, (D, C, K).
    """

    model: NDArray[np.complex128]
    replicated: NDArray[np.complex128]
    used: NDArray[np.bool_]
    inside: NDArray[np.bool_]

    def of_tests(self, kept: NDArray[np.intp], orders: int) -> "Predictive":
        """Of some of the tests, orders 0..``orders``."""
        upto = orders + 1
        return Predictive(
            self.model[:, kept, :, :upto],
            self.replicated[:, kept, :, :upto],
            self.used[kept, :, :upto],
            self.inside[kept, :, :upto],
        )

    @property
    def count_inside(self) -> tuple[int, int]:
        """How many of the compared phasors lie inside, and how many there are."""
        return int(np.sum(self.inside & self.used)), int(np.sum(self.used))


UNEXPLAINED = "the model does not explain the data"
"""Why a fit or a posterior is not to be trusted."""


@dataclass(frozen=True)
class Posterior(Result, ABC):
    """A finished run, whatever the model was held against; arrays are read-only.

    Attributes:
        model: the model with the posterior medians in place of the assumed values.
        sampler: which sampler ran.
        marginals: identified parameters first, then the nuisance scales, then what was known beforehand.
        draws: name to values in SI, (chains, draws), in the order of ``marginals``.
        statistics: per draw, (chains, draws): "lp" log density, "accepted" whether the draw is a new one.
        convergence: whether they may be used.
        sentences: what the data say, in words.
        wall_s: time taken, from what was measured to the last draw [s].
    """

    errs_in: ClassVar[str]
    """Of what its discrepancy is a share, in words."""
    noise_is_recorded: ClassVar[bool]
    """Whether recordings show its noise; otherwise that is estimated along."""

    model: Model
    sampler: Sampler
    marginals: tuple[Marginal, ...]
    draws: Mapping[str, NDArray[np.float64]]
    statistics: Mapping[str, NDArray[np.float64]]
    convergence: Convergence
    sentences: tuple[str, ...]
    wall_s: float

    @property
    @abstractmethod
    def count_inside(self) -> tuple[int, int]:
        """How many of the numbers that are compared lie where 95 % of repetitions lie, and how many there are."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects in the model."""
        return self.model.effects

    @property
    def by_name(self) -> Mapping[str, Marginal]:
        """The marginals by parameter name."""
        return {each.name: each for each in self.marginals}

    def __getitem__(self, name: str) -> Marginal:
        """The marginal of a parameter; raises ``KeyError`` for one that was not sampled."""
        return self.by_name[name]

    @property
    def trusted(self) -> bool:
        """Whether the chains converged, and the model explains the data."""
        return self.convergence.converged and self.explained

    @property
    def explained(self) -> bool:
        """Whether the model may have no more than small errors of any model, to 97.5 %, and the noise be recorded."""
        return not (self["discrepancy"].q025 > BACKGROUND.largest_error or self._is_noisy)

    @property
    def _is_noisy(self) -> bool:
        """Whether the noise would have to be far more than the recordings show of it, where they show it."""
        return self.noise_is_recorded and self["noise_scale"].q025 > BACKGROUND.noisiest

    @property
    def _condition(self) -> str:
        """What would have to be so for the model to explain the data, in words."""
        if self._is_noisy:
            return (
                f"the noise would have to be {self['noise_scale'].median:.2g} times what the recordings show"
            )
        return f"it would have to err by {100.0 * self['discrepancy'].median:.2g} % {self.errs_in}"

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the draws are not to be trusted, the most important first."""
        if self.explained:
            return self.convergence.reasons
        what = (
            f"{UNEXPLAINED}: for that {self._condition}; "
            "look for what is missing with `diagnose`, until then the parameters make up for it by more than their "
            "intervals say"
        )
        return (what, *self.convergence.reasons)

    def to_arviz(self) -> "xr.DataTree":
        """The draws as ArviZ's inference data: the content of ``posterior.nc``."""
        from savgs_ident.inference.inference_data import inference_data

        return inference_data(self)

    def of_role(self, role: Role) -> tuple[Marginal, ...]:
        """The marginals of one role."""
        return tuple(each for each in self.marginals if each.role == role)

    @property
    def known_before(self) -> tuple[Marginal, ...]:
        """The marginals of what was known beforehand, to a tolerance or an order of magnitude."""
        return self.of_role("tolerated") + self.of_role("typical")

    def correlation(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        """Correlation [1] of the draws of the named parameters, (n, n)."""
        return np.atleast_2d(np.corrcoef(np.stack([self.draws[name].ravel() for name in names])))


@dataclass(frozen=True)
class HarmonicPosterior(Posterior):
    """The posterior of a model that is held against harmonics.

    Attributes:
        predictive: what the draws predict.
        measured: the response that they follow from.
    """

    presenter: ClassVar[str] = "POSTERIOR"
    errs_in: ClassVar[str] = "of the response at each of its ports"
    noise_is_recorded: ClassVar[bool] = True

    predictive: Predictive
    measured: HarmonicResponse

    @property
    def count_inside(self) -> tuple[int, int]:
        """How many of the compared phasors lie inside, and how many there are."""
        return self.predictive.count_inside

    def of_tests(self, kept: NDArray[np.intp]) -> "HarmonicPosterior":
        """With the measurement and the predictions of some of the tests; the draws are those from all."""
        measured = only_tests(self.measured, kept)
        return replace(self, measured=measured, predictive=self.predictive.of_tests(kept, measured.orders))


@dataclass(frozen=True)
class PredictedForce:
    """What the posterior predicts for the force of a drive along the same motion; S draws, m rows.

    Attributes:
        model: force that the model needs at the draws [N], (S, m).
        replicated: the same with the noise and the small errors that a repetition would have [N], (S, m).
        inside: whether the measured force lies within the central 95 % of ``replicated``, (m,).
    """

    model: NDArray[np.float64]
    replicated: NDArray[np.float64]
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class MotionPosterior(Posterior):
    """The posterior of a model that is held against the force of its drive along a measured motion of m rows.

    Attributes:
        predictive: what the draws predict.
        motion: what was measured.
        measured: force of the drive, low-passed and thinned [N], (m,).
    """

    presenter: ClassVar[str] = "MOTION_POSTERIOR"
    errs_in: ClassVar[str] = "of the force, in every row by itself"
    noise_is_recorded: ClassVar[bool] = False

    predictive: PredictedForce
    motion: DrivenMotion
    measured: NDArray[np.float64]

    @property
    def count_inside(self) -> tuple[int, int]:
        """How many rows of force lie inside, and how many there are."""
        return int(np.sum(self.predictive.inside)), self.measured.size
