"""The search for the mode from two starts: from where calibration ended and from the parameters as given."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.status import Status
from savgs_ident.diagnosis.held_out import find_map_near
from savgs_ident.inference.find_map import find_map, find_map_from_both, find_map_from_several
from savgs_ident.inference.laplace_fit import Search, Start, search_of
from savgs_ident.inference.observations import Prediction
from savgs_ident.inference.prior import Coordinates, sheet_coordinate

from ..diagnosis.toy import TERMS, ToyPlant, draw

BEND = TERMS[0]
TRUTH = {"a": 0.0, "s": 0.5, "w": 6.0, "c": 0.3}
FAR = {"w": 17.0, "c": 0.0}


class WavyPlant(ToyPlant):
    """A wave of known size and unknown number: to other numbers no step leads higher."""

    @property
    def nuisances(self) -> Coordinates:
        return (sheet_coordinate(Parameter("w", 6.0, "1", tolerance=1.0)),)

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        return super().rows({"a": 0.0, "s": 0.5} | dict(values))


PLANT = WavyPlant()
GIVEN = Start({"w": 6.0}, None)


@pytest.mark.parametrize("seed", range(3))
def test_from_where_calibration_ended_far_off_it_is_the_parameters_as_given_that_lead_to_the_mode(
    seed: int,
) -> None:
    search = search_of(PLANT, draw(PLANT, TRUTH, 0.02, seed), GIVEN)
    astray = find_map(search, (BEND,), FAR, None)
    found = find_map_from_both(search, (BEND,), FAR, None)
    assert astray.values["w"] > 12.0
    assert found.status.ok
    assert found.values["w"] == pytest.approx(6.0, abs=0.1)
    assert found.values["c"] == pytest.approx(0.3, abs=0.02)
    assert found.evidence > astray.evidence + 100.0


def test_where_nothing_was_given_it_is_the_search_from_one_start() -> None:
    search = search_of(PLANT, draw(PLANT, TRUTH, 0.02, 1))
    one, both = (each(search, (BEND,), {"w": 5.0}, None) for each in (find_map, find_map_from_both))
    assert both.evidence == one.evidence
    np.testing.assert_array_equal(both.x, one.x)


def test_the_better_start_is_kept_where_the_given_one_is_the_worse() -> None:
    far = Start({"w": 17.0}, None)
    search = search_of(PLANT, draw(PLANT, TRUTH, 0.02, 2), far)
    found = find_map_from_both(search, (BEND,), {"w": 5.0}, None)
    assert found.values["w"] == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_only_a_search_that_cannot_come_near_another_hypothesis_is_given_up(seed: int) -> None:
    search = search_of(PLANT, draw(PLANT, TRUTH, 0.02, seed))
    astray = find_map(search, (BEND,), FAR, None)
    best = find_map(search, (BEND,), {"w": 5.0}, None)
    least = best.evidence - 10.0
    given_up = find_map_from_both(search, (BEND,), FAR, None, least=least)
    assert given_up.status is Status.HOPELESS
    assert given_up.solved
    assert given_up.evidence <= astray.evidence < least
    kept = find_map_from_both(search, (BEND,), {"w": 5.0}, None, least=least)
    assert kept.status is best.status
    np.testing.assert_array_equal(kept.x, best.x)


class NotingPlant(WavyPlant):
    """Notes at which numbers of waves it was predicted, and where its slopes were found."""

    def __init__(self) -> None:
        self.predicted: list[float] = []
        self.sloped: list[float] = []

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        found = super().predict(terms, values, names, warm_start)
        self.predicted.append(values["w"])

        def slopes() -> NDArray[np.float64]:
            self.sloped.append(values["w"])
            return found.slopes

        return replace(found, find_slopes=slopes)


def test_slopes_are_found_once_where_a_search_goes_on_from_and_nowhere_else() -> None:
    plant = NotingPlant()
    search = search_of(plant, draw(PLANT, TRUTH, 0.02, 1))
    starts = [{"w": 5.0}, {"w": 9.0}, {"w": 17.0}]
    found = find_map_from_several(search, (BEND,), starts, None, 1, 1)
    assert found.status.ok
    assert len(plant.sloped) == len(set(plant.sloped)) < len(set(plant.predicted))
    assert {5.0, 9.0, 17.0, found.values["w"]} <= set(plant.sloped)


class CountingPlant(WavyPlant):
    """Counts how often its slopes are asked for."""

    def __init__(self) -> None:
        self.asked = 0

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        self.asked += bool(names)
        return super().predict(terms, values, names, warm_start)


def test_near_a_fit_its_slopes_lead_to_the_mode_of_some_tests_to_a_tenth_of_its_standard_deviations() -> None:
    plant, moved = CountingPlant(), 0.0
    data = draw(plant, TRUTH, 0.02, 5)
    whole = find_map(search_of(plant, data), (BEND,), {"w": 6.0}, None)
    for fold in range(3):
        part, asked = Search(plant, data, data.test % 3 != fold), plant.asked
        near = find_map_near(part, (BEND,), whole)
        assert plant.asked == asked
        assert near.status.ok
        anew = find_map(part, (BEND,), whole.values, None)
        sd = np.sqrt(np.diag(anew.covariance()))
        moved = max(moved, float(np.max(np.abs(anew.x - whole.x) / sd)))
        np.testing.assert_allclose(near.x / sd, anew.x / sd, atol=0.1)
        assert near.evidence == pytest.approx(anew.evidence, abs=0.1)
    assert moved > 0.5
