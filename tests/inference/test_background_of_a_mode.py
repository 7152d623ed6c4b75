"""Small errors are those about the mode that is found with them; where none settles, the spread is the error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.free_vector import FreeVector
from savgs_ident.core.status import Status
from savgs_ident.inference.likelihood import Likelihood, sharing_errors
from savgs_ident.inference.near_mode import LinearisationPoint, LinearRows
from savgs_ident.inference.observations import Data
from savgs_ident.inference.posterior_mode import (
    PASSES,
    PosteriorDensity,
    find_mode_with_background,
    linearisation_point,
)
from savgs_ident.inference.prior import Prior, Scales

from .toy import Toy, straight_toy


@dataclass
class Moving:
    """A linear model whose small errors lie along ``first`` where its parameter is below zero, else along ``second``.

    ``asked`` counts how often they were asked for.
    """

    toy: Toy
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    asked: int = 0

    @property
    def free(self) -> FreeVector:
        """Those of the toy."""
        return self.toy.problem.free

    def linear_rows(
        self, likelihood: Likelihood, u: Any, warm_start: Any, predicted: Any = None
    ) -> LinearRows:
        """Rows and slopes, turned as the likelihood's are."""
        at = np.asarray(u)
        rows, slopes = self.toy.rows(at[None])[0][0], self.toy.slopes(at)
        if likelihood.turning is not None:
            rows, slopes = (np.asarray(likelihood.turning) @ each for each in (rows, slopes))
        return LinearRows(rows, slopes, None, Status.CONVERGED)

    def with_background(
        self, likelihood: Likelihood, at: LinearisationPoint, drifting: Sequence[str]
    ) -> tuple["Moving", Likelihood, Data]:
        """Errors along the one or the other."""
        self.asked += 1
        along = self.first if at.point[0] < 0.0 else self.second
        data = replace(likelihood.data, shared=along[:, None], scales=Scales(discrepancy=0.002))
        return self, sharing_errors(likelihood, data), data


def _plain(first: float, second: float) -> tuple[PosteriorDensity, LinearisationPoint]:
    """A model that is off so that errors along the one lead its first parameter up, and along the other down."""
    toy = straight_toy(strength=40.0, seed=5)
    sd = np.sqrt(np.asarray(toy.likelihood.variance))
    column = toy.slope[:, 0]
    # Half of the rows say that the parameter is as much below zero as the others say that it is above.
    half = np.arange(sd.size) % 2 == 0
    off = np.where(half, 1.0, -1.0) * column * 0.5
    measured = np.asarray(toy.likelihood.measured) + off
    likelihood = straight_toy(strength=40.0, seed=5).likelihood
    likelihood = type(likelihood)(**{**vars(likelihood), "measured": jnp.asarray(measured)})
    errs = {1.0: np.where(half, off, 0.0), -1.0: np.where(half, 0.0, off), 0.0: off}
    problem = Moving(toy, 300.0 * errs[first], 300.0 * errs[second])
    density = PosteriorDensity(problem, likelihood, Prior(toy.problem.free))  # type: ignore[arg-type]
    u = jnp.asarray(np.full(len(toy.problem.free.names), -0.1))
    return density, linearisation_point(density, u, None)


def _asked(density: PosteriorDensity) -> int:
    problem: Any = density.problem
    return int(problem.asked)


@pytest.mark.parametrize("sides", [(0.0, 0.0), (1.0, -1.0)])
def test_a_mode_with_the_errors_about_itself_is_found_and_has_its_own_covariance(
    sides: tuple[float, float],
) -> None:
    density, at = _plain(*sides)
    found = find_mode_with_background(density, at, (), lambda _: None)
    assert found.settled
    # The start lies far off, the mode from there does not.
    assert _asked(density) == 2
    np.testing.assert_allclose(found.covariance, found.search.covariance(found.found))


def test_where_each_background_leads_to_the_other_the_spread_is_between_both() -> None:
    density, at = _plain(-1.0, 1.0)
    found = find_mode_with_background(density, at, (), lambda _: None)
    assert not found.settled
    assert _asked(density) == PASSES
    within = np.sqrt(np.diag(found.search.covariance(found.found)))
    above, below = found.earlier[0, 0], found.found.x[0]
    assert above - below > 50.0 * within[0]
    assert 0.5 * (above - below) < np.sqrt(found.covariance[0, 0]) < above - below
    # What the backgrounds agree on is known as well as ever.
    assert np.sqrt(found.covariance[1, 1]) == pytest.approx(within[1], rel=0.01)
