"""Shapes that are tried: what swings, stops, and second effects, on a plant that can be checked by hand."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.presentation import no_progress
from savgs_ident.diagnosis.findings import Findings, explains_all
from savgs_ident.diagnosis.score_test import peaks_by_try, scores_by_try
from savgs_ident.diagnosis.search import singles_among
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.find_map import densest, find_map, find_map_from_several
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.inference.prior import Linear, Logarithmic

from ..in_one_test import over
from .toy import TERMS, ToyPlant, best_of, draw, forward_selection

PLANT = ToyPlant()
NOISE = 0.02


@over("seed", range(5))
def test_what_has_many_maxima_is_fitted_from_all_that_is_tried_though_it_was_fitted_before(seed: int) -> None:
    """A ripple was found where it was looked for, at one of the small maxima beside the great one."""
    ripple = TERMS[1:2]
    search = search_of(PLANT, draw(PLANT, {"a": 1.0, "s": 0.3, "w": 12.5}, NOISE, seed))
    beside = find_map(search, ripple, {"s": 0.03, "w": 20.0}, None)
    assert beside.values["w"] > 15.0
    findings = Findings(find_map(search, (), {}, None), (), (beside,))
    more = singles_among(search, findings, ripple, ripple, no_progress)
    assert best_of(more).values["w"] == pytest.approx(12.5, rel=0.02)
    assert [mode.terms for mode in more.modes] == [("ripple",)]


@over("seed", range(5))
def test_of_many_starts_those_that_are_highest_after_some_steps_are_followed(seed: int) -> None:
    """At its typical size a ripple is nowhere good; each start alone ends at a maximum of its own."""
    ripple = TERMS[1:2]
    search = search_of(PLANT, draw(PLANT, {"a": 1.0, "s": 0.3, "w": 12.5}, NOISE, seed))
    starts = [{"s": 0.3, "w": w} for w in (4.0, 7.0, 11.5, 20.0, 26.0)]
    alone = [find_map(search, ripple, start, None) for start in starts]
    assert len({round(each.evidence) for each in alone}) > 2
    found = find_map_from_several(search, ripple, starts, None, 4, 2)
    assert found.values["w"] == pytest.approx(12.5, rel=0.02)
    assert found.evidence == pytest.approx(max(each.evidence for each in alone), abs=0.1)


class _Stopped(ToyPlant):
    """A ripple's shape is the gap of a stop, never closed beyond 1; to first order it does nothing."""

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        v = {"s": 0.0, "w": 0.4} | dict(values)
        return super().rows(dict(values) | {"s": 0.0}) + v["s"] ** 2 * np.maximum(self.x - v["w"], 0.0)


@over("seed", range(5))
def test_a_stop_is_found_though_one_that_is_never_closed_is_nearest_of_what_is_tried(seed: int) -> None:
    plant = _Stopped()
    stop = replace(
        TERMS[1],
        amplitudes=(Linear("s", "N", 0.0, 2.0, lower=0.0),),
        shapes=(Logarithmic("w", "1", 0.4, 0.25),),
        tries=(),
    )
    search = search_of(plant, draw(plant, {"a": 1.0, "s": 1.0, "w": 0.7}, NOISE, seed))
    base = find_map(search, (), {}, None)
    starts = [{"a": base.values["a"], "s": 1.0} | shapes for shapes in stop.tried]
    assert densest(search, (stop,), starts, None)["w"] == stop.tried[-1]["w"] == 1.0
    found = singles_among(search, Findings(base, (), ()), (stop,), (stop,), no_progress)
    assert best_of(found).values["w"] == pytest.approx(0.7, rel=0.03)


class _Beside(ToyPlant):
    """What ripples does so beside a bend alone."""

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        return super().rows(dict(values) | {"s": values.get("s", 0.0) * values.get("c", 0.0)})


@over("seed", (0, 1, 3))
def test_a_small_second_effect_is_scored_beside_the_first(seed: int) -> None:
    """In draws of the noise where the first one leaves no more than noise may."""
    plant = _Beside(tests=60)
    search = search_of(plant, draw(plant, {"a": 1.0, "c": 0.5, "s": 0.013, "w": 12.0}, NOISE, seed))
    base = find_map(search, (), {}, None)
    findings = forward_selection(search, base, TERMS)
    alone = next(mode for mode in findings.modes if mode.terms == ("bend",))
    assert explains_all(search, base, alone)
    (ripple,) = (score for score in findings.scores if score.term.name == "ripple")
    assert ripple.sigma < 1.0
    assert set(best_of(findings).terms) == {"bend", "ripple"}


FAR_OFF = replace(TERMS[1], tries=({"w": 9.6}, {"w": 15.6}, {"w": 20.2}))
"""The ripple where a wave of 12.5 shows more at one of its small maxima than at the foot of the great one."""


@over("seed", range(5))
def test_what_swings_beside_another_is_fitted_from_each_of_its_peaks(seed: int) -> None:
    plant, both = _Beside(tests=60), (TERMS[0], FAR_OFF)
    search = search_of(plant, draw(plant, {"a": 0.9, "c": 0.9, "s": 0.3, "w": 12.5}, NOISE, seed))
    peaks = peaks_by_try(search, find_map(search, TERMS[:1], {}, None), FAR_OFF)
    assert [each.start["w"] for each in peaks] == [20.2, 9.6]
    base = find_map(search, (), {}, None)
    one = forward_selection(search, base, both, constants=replace(DEFAULTS, resonance_peaks=1))
    assert best_of(one).values.get("w") != pytest.approx(12.5, rel=0.02)
    findings = forward_selection(search, base, both)
    assert set(best_of(findings).terms) == {"bend", "ripple"}
    assert best_of(findings).values["w"] == pytest.approx(12.5, rel=0.02)


@over("seed", range(5))
def test_the_first_peak_of_what_is_tried_is_where_it_scores_best(seed: int) -> None:
    values = {"a": 1.0, "s": 0.3, "w": np.random.default_rng(seed).uniform(4.0, 14.0)}
    search = search_of(PLANT, draw(PLANT, values, NOISE, seed))
    base = find_map(search, (), {}, None)
    ripple = replace(TERMS[1], tries=tuple({"w": float(w)} for w in np.arange(3.0, 16.0)))
    every = scores_by_try(search, base, ripple)
    peaks = peaks_by_try(search, base, ripple)
    assert len(every) == 13 > len(peaks)
    assert peaks[0].evidence == every[0].evidence
    assert peaks[0].start["w"] == pytest.approx(values["w"], abs=0.6)
