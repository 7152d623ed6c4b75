"""Tests that are left out, and where a gap is attributed to, on a plant that can be checked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.diagnosis.held_out import HeldOut, hold_out, predict_left_out, select_in_folds
from savgs_ident.diagnosis.localisation import Localisation, anywhere, localise
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.background.port_functions import InputLocation, Law
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import LaplaceFit, Search, search_of

from .toy import TERMS, ToyPlant, draw

PLANT = ToyPlant()
NOISE = 0.02


def test_left_out_tests_are_predicted_without_being_seen() -> None:
    data = draw(PLANT, {"a": 1.1, "c": 0.3}, NOISE, 8)
    search = search_of(PLANT, data)
    mode: LaplaceFit = find_map(search, TERMS[:1], {}, None)
    seen = hold_out(search, mode, TERMS[:1])
    fold = data.test % DEFAULTS.held_out_folds == 0
    measured = np.where(fold, data.measured + 5.0, data.measured)
    spoilt = search_of(PLANT, type(data)(measured, data.variance, data.discrepancy_scale, data.test))
    again = hold_out(spoilt, mode, TERMS[:1])
    np.testing.assert_allclose(again.rows[fold], seen.rows[fold], atol=1e-6)
    assert np.abs(again.rows[~fold] - seen.rows[~fold]).max() > 0.1
    without = hold_out(search, find_map(search, (), {}, None), ())
    assert seen.mean > without.mean + 1.0


def test_left_out_rows_are_those_of_the_joint_normal_density() -> None:
    """Parameters, errors within tolerances and noise as one normal density, conditioned as a whole."""
    tolerated = 0.02 * np.stack([PLANT.x**2, np.repeat(np.arange(6.0), PLANT.points)], axis=1)
    data = replace(draw(PLANT, {"a": 1.1}, NOISE, 8), tolerated=tolerated)
    part = Search(PLANT, data, data.test != 2)
    found = find_map(part, (), {}, None)
    out, scales = ~part.mask, found.noise_scales
    rows, density = predict_left_out(
        part,
        out,
        found.prediction.rows,
        found.slopes,
        part.missed(found.prediction),
        found.covariance(),
        scales,
    )
    errors = scales.noise**2 * (np.diag(data.variance) + tolerated @ tolerated.T)
    errors += scales.discrepancy**2 * np.diag(data.discrepancy_scale**2) + found.slopes @ found.slopes.T
    mean = PLANT.rows({})
    gain = np.linalg.solve(errors[np.ix_(part.mask, part.mask)], errors[np.ix_(part.mask, out)]).T
    np.testing.assert_allclose(rows, mean[out] + gain @ (data.measured - mean)[part.mask], atol=1e-8)
    variance = np.diag(errors[np.ix_(out, out)] - gain @ errors[np.ix_(part.mask, out)])
    expected = -0.5 * ((data.measured[out] - rows) ** 2 / variance + np.log(variance / data.variance[out]))
    np.testing.assert_allclose(density, expected, atol=1e-8)


def test_each_test_is_predicted_by_what_the_others_select() -> None:
    """A bend in one fold alone: the other folds do not know of it, and that fold does not get to say so."""
    bend = np.where(over_tests(0), 0.3, 0.0)
    data = draw(PLANT, {"a": 1.1}, NOISE, 14)
    data = replace(data, measured=data.measured + bend * PLANT.x**2)
    search = search_of(PLANT, data)
    held = [hold_out(search, find_map(search, terms, {}, None), terms) for terms in ((), TERMS[:1])]
    rows = select_in_folds(data, held, [0.0, 0.0])
    first = over_tests(0)
    np.testing.assert_array_equal(rows[first], held[0].rows[first])
    np.testing.assert_array_equal(rows[~first], held[1].rows[~first])


def test_what_holds_in_the_first_tests_alone_does_not_reach_beyond_them() -> None:
    def gain(bend: np.ndarray) -> float:
        data = draw(PLANT, {"a": 1.1}, NOISE, 15)
        search = search_of(PLANT, replace(data, measured=data.measured + bend * PLANT.x**2))
        without, bent = (hold_out(search, find_map(search, t, {}, None), t) for t in ((), TERMS[:1]))
        return bent.beyond - without.beyond

    everywhere = np.full(PLANT.x.size, 0.3)
    assert gain(everywhere) > 1.0
    assert gain(np.where(np.arange(PLANT.x.size) < 4 * PLANT.points, 0.3, 0.0)) < 0.0


def over_tests(fold: int) -> np.ndarray:
    """Rows of one of the interleaved folds."""
    return np.repeat(np.arange(PLANT.tests), PLANT.points) % DEFAULTS.held_out_folds == fold


def test_a_law_predicts_no_better_where_nothing_is_missing_and_better_where_something_is() -> None:
    place = InputLocation("spring", (Law(np.stack([PLANT.x**2, PLANT.x**4], axis=1)),), PLANT.x[:, None] ** 2)
    for bend, least, most in ((0.0, -0.2, 0.05), (0.3, 1.0, np.inf)):
        search = search_of(PLANT, draw(PLANT, {"a": 1.1, "c": bend}, NOISE, 12))
        base = find_map(search, (), {}, None)
        (found,) = localise(search, base, [place])
        assert least < found.held_out.mean - hold_out(search, base, ()).mean < most


def test_a_gap_is_attributed_to_the_place_that_can_make_it() -> None:
    search = search_of(PLANT, draw(PLANT, {"c": 0.3}, NOISE, 9))
    base = find_map(search, (), {}, None)
    x = PLANT.x
    spring = InputLocation("spring", (Law(np.stack([x**2, x**4], axis=1)),), np.stack([x**2, x**3], axis=1))
    sensor = InputLocation(
        "sensor", (Law(np.stack([np.sin(6 * x), np.sin(9 * x)], axis=1)),), np.stack([x**3], axis=1)
    )
    first, second = localise(search, base, [sensor, spring])
    assert (first.name, second.name) == ("spring", "sensor")
    assert first.share > 0.98
    assert first.free_input_share > 0.98
    assert second.share < 0.05
    np.testing.assert_allclose(first.held_out.rows, x + 0.3 * x**2, atol=0.02)
    assert first.evidence > base.evidence + 100.0 > second.evidence


def test_a_law_anywhere_is_as_probable_as_its_places_are_on_average() -> None:
    places = [
        Localisation(
            name, 0.0, 0.0, evidence, HeldOut(np.zeros(0), np.zeros(0)), np.zeros(0), np.zeros((0, 0))
        )
        for name, evidence in (("strut", -700.0), ("rail", -701.0), ("link", -900.0))
    ]
    assert anywhere(places) == pytest.approx(-700.0 + np.log((1.0 + np.exp(-1.0)) / 3.0))


def test_a_law_that_explains_nothing_is_less_probable_than_no_law() -> None:
    """By Occam's factor, which the widest prior over as many rows bounds."""
    search = search_of(PLANT, draw(PLANT, {"a": 1.1}, NOISE, 3))
    base = find_map(search, (), {}, None)
    place = InputLocation("spring", (Law(PLANT.x[:, None] ** 2),), PLANT.x[:, None] ** 2)
    (found,) = localise(search, base, [place])
    assert (
        base.evidence - np.log(max(DEFAULTS.law_widths) * PLANT.tests * PLANT.points)
        < found.evidence
        < base.evidence
    )


def test_a_place_that_may_follow_another_law_is_not_much_less_probable_for_it() -> None:
    """It costs the logarithm of its share, not what all functions of the other would as parts of one law."""
    search = search_of(PLANT, draw(PLANT, {"c": 0.3}, NOISE, 9))
    base, x = find_map(search, (), {}, None), PLANT.x
    law, other = Law(x[:, None] ** 2), Law(np.stack([np.sin(k * x) for k in range(4, 12)], axis=1), 3.0)
    alone, either = (
        localise(search, base, [InputLocation("spring", laws, law.columns)])[0]
        for laws in ((law,), (law, other))
    )
    assert either.evidence == pytest.approx(alone.evidence - np.log(4.0), abs=1e-3)
    np.testing.assert_allclose(either.held_out.rows, alone.held_out.rows, atol=1e-9)
