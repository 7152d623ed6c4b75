"""The top of a hill, free and on a plane, against what analysis says."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.posterior.ascend import ascend

from .hill import NormalHill, a_normal_hill
from .toy import Toy, straight_toy
from .toy_surrogate import Stand, mode_of, stand_for

HILL = a_normal_hill(4)
START = np.array([2.0, -3.0, 1.0, 0.5])


def test_the_top_of_a_normal_density_is_found() -> None:
    top = ascend(HILL, START)
    assert top.found
    np.testing.assert_allclose(top.t, HILL.centre, atol=1e-4)
    assert top.value == pytest.approx(7.5, abs=1e-8)


@pytest.mark.parametrize("level", [-4.0, 0.0, 3.0])
def test_on_a_plane_it_is_where_the_multiplier_says(level: float) -> None:
    held = np.array([1.0, -2.0, 0.5, 3.0])
    centre, covariance = np.asarray(HILL.centre), np.linalg.inv(np.asarray(HILL.precision))
    rest = level - held @ centre
    true = centre + covariance @ held * rest / (held @ covariance @ held)
    top = ascend(HILL, START, held, level)
    assert top.found
    assert held @ top.t == pytest.approx(level, abs=1e-10)
    np.testing.assert_allclose(top.t, true, atol=1e-4)
    assert top.value == pytest.approx(7.5 - 0.5 * rest**2 / (held @ covariance @ held), abs=1e-7)


def test_a_hill_without_a_top_is_not_climbed() -> None:
    slope = NormalHill(jnp.zeros(4), -0.1 * jnp.eye(4))
    top = ascend(slope, START)
    assert not (top.found and np.abs(top.t).max() < 1e3)


def test_a_toys_mode_is_the_one_of_another_search() -> None:
    toy: Toy = straight_toy(miss=0.03)
    stand: Stand = stand_for(toy)
    top = ascend(stand.surrogate, stand.surrogate.start)
    assert top.found
    # The toy is linear: its surrogate is exact.
    np.testing.assert_allclose(stand.surrogate.points(top.t), mode_of(toy), atol=1e-3)
