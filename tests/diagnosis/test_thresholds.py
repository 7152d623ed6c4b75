"""Every constant that decides says where it is from."""

import ast
import inspect
from dataclasses import FrozenInstanceError, fields

import pytest

from savgs_ident.diagnosis import thresholds
from savgs_ident.diagnosis.thresholds import DEFAULTS, DecisionConstants
from savgs_ident.inference.background import constants

from ..in_one_test import over


def _docstrings() -> dict[str, str]:
    """The string after each field."""
    sources = (inspect.getsource(each) for each in (constants, thresholds))
    records = [each for text in sources for each in ast.parse(text).body if isinstance(each, ast.ClassDef)]
    pairs = [pair for each in records for pair in zip(each.body, each.body[1:], strict=False)]
    return {
        field.target.id: text.value.value
        for field, text in pairs
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


@over("name", [each.name for each in fields(DecisionConstants)])
def test_a_constant_says_where_it_is_from(name: str) -> None:
    assert "Origin: " in _docstrings()[name]


def test_the_priors_of_all_hypotheses_sum_to_one() -> None:
    priors = (DEFAULTS.prior_none, DEFAULTS.prior_single, DEFAULTS.prior_pair, DEFAULTS.prior_unknown)
    assert sum(priors) == pytest.approx(1.0)


def test_constants_are_not_changed_in_place() -> None:
    with pytest.raises(FrozenInstanceError):
        DEFAULTS.parents = 5  # type: ignore[misc]
