"""Errors that rows share: turned into principal axes, the rows are independent, with the density that they had."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.inference.likelihood import noise_scales
from savgs_ident.inference.observations import Data

from ..diagnosis.toy import TERMS, ToyPlant, draw

ROWS = 12


def _data(seed: int) -> Data:
    random = np.random.default_rng(seed)
    return Data(
        measured=random.standard_normal(ROWS),
        variance=random.uniform(0.5, 2.0, ROWS),
        discrepancy_scale=random.uniform(0.5, 2.0, ROWS),
        test=np.arange(ROWS) // 4,
        shared=random.standard_normal((ROWS, 3)),
        tolerated=random.standard_normal((ROWS, 2)),
    )


def _covariance(data: Data, noise: float, discrepancy: float) -> NDArray[np.float64]:
    """As the model of the errors says it, written down directly."""
    assert data.shared is not None
    assert data.tolerated is not None
    known = np.diag(data.variance) + data.tolerated @ data.tolerated.T
    return noise**2 * known + discrepancy**2 * (
        np.diag(data.discrepancy_scale**2) + data.shared @ data.shared.T
    )


@given(st.integers(0, 1000), st.floats(0.5, 2.0), st.floats(0.0, 3.0))
def test_the_density_is_that_of_the_whole_covariance(seed: int, noise: float, discrepancy: float) -> None:
    data = _data(seed)
    rows, turned = data.independent, data.turned(data.measured)
    spread = rows.marginal(noise, discrepancy)
    mine = -0.5 * float(np.sum(turned**2 / spread + np.log(spread)))
    none = np.zeros(ROWS)
    whole, known = (
        multivariate_normal(none, _covariance(data, *each)) for each in ((noise, discrepancy), (1.0, 0.0))
    )
    # In units of the noise: the density at no residual and unit noise is one.
    expected = float(whole.logpdf(data.measured) - known.logpdf(none))
    assert mine == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_each_row_by_itself_has_the_variance_on_the_diagonal() -> None:
    data = _data(1)
    np.testing.assert_allclose(data.marginal(1.2, 0.7), np.diag(_covariance(data, 1.2, 0.7)))


def test_weights_of_independent_rows_give_the_same_sum() -> None:
    data = _data(2)
    weights = np.linspace(-1.0, 1.0, ROWS)
    assert weights @ data.turned(data.measured) == pytest.approx(data.weights(weights) @ data.measured)


def test_a_part_knows_the_errors_of_its_own_rows_alone() -> None:
    data = _data(3)
    kept = data.test != 1
    part = data.part(kept)
    whole = _covariance(data, 1.0, 0.5)[np.ix_(kept, kept)]
    inside = part.turned(np.eye(int(kept.sum())))
    np.testing.assert_allclose(
        inside @ whole @ inside.T, np.diag(part.independent.marginal(1.0, 0.5)), atol=1e-9
    )


def test_errors_that_are_drawn_have_the_covariance_that_is_said() -> None:
    data, random = _data(4), np.random.default_rng(0)
    drawn = np.stack([data.draw_errors(1.1, 0.6, random) for _ in range(20_000)])
    expected = _covariance(data, 1.1, 0.6)
    np.testing.assert_allclose(np.cov(drawn.T), expected, atol=0.05 * np.abs(expected).max())


def test_an_error_that_rows_share_is_no_evidence_for_an_effect() -> None:
    """A bend that the background has, too small to matter, is called a bend only by rows taken for independent."""
    plant = ToyPlant()
    data = draw(plant, {"a": 1.05, "c": 0.004}, noise=1e-3, seed=5)
    data = replace(data, discrepancy_scale=np.full(data.measured.size, 1e-3))
    errors = 0.02 * np.stack([plant.x**2, np.abs(plant.x)], axis=1)
    gain = {}
    for name, each in {"independent": data, "shared": replace(data, shared=errors / 0.05)}.items():
        search = search_of(plant, each)
        base, bent = (find_map(search, terms, {}, None) for terms in ((), (TERMS[0],)))
        assert base.status.ok
        assert bent.status.ok
        gain[name] = bent.evidence - base.evidence
    assert gain["independent"] > 20.0
    assert gain["shared"] < 2.0


def test_the_scale_of_shared_errors_is_found() -> None:
    random = np.random.default_rng(6)
    data = replace(
        draw(ToyPlant(40), {}, 1e-3, 6),
        shared=random.standard_normal((800, 60)),
        discrepancy_scale=np.full(800, 0.1),
    )
    found = [
        noise_scales(data.independent, data.turned(data.draw_errors(1.0, 0.02, random))).discrepancy
        for _ in range(20)
    ]
    assert np.mean(found) == pytest.approx(0.02, rel=0.05)
