"""A tolerance that does not hold: against quadrature, and against what a tolerance may explain."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from savgs_ident.core.parameter import Parameter
from savgs_ident.diagnosis.score_test import prior_conflict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.inference.prior import Coordinates, sheet_coordinate

from .toy import TERMS, ToyPlant, draw

PLANT = ToyPlant()
NOISE = 0.02


def _evidence(width: float, seed: int, a: float) -> float:
    """Log integral of likelihood and prior over a stiffness known to ``width`` of its tolerance."""
    search = search_of(PLANT, draw(PLANT, {"a": a}, NOISE, seed))
    mode = find_map(search, (), {}, None)
    spread = mode.noise_scales.spread
    best = float(np.sum(PLANT.x * search.data.measured / spread) / np.sum(PLANT.x**2 / spread))

    def density(x: float) -> float:
        miss = search.data.measured - (1.0 + 0.2 * x) * PLANT.x
        least = search.data.measured - best * PLANT.x
        chi2 = float(np.sum((miss**2 - least**2) / spread))
        return float(np.exp(-0.5 * chi2 - 0.5 * (x / width) ** 2) / width)

    middle, reach = (best - 1.0) / 0.2, 8.0 * NOISE / 0.2
    return float(np.log(quad(density, middle - reach, middle + reach, epsabs=0.0)[0]))


@pytest.mark.parametrize(("a", "seed"), [(1.02, 1), (1.5, 2), (2.2, 3)])
def test_it_is_the_gain_of_a_wider_prior(a: float, seed: int) -> None:
    search = search_of(PLANT, draw(PLANT, {"a": a}, NOISE, seed))
    conflict = prior_conflict(find_map(search, (), {}, None), PLANT.nuisances)
    assert conflict.off == pytest.approx({"a": (a - 1.0) / 0.2}, abs=0.1)
    assert conflict.gain == pytest.approx(
        _evidence(DEFAULTS.broken_tolerance_width, seed, a) - _evidence(1.0, seed, a), abs=2e-2
    )


@dataclass(frozen=True)
class Tilted(ToyPlant):
    """With a second number that is known to a tolerance, nearly alike: b x |x|."""

    @property
    def nuisances(self) -> Coordinates:
        return (*super().nuisances, sheet_coordinate(Parameter("b", 0.0, "N", tolerance=0.2)))

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        return super().rows(values) + dict(values).get("b", 0.0) * self.x * np.abs(self.x)


@pytest.mark.parametrize(("b", "off"), [(0.0, {"a": 6.0}), (-1.4, {"a": 6.0, "b": -7.0})])
def test_those_that_are_off_together_are_found_together(b: float, off: dict[str, float]) -> None:
    plant = Tilted()
    search = search_of(plant, draw(plant, {"a": 2.2, "b": b}, NOISE, 6))
    conflict = prior_conflict(find_map(search, (), {}, None), plant.nuisances)
    assert dict(conflict.off) == pytest.approx(off, abs=0.3)
    # A tolerance that may be off by ten costs log 10, each further one its prior besides.
    spared = 0.5 * sum(each**2 for each in off.values())
    assert conflict.gain == pytest.approx(spared, abs=2.0 + 7.0 * len(off))


def test_what_a_tolerance_allows_is_no_conflict() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.2}, NOISE, 4))
    assert prior_conflict(find_map(search, (), {}, None), PLANT.nuisances).gain < 0.0


def test_parameters_of_effects_are_known_to_no_tolerance() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.0, "c": 3.0}, NOISE, 5))
    mode = find_map(search, TERMS[:1], {}, None)
    assert prior_conflict(mode, PLANT.nuisances).gain < 0.0
    assert prior_conflict(mode, ()) == (-np.inf, {})
