"""What a search asks of a plant, and the data that it is held against: independent rows with their noise."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from savgs_ident.core.status import Status
from savgs_ident.core.threads import computed_once
from savgs_ident.inference.prior import Coordinates, EffectCoordinates, Scales

MULTIPLES = (0.4, 1.0, 2.5)
"""Shapes are tried at these multiples of their typical values, unless a term says otherwise."""


DEPENDENT = 1e-9
"""Size of a direction, over the largest, below which others make it up [1]."""


def spanned(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of length one, perpendicular to each other, that span the same as columns (m, n) of any units."""
    lengths = np.linalg.norm(columns, axis=0)
    along, sizes, _ = np.linalg.svd(columns / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    return along[:, sizes > DEPENDENT * sizes.max(initial=0.0)]


@dataclass(frozen=True)
class Prediction:
    """A plant at a point.

    Attributes:
        rows: what it predicts, in their own units, (m,).
        find_slopes: what :attr:`slopes` are found with: it takes longer than the rows, and not all are asked for.
        status: how the solution of the plant ended.
        warm_start: what the plant starts from nearby.
    """

    rows: NDArray[np.float64]
    find_slopes: Callable[[], NDArray[np.float64]]
    status: Status
    warm_start: Any

    @computed_once
    def slopes(self) -> NDArray[np.float64]:
        """Slopes of the rows in the named values [units of the rows per unit of the value], (m, n)."""
        return self.find_slopes()

    @property
    def solved(self) -> bool:
        """Whether the rows are to be trusted."""
        return self.status.ok


class NumberChange(NamedTuple):
    """What a term does that is the change of one number of the plant: the number is ``sheet + slope * amplitude``.

    Attributes:
        number: name of the number.
        sheet: its value on the data sheet [its unit].
        slope: its change per unit of the term's amplitude [unit of the number per unit of the amplitude].
    """

    number: str
    sheet: float
    slope: float


@dataclass(frozen=True)
class Term:
    """A candidate: something that may be missing in the plant's baseline.

    Attributes:
        name: its name.
        place: where in the plant it acts.
        amplitudes: coordinates at whose centres it vanishes.
        shapes: coordinates that say nothing while it vanishes.
        tries: values of shapes [SI] by name at which it is looked for; typical ones where left out.
        change: the number of the plant that it changes, where it does nothing else.
    """

    name: str
    place: str
    amplitudes: EffectCoordinates
    shapes: EffectCoordinates = ()
    tries: tuple[Mapping[str, float], ...] = ()
    change: NumberChange | None = None

    @property
    def coordinates(self) -> EffectCoordinates:
        """All its coordinates."""
        return self.amplitudes + self.shapes

    @cached_property
    def tried(self) -> tuple[dict[str, float], ...]:
        """All its shapes [SI] by name, for every try."""
        typical = {each.name: each.centre for each in self.shapes}
        if self.tries or not self.shapes:
            return tuple(typical | dict(each) for each in self.tries or ({},))
        return tuple(self._at(multiple) for multiple in MULTIPLES)

    def _at(self, multiple: float) -> dict[str, float]:
        return {each.name: min(max(multiple * each.centre, each.lower), each.upper) for each in self.shapes}


class Plant(Protocol):
    """A differentiable prediction with terms that may be added."""

    @property
    def nuisances(self) -> Coordinates:
        """The baseline's own parameters, free ones and tolerances."""

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        """Rows with the given terms at ``values``, with slopes in ``names``, started from ``warm_start`` if not None.

        Values are in SI.
        """

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        """What to start from nearby, made as precise as it can be. Values are in SI."""

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        """First-order change of the rows per unit of each candidate's amplitudes, wherever it is tried.

        Shape (tries, m, amplitudes) each, about a point where the plant has ``warm_start``.
        """


@dataclass(frozen=True)
class Data:
    """m numbers with independent noise, each in a unit of its own, and errors of the model that they may share.

    A discrepancy d of the model is normal with covariance d^2 (diag(a^2) + B B'): errors of each number by itself,
    and errors that many of them share. Turned into the principal axes of that covariance in units of the noise, the
    numbers are independent again (:attr:`independent`), and all that holds for independent numbers holds for them.

    Attributes:
        measured: the numbers, (m,).
        variance: variance of their noise, (m,).
        discrepancy_scale: a, by how much a relative discrepancy of one moves each by itself, (m,).
        test: which test each belongs to, counted from 0, (m,).
        scales: what is known beforehand of noise scale and discrepancy.
        shared: B, by how much it moves them together, (m, k); None where they share nothing.
        tolerated: errors of known size that they share, (m, t): what is known of the model to a tolerance, but is no
            number of its own. Their scale is that of the noise. None where there are none.
        nuisance: directions in which they say nothing, (m, s): what other initial states of tests and offsets of
            sensors would change. None where there are none. There are so many independent numbers less.
    """

    measured: NDArray[np.float64]
    variance: NDArray[np.float64]
    discrepancy_scale: NDArray[np.float64]
    test: NDArray[np.intp]
    scales: Scales = field(default_factory=Scales)
    shared: NDArray[np.float64] | None = None
    tolerated: NDArray[np.float64] | None = None
    nuisance: NDArray[np.float64] | None = None

    def part(self, mask: NDArray[np.bool_]) -> "Data":
        """The numbers that ``mask`` (m,) picks: the same object each time, for its axes take long to find."""
        if mask.all():
            return self
        which = np.packbits(mask).tobytes()
        return self._parts.get(which) or self._parts.setdefault(which, self._picked(mask))

    @computed_once
    def _parts(self) -> dict[bytes, "Data"]:
        return {}

    def _picked(self, mask: NDArray[np.bool_]) -> "Data":
        return Data(
            self.measured[mask],
            self.variance[mask],
            self.discrepancy_scale[mask],
            self.test[mask],
            self.scales,
            None if self.shared is None else self.shared[mask],
            None if self.tolerated is None else self.tolerated[mask],
            None if self.nuisance is None else self.nuisance[mask],
        )

    @computed_once
    def independent(self) -> "Data":
        """The numbers turned into axes in which neither noise nor discrepancy is shared."""
        if not self._share:
            return self
        sizes, _ = self._axes
        return Data(
            self.turned(self.measured), np.ones(sizes.size), sizes, np.zeros(sizes.size, np.intp), self.scales
        )

    def turned(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """What changes the numbers, (m,) or (m, n), in the axes in which they are independent."""
        if not self._share:
            return rows
        _, axes = self._axes
        return np.asarray(axes @ rows)

    def weights(self, turned: NDArray[np.float64]) -> NDArray[np.float64]:
        """Weights (m,) of the numbers that stand for weights of the independent ones: the transpose of turning."""
        if not self._share:
            return turned
        _, axes = self._axes
        return np.asarray(axes.T @ turned)

    def marginal(self, noise: float, discrepancy: float) -> NDArray[np.float64]:
        """Variance (m,) [their units squared] of each number by itself, at a noise scale and a discrepancy [1]."""
        known, together = (
            0.0 if each is None else np.sum(each**2, axis=1) for each in (self.tolerated, self.shared)
        )
        return np.asarray(
            noise**2 * (self.variance + known) + discrepancy**2 * (self.discrepancy_scale**2 + together)
        )

    def draw_errors(
        self, noise: float, discrepancy: float, random: np.random.Generator
    ) -> NDArray[np.float64]:
        """Errors of the numbers (m,) [their units], at a noise scale and a discrepancy [1]."""
        sd = np.sqrt(noise**2 * self.variance + (discrepancy * self.discrepancy_scale) ** 2)
        drawn = sd * random.standard_normal(sd.size)
        for columns, size in ((self.tolerated, noise), (self.shared, discrepancy)):
            if columns is not None:
                drawn += size * columns @ random.standard_normal(columns.shape[1])
        return drawn

    def explained_by_nuisances(self, missed: NDArray[np.float64]) -> NDArray[np.float64]:
        """The part of numbers, (m,) or (m, n), that goes along the nuisances: by their noise the nearest such."""
        if self.nuisance is None:
            return np.zeros_like(missed)
        weight = 1.0 / np.sqrt(self.variance)
        whitened = self.nuisance * weight[:, None]
        sizes = np.linalg.lstsq(whitened, (missed.T * weight).T)[0]
        return np.asarray(self.nuisance @ sizes)

    @computed_once
    def left_by_nuisances(self) -> NDArray[np.float64]:
        """The share of the noise's variance of each number that nuisances leave [1], (m,): m - s in all."""
        if self.nuisance is None:
            return np.ones(self.variance.size)
        basis = spanned(self.nuisance / np.sqrt(self.variance)[:, None])
        return np.asarray(1.0 - np.sum(basis**2, axis=1))

    @property
    def _share(self) -> bool:
        return any(each is not None for each in (self.shared, self.tolerated, self.nuisance))

    @computed_once
    def _axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Discrepancy scales (m,) along the principal axes, in noise sd, and what turns the numbers there, (m, m).

        Both have fewer rows where numbers say nothing in some directions.
        """
        noise, alone = np.diag(self.variance), np.diag(self.discrepancy_scale)
        if self.tolerated is not None:
            noise += self.tolerated @ self.tolerated.T
        whiten = solve_triangular(np.linalg.cholesky(noise), np.eye(noise.shape[0]), lower=True)
        if self.nuisance is not None:
            basis = spanned(whiten @ self.nuisance)
            whiten = np.linalg.qr(basis, mode="complete")[0][:, basis.shape[1] :].T @ whiten
        errors = whiten @ (alone if self.shared is None else np.concatenate([alone, self.shared], axis=1))
        squares, axes = np.linalg.eigh(errors @ errors.T)
        return np.sqrt(np.maximum(squares, 0.0)), axes.T @ whiten

    @property
    def tests(self) -> int:
        """How many tests there are."""
        return int(self.test.max()) + 1
