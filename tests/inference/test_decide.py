"""The exact density of points, and none where the model has no solution."""

from dataclasses import replace

import numpy as np

from savgs_ident.inference.samplers.chains import decide

from .toy import Toy
from .toy_reference import log_density
from .toy_surrogate import Stand


def test_the_density_is_the_one_of_the_definitions(bent: Toy, rough: Stand) -> None:
    points = np.array(rough.surrogate.points(np.random.default_rng(1).standard_normal((8, 5))))
    points[:, -1] = np.abs(points[:, -1])
    found = decide(bent, rough.posterior.prior, points)
    off = found.log_density - log_density(bent, points)
    np.testing.assert_allclose(off, off[0], atol=1e-8)
    assert np.ptp(found.log_density) > 1.0


def test_points_without_a_solution_have_no_density(bent: Toy, rough: Stand) -> None:
    points = rough.surrogate.points(np.random.default_rng(1).standard_normal((8, 5)))
    half = replace(bent, edge=float(np.median(points[:, 0])))
    found = decide(half, rough.posterior.prior, points)
    np.testing.assert_array_equal(found.solved, points[:, 0] <= half.edge)
    whole = decide(bent, rough.posterior.prior, points)
    np.testing.assert_array_equal(found.log_density, np.where(found.solved, whole.log_density, -np.inf))
