"""Where a surrogate is highest, free and with a parameter held, against other searches."""

import numpy as np
import pytest
from scipy.optimize import minimize

from savgs_ident.inference.prior import sheet_coordinate
from savgs_ident.inference.surrogate_shape import surrogate_mode

from .toy import FREE, Toy, straight_toy
from .toy_surrogate import Stand, mode_of, stand_for


@pytest.mark.parametrize("miss", [0.0, 0.03])
def test_a_toys_mode_is_the_one_of_another_search(miss: float) -> None:
    toy: Toy = straight_toy(miss=miss)
    stand: Stand = stand_for(toy)
    found = surrogate_mode(stand.surrogate)
    assert found.status.ok
    scales = toy.likelihood.scales.coordinates(found.noise_scales.noise, found.noise_scales.discrepancy)
    # The toy is linear: its surrogate is exact.
    np.testing.assert_allclose(np.append(found.x * FREE.widths, scales), mode_of(toy), atol=2e-3)
    point = np.append(found.x * FREE.widths, scales)
    rows = toy.rows(point[None, :-2])[0][0]
    assert found.value == pytest.approx(stand.posterior.density(rows, point), abs=1e-9)


def test_with_a_parameter_held_the_others_make_the_best_of_it(bent: Toy, rough: Stand) -> None:
    free, place = FREE, FREE.names.index("damping")
    best = surrogate_mode(rough.surrogate)
    level = float(best.x[place]) + 0.3 / free.widths[place]
    value = sheet_coordinate(free.parameters[place]).value(level)
    held = surrogate_mode(rough.surrogate, best.values, {"damping": value})
    assert held.status.ok
    assert held.x[place] == pytest.approx(level, abs=1e-9)
    assert held.value < best.value - 0.1

    def depth(rest: np.ndarray) -> float:
        point = np.insert(rest, place, level * free.widths[place])
        return -float(rough.surrogate.of_point(rough.surrogate.coordinates(point[None])[0]))

    scales = bent.likelihood.scales.coordinates(held.noise_scales.noise, held.noise_scales.discrepancy)
    start = np.delete(np.append(held.x * free.widths, scales), place) + 0.02
    other = minimize(
        depth, start, method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-7, "maxiter": 4000}
    )
    assert held.value == pytest.approx(-other.fun, abs=1e-3)
