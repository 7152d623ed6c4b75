"""A tolerance that does not hold: against quadrature, and against what a tolerance may explain."""

import numpy as np
import pytest
from scipy.integrate import quad

from savgs_ident.diagnosis.score_test import prior_conflict
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.find_map import find_map, search_of

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
    assert conflict.parameter == "a"
    assert conflict.tolerances == pytest.approx((a - 1.0) / 0.2, abs=0.1)
    assert conflict.gain == pytest.approx(
        _evidence(DEFAULTS.broken_tolerance_width, seed, a) - _evidence(1.0, seed, a), abs=2e-2
    )


def test_what_a_tolerance_allows_is_no_conflict() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.2}, NOISE, 4))
    assert prior_conflict(find_map(search, (), {}, None), PLANT.nuisances).gain < 0.0


def test_parameters_of_effects_are_known_to_no_tolerance() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.0, "c": 3.0}, NOISE, 5))
    mode = find_map(search, TERMS[:1], {}, None)
    assert prior_conflict(mode, PLANT.nuisances).gain < 0.0
    assert prior_conflict(mode, ()) == (-np.inf, "", 0.0)
