"""Sizes that change a response by what was drawn, and forms that stay within bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.validation.effect_size import CLOSE, SHAPE_LIMIT, draw_form, find_size

from ..in_one_test import over


@given(
    gain=st.floats(1e-4, 10.0),
    power=st.floats(0.5, 2.5),
    target=st.floats(0.03, 0.25),
    most=st.floats(0.5, 1e3),
)
def test_a_size_is_found_wherever_there_is_one(gain: float, power: float, target: float, most: float) -> None:
    def change(size: float) -> float:
        assert 0.0 < size <= most
        return gain * size**power

    size = find_size(change, target, most)
    reach = change(most) / target
    if size is None:
        assert reach < 1.0 + CLOSE
    else:
        assert change(size) == pytest.approx(target, rel=CLOSE)


@pytest.mark.parametrize("threshold", [0.3, 3.0, 20.0])
def test_an_effect_that_sets_in_late_is_found(threshold: float) -> None:
    def change(size: float) -> float:
        return 0.1 * max(size - threshold, 0.0) / threshold

    size = find_size(change, 0.05, 100.0 * threshold)
    assert size is not None
    assert change(size) == pytest.approx(0.05, rel=CLOSE)


def test_sizes_without_a_motion_are_too_large() -> None:
    size = find_size(lambda size: 0.1 * size if size < 0.9 else None, 0.06, 50.0)
    assert size == pytest.approx(0.6, rel=CLOSE)


def test_what_does_too_little_within_its_bounds_has_no_size() -> None:
    assert find_size(lambda size: 0.01 * size, 0.05, 2.0) is None
    assert find_size(lambda size: 0.0, 0.05, 100.0) is None
    assert find_size(lambda size: 0.1 * size / (1.0 + 3.0 * size), 0.05, 100.0) is None


@over("name", CATALOGUE)
def test_forms_keep_to_the_bounds_of_their_effect(name: str) -> None:
    effect = CATALOGUE[name]
    bounds = {each.name: each for each in effect.parameters}
    signs = set()
    for seed in range(40):
        form = draw_form(effect, np.random.default_rng(seed))
        assert set(form.direction) == set(effect.null)
        assert dict(form.at(0.0)) | dict(effect.null) == form.at(0.0)
        for size in (form.most * 1e-3, form.most):
            for parameter, value in form.at(size).items():
                slack = 1e-9 * abs(value)
                assert bounds[parameter].lower - slack <= value <= bounds[parameter].upper + slack, parameter
        for parameter, value in form.shapes.items():
            ratio = value / bounds[parameter].value
            assert ratio * (1.0 + 1e-12) >= 1.0 / SHAPE_LIMIT, parameter
            assert ratio <= SHAPE_LIMIT * (1.0 + 1e-12), parameter
        signs |= {(key, step > 0.0) for key, step in form.direction.items()}
    for parameter in effect.null:
        both = bounds[parameter].lower < effect.null[parameter] < bounds[parameter].upper
        assert len({sign for key, sign in signs if key == parameter}) == (2 if both else 1), parameter
