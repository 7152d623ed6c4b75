"""What sampling gives: draws with their convergence, marginals, predictions, what they mean, and the draws on file.

The file is ArviZ's inference data (netCDF), written whole and read back by name. Its groups are posterior,
posterior_predictive, sample_stats and observed_data; complex harmonics stand in them as real and imaginary parts.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.files import scratch_folder, write_bytes
from savgs_ident.core.presentation import Result
from savgs_ident.inference.background.constants import BACKGROUND
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import only_tests

if TYPE_CHECKING:
    import xarray as xr


Sampler = Literal["emcee", "nuts"]
"""The samplers there are."""

Role = Literal["identified", "tolerated", "nuisance"]
"""Identified by the data alone, known to a tolerance before, or a scale of the likelihood."""


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
class Posterior(Result):
    """A finished run; arrays are read-only.

    Attributes:
        model: the model with the posterior medians in place of the assumed values.
        sampler: which sampler ran.
        marginals: identified parameters first, then the nuisance scales, then the tolerated parameters.
        draws: name to values in SI, (chains, draws), in the order of ``marginals``.
        statistics: per draw, (chains, draws): "lp" log density, "accepted" whether the draw is a new one.
        convergence: whether they may be used.
        predictive: what they predict.
        measured: the response that they follow from.
        sentences: what the data say, in words.
        wall_s: time taken, from the response to the last draw [s].
    """

    presenter: ClassVar[str] = "POSTERIOR"

    model: Model
    sampler: Sampler
    marginals: tuple[Marginal, ...]
    draws: Mapping[str, NDArray[np.float64]]
    statistics: Mapping[str, NDArray[np.float64]]
    convergence: Convergence
    predictive: Predictive
    measured: HarmonicResponse
    sentences: tuple[str, ...]
    wall_s: float

    def of_tests(self, kept: NDArray[np.intp]) -> "Posterior":
        """With the measurement and the predictions of some of the tests; the draws are those from all."""
        measured = only_tests(self.measured, kept)
        return replace(self, measured=measured, predictive=self.predictive.of_tests(kept, measured.orders))

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
        """Whether the model may have no more than small errors of any model, to 97.5 %."""
        return not self["discrepancy"].q025 > BACKGROUND.largest_error

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the draws are not to be trusted, the most important first."""
        if self.explained:
            return self.convergence.reasons
        missed = 100.0 * self["discrepancy"].median
        what = (
            f"{UNEXPLAINED}: for that it would have to err by {missed:.2g} % of the response at each of its ports; "
            "look for what is missing with `diagnose`, until then the parameters make up for it by more than their "
            "intervals say"
        )
        return (what, *self.convergence.reasons)

    def to_arviz(self) -> "xr.DataTree":
        """The draws as ArviZ's inference data: the content of ``posterior.nc``."""
        return inference_data(self)

    def of_role(self, role: Role) -> tuple[Marginal, ...]:
        """The marginals of one role."""
        return tuple(each for each in self.marginals if each.role == role)

    def correlation(self, names: tuple[str, ...]) -> NDArray[np.float64]:
        """Correlation [1] of the draws of the named parameters, (n, n)."""
        return np.atleast_2d(np.corrcoef(np.stack([self.draws[name].ravel() for name in names])))


LARGEST = 2**28
"""Most bytes that all draws, or a piece of the file that has to be unpacked for them, may take in memory."""

FAR = 6.0
"""Standard deviations by which a parameter may be off the mean of its draws: its own posterior has it within 3."""

REMEDY = "give the posterior.nc that `savgs-ident posterior` wrote for this model"

Draws: TypeAlias = NDArray[np.float64]
"""Of one parameter, (n,), SI."""

DrawSource: TypeAlias = Path | Posterior
"""A ``posterior.nc``, or the posterior itself."""


def source_name(source: DrawSource) -> str:
    """What sentences call where draws come from."""
    return "the posterior" if isinstance(source, Posterior) else str(source)


def read_draws(path: DrawSource, names: Collection[str], count: int | None = None) -> dict[str, Draws]:
    """Draws by name, each (n,), SI, chains one after the other; of ``names``, those that the file holds.

    With a ``count``, at most so many, evenly spread over all. Raises :class:`InputError` if the file cannot be read
    or holds no finite draws of any.
    """
    if isinstance(path, Posterior):
        return thin_draws({name: np.ravel(path.draws[name]) for name in names if name in path.draws}, count)
    try:
        with h5py.File(path, "r") as file:
            group = file["posterior"]
            held = set(group.keys())
            _check_size(path, [group[name] for name in names if name in held])
            draws = {name: np.ravel(group[name][()]) for name in names if name in held}
    except OSError as error:
        raise InputError(f"cannot be read: {error}", source=path, remedy=REMEDY) from error
    except (KeyError, TypeError, AttributeError, ValueError, RuntimeError) as error:
        raise InputError("is no posterior", source=path, remedy=REMEDY) from error
    lengths = {values.size for values in draws.values()}
    finite = all(values.dtype.kind == "f" and np.isfinite(values).all() for values in draws.values())
    if len(lengths) != 1 or 0 in lengths or not finite:
        raise InputError("holds no finite draws of the model's parameters", source=path, remedy=REMEDY)
    return thin_draws({name: values.astype(np.float64) for name, values in draws.items()}, count)


def thin_draws(draws: Mapping[str, Draws], count: int | None) -> dict[str, Draws]:
    """At most ``count`` draws of each parameter, evenly spread over all, each (n,), SI; all without a count."""
    total = min((values.size for values in draws.values()), default=0)
    chosen = np.unique(np.linspace(0, total - 1, min(count or total, total)).astype(int))
    return {name: values[chosen] for name, values in draws.items()}


def far_from_draws(
    values: Mapping[str, float], draws: Mapping[str, Draws], limit: float = FAR
) -> tuple[str, ...]:
    """Names of the ``values`` [SI] that are more than ``limit`` standard deviations [1] off the mean of their draws.

    To be asked of all draws (n,), before they are thinned: few of them know no standard deviation, and one has none.
    """
    return tuple(
        name
        for name, each in draws.items()
        if each.size > 1 and abs(values[name] - float(np.mean(each))) > limit * float(np.std(each))
    )


def _check_size(path: Path, held: Sequence[h5py.Dataset]) -> None:
    """A file of some kilobytes can declare terabytes, and be read as so many zeros."""
    whole = sum(each.size * each.dtype.itemsize for each in held)
    pieces = [prod(each.chunks) * each.dtype.itemsize for each in held if each.chunks]
    if max([whole, *pieces]) > LARGEST:
        raise InputError(f"declares more than {LARGEST} bytes of draws", source=path, remedy=REMEDY)


_DIMENSIONS = ["dwell", "channel", "order"]


def inference_data(posterior: Posterior) -> "xr.DataTree":
    """All groups; variables carry their units."""
    # Only here: ArviZ and what it brings along take seconds to load.
    import arviz_base

    predictive, measured = posterior.predictive, posterior.measured
    orders = predictive.used.shape[2]
    channels = [each.name for each in posterior.model.channels]
    rows = [measured.channel(name) if name in measured.channels else 0 for name in channels]
    observed = np.where(predictive.used, measured.harmonics[:, rows, :orders], np.nan)
    replicated = np.where(predictive.used, predictive.replicated, np.nan)[None]
    model = predictive.model[None]
    tree = arviz_base.from_dict(
        {
            "posterior": dict(posterior.draws),
            "posterior_predictive": _parts("harmonics", replicated) | _parts("model", model),
            "sample_stats": dict(posterior.statistics),
            "observed_data": _parts("harmonics", observed),
        },
        dims={f"{name}_{part}": _DIMENSIONS for name in ("harmonics", "model") for part in ("re", "im")},
        coords={
            "dwell": list(measured.tests),
            "channel": channels,
            "order": np.arange(orders),
        },
        # A run that was stopped early may have fewer draws than walkers.
        check_conventions=False,
    )
    for marginal in posterior.marginals:
        tree["posterior"][marginal.name].attrs.update(
            unit=marginal.unit, about=marginal.about, role=marginal.role
        )
    for group in ("posterior_predictive", "observed_data"):
        tree[group].coords["frequency"] = ("dwell", measured.frequency, {"unit": "Hz"})
        tree[group].coords["spacing"] = ("dwell", measured.spacing, {"unit": "Hz"})
    tree.attrs["sampler"] = posterior.sampler
    return tree


def write_inference_data(posterior: Posterior, path: Path) -> Path:
    """Write the inference data, whole or not at all; raises :class:`InputError` if it cannot be written."""
    with scratch_folder() as folder:
        file = folder / "posterior.nc"
        inference_data(posterior).to_netcdf(file, engine="h5netcdf")
        return write_bytes(path, file.read_bytes())


def _parts(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{name}_re": np.real(values), f"{name}_im": np.imag(values)}
