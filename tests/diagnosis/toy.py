"""A plant that can be checked by hand: a stiffness line in several tests, and what may be added to it.

    y = a x + c x^2 + s sin(w x) + t x^3 / (1 + t^2),       |x| <= 1 in every test

with the tolerance a and the terms "bend" (c), "ripple" (s with the shape w) and "twist" (t, nonlinear).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.presentation import no_progress
from savgs_ident.core.status import Status
from savgs_ident.diagnosis.findings import Findings
from savgs_ident.diagnosis.search import single_effects, with_pairs
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.laplace_fit import LaplaceFit, Search
from savgs_ident.inference.observations import Data, Prediction, Term
from savgs_ident.inference.prior import Coordinates, Linear, Logarithmic, sheet_coordinate

STEP = 1e-6

TERMS = (
    Term("bend", "spring", (Linear("c", "N", 0.0, 0.4),)),
    Term(
        "ripple",
        "sensor",
        (Linear("s", "N", 0.0, 0.4, lower=0.0),),
        (Logarithmic("w", "1", 6.0, 0.5),),
        tries=({"w": 3.0}, {"w": 6.0}, {"w": 12.0}),
    ),
    Term("twist", "joint", (Linear("t", "1", 0.0, 0.4),)),
)


@dataclass(frozen=True)
class ToyPlant:
    """Tests of ``points`` instants each."""

    tests: int = 6
    points: int = 20

    @cached_property
    def x(self) -> NDArray[np.float64]:
        return np.tile(np.linspace(-1.0, 1.0, self.points), self.tests)

    @property
    def nuisances(self) -> Coordinates:
        return (sheet_coordinate(Parameter("a", 1.0, "N", tolerance=0.2)),)

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        v = {"a": 1.0, "c": 0.0, "s": 0.0, "w": 6.0, "t": 0.0} | dict(values)
        bent = v["a"] * self.x + v["c"] * self.x**2 + v["s"] * np.sin(v["w"] * self.x)
        return bent + v["t"] * self.x**3 / (1.0 + v["t"] ** 2)

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        here = self.rows(values)
        slopes = [
            (
                self.rows(dict(values) | {n: values[n] + STEP})
                - self.rows(dict(values) | {n: values[n] - STEP})
            )
            / (2.0 * STEP)
            for n in names
        ]
        by_value = np.reshape(slopes, (len(names), here.size)).T
        return Prediction(here, lambda: by_value, Status.CONVERGED, warm_start)

    def refined(self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any) -> Any:
        return warm_start

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[NDArray[np.float64]]:
        found = []
        for term in candidates:
            amplitudes = {each.name: each.centre for each in term.amplitudes}
            names = [each.name for each in term.amplitudes]
            here = [dict(values) | shapes | amplitudes for shapes in term.tried]
            found.append(np.stack([self.predict(terms, each, names, None).slopes for each in here]))
        return found


def forward_selection(
    search: Search,
    base: LaplaceFit,
    terms: Sequence[Term],
    known: Sequence[tuple[str, ...]] = (),
    constants: DecisionConstants = DEFAULTS,
) -> Findings:
    """Single effects, then pairs, as a diagnosis looks for them where no learned law explains all."""
    singles = single_effects(search, base, terms, no_progress, known, constants)
    return with_pairs(search, singles, terms, no_progress, constants)


def best_of(findings: Findings) -> LaplaceFit:
    """The hypothesis with the greatest evidence."""
    return max((findings.base, *findings.modes), key=lambda mode: mode.evidence)


def draw(plant: ToyPlant, values: Mapping[str, float], noise: float, seed: int, miss: float = 0.0) -> Data:
    """Data of a plant at the given parameters, with noise and a discrepancy of relative size ``miss``."""
    rng = np.random.default_rng(seed)
    truth = plant.rows(values)
    spread = np.sqrt(noise**2 + miss**2)
    measured = truth + spread * rng.standard_normal(truth.size)
    test = np.repeat(np.arange(plant.tests), plant.points)
    return Data(measured, np.full(truth.size, noise**2), np.ones(truth.size), test)
