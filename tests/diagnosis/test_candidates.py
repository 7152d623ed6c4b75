"""Hypotheses as a report shows them."""

from typing import Any

import numpy as np
import pytest

from savgs_ident.diagnosis.candidates import joint_sigma
from savgs_ident.diagnosis.score_test import Score

TERM: Any = None


def _score(sigma: float, *direction: float) -> Score:
    along = np.array(direction)
    return Score(TERM, sigma, 0.0, {}, 1.0, along / np.linalg.norm(along))


def test_what_two_effects_share_counts_once() -> None:
    """Against the length of the gap's projection on the plane of both."""
    gap = np.array([3.0, 4.0, 12.0])
    one, other = np.array([1.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)
    scores = [_score(float(gap @ each), *each) for each in (one, other)]
    assert joint_sigma(scores) == pytest.approx(5.0)


def test_effects_that_do_the_same_are_as_significant_as_one() -> None:
    assert joint_sigma([_score(7.0, 1.0, 2.0), _score(7.0, 1.0, 2.0)]) == pytest.approx(7.0)


def test_one_alone_has_its_own_and_none_has_none() -> None:
    assert joint_sigma([_score(7.0, 1.0, 2.0)]) == pytest.approx(7.0)
    assert joint_sigma([]) == 0.0
