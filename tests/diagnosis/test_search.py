"""The search for what is missing, on a plant that can be checked by hand."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad

from savgs_ident.core.status import Status
from savgs_ident.diagnosis.findings import Findings, excess, explains_all, left_over, to_be_gained
from savgs_ident.diagnosis.result import Hypothesis
from savgs_ident.diagnosis.score_test import best_pairs, cosine, score_terms
from savgs_ident.diagnosis.search import pairs_with, single_effects, singles_among
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import Search, search_of
from savgs_ident.inference.likelihood import noise_scales
from savgs_ident.inference.observations import Prediction, Term
from savgs_ident.inference.prior import Linear

from ..in_one_test import over
from .toy import TERMS, ToyPlant, best_of, draw, forward_selection

PLANT = ToyPlant()
NOISE = 0.02


def _silent(line: str) -> None:
    del line


def _found(values: dict[str, float], seed: int) -> tuple[Search, Findings]:
    search = search_of(PLANT, draw(PLANT, values, NOISE, seed))
    base = find_map(search, (), {}, None)
    return search, forward_selection(search, base, TERMS)


def _names(findings: Findings) -> tuple[str, ...]:
    best = best_of(findings)
    return best.terms if best.evidence > findings.base.evidence + 5.0 else ()


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ({"a": 1.1}, ()),
        ({"a": 0.8, "c": 0.3}, ("bend",)),
        ({"a": 1.1, "s": 0.1, "w": 7.0}, ("ripple",)),
        ({"a": 1.0, "t": -0.8}, ("twist",)),
    ],
)
@over("seed", range(10))
def test_what_is_missing_is_named(values: dict[str, float], names: tuple[str, ...], seed: int) -> None:
    _, findings = _found(values, seed)
    assert _names(findings) == names


@over("seed", range(5))
def test_two_that_are_missing_are_both_named(seed: int) -> None:
    search, findings = _found({"a": 0.9, "c": 0.3, "s": 0.15, "w": 8.0}, seed)
    assert set(_names(findings)) == {"bend", "ripple"}
    assert left_over(search, findings.base, best_of(findings)) < 0.02
    assert excess(search, best_of(findings)) < 0.5


@over("seed", range(5))
def test_a_small_one_beside_a_large_one_is_named_too(seed: int) -> None:
    """Though the large one alone explains all but a thousandth of the excess."""
    search, findings = _found({"a": 0.9, "c": 1.5, "s": 0.03, "w": 6.5}, seed)
    large = next(mode for mode in findings.modes if mode.terms == ("bend",))
    assert left_over(search, findings.base, large) < 0.002
    assert set(_names(findings)) == {"bend", "ripple"}


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    inside = []
    for seed in range(60):
        search = search_of(PLANT, draw(PLANT, {"a": 1.1, "c": 0.2}, NOISE, seed))
        mode = find_map(search, TERMS[:1], {}, None)
        sd = np.sqrt(np.diag(mode.covariance()))
        truth = np.array([each.at({"a": 1.1, "c": 0.2}[each.name]) for each in mode.coordinates])
        inside.append(np.abs(mode.x - truth) < 1.96 * sd)
    share = np.mean(inside)
    assert 0.88 < share <= 1.0


def test_evidence_is_the_integral_over_the_prior() -> None:
    """Against quadrature, noise scale and discrepancy held where the mode has them."""
    search = search_of(PLANT, draw(PLANT, {"a": 1.1}, NOISE, 3))
    mode = find_map(search, (), {}, None)
    spread = mode.noise_scales.spread
    height = mode.noise_scales.value - 0.5 * float(mode.x @ mode.x)

    def relative(x: float) -> float:
        residual = search.data.measured - PLANT.rows({"a": 1.0 + 0.2 * x})
        here = mode.noise_scales.value - 0.5 * np.sum(residual**2 / spread)
        there = -0.5 * np.sum(search.residual(mode.prediction) ** 2 / spread)
        return float(np.exp(here - there - 0.5 * x**2 - height))

    middle, width = float(mode.x[0]), float(np.sqrt(mode.covariance()[0, 0]))
    area, _ = quad(relative, middle - 8.0 * width, middle + 8.0 * width, epsabs=1e-12)
    assert mode.evidence == pytest.approx(height + np.log(area / np.sqrt(2.0 * np.pi)), abs=1e-3)


def test_the_score_is_the_drop_of_chi2_that_a_fit_brings() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.1, "c": 0.01}, NOISE, 5))
    base = find_map(search, (), {}, None)
    bend = next(score for score in score_terms(search, base, list(TERMS)) if score.term.name == "bend")
    weight = 1.0 / np.sqrt(base.noise_scales.spread)
    slope, bent = 0.2 * PLANT.x * weight, 0.4 * PLANT.x**2 * weight
    residual = search.residual(base.prediction) * weight
    both = np.stack([slope, bent], axis=1)
    prior = np.diag([1.0, 0.0])
    step = np.linalg.solve(both.T @ both + prior, both.T @ residual - prior @ np.array([base.x[0], 0.0]))

    def chi2(step: np.ndarray) -> float:
        return float(np.sum((residual - both @ step) ** 2) + (base.x[0] + step[0]) ** 2)

    assert bend.sigma == pytest.approx(np.sqrt(chi2(np.zeros(2)) - chi2(step)), rel=1e-3)


def test_the_sizes_that_a_score_leaves_are_those_of_a_fit() -> None:
    """What an effect in proportion to its size does, so that to first order is exact."""
    search = search_of(PLANT, draw(PLANT, {"a": 1.1, "c": 0.02}, NOISE, 5))
    base = find_map(search, (), {}, None)
    bend = next(score for score in score_terms(search, base, list(TERMS)) if score.term.name == "bend")
    fit = find_map(search, (bend.term,), base.values, None)
    place = [each.name for each in fit.coordinates].index("c")
    assert bend.amplitudes is not None
    draws = bend.amplitudes.draws(4000)
    size = (draws.T @ PLANT.x**2) / np.sum(PLANT.x**4)
    sd = 0.4 * np.sqrt(fit.covariance()[place, place])
    assert size.mean() == pytest.approx(fit.values["c"], abs=0.1 * sd)
    assert size.std() == pytest.approx(sd, rel=0.05)
    # Nothing but the size is drawn.
    np.testing.assert_allclose(draws, np.outer(PLANT.x**2, size), atol=1e-6)


def test_a_size_stays_within_its_bounds() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.1}, NOISE, 5))
    base = find_map(search, (), {}, None)
    scores = {score.term.name: score for score in score_terms(search, base, list(TERMS))}
    ripple = scores["ripple"].amplitudes
    assert ripple is not None
    along = ripple.columns[:, 0] @ ripple.draws(400)
    assert along.min() == 0.0
    assert along.max() > 0.0


def test_what_a_tolerance_explains_is_no_effect() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.35}, NOISE, 6))
    base = find_map(search, (), {}, None)
    assert base.values["a"] == pytest.approx(1.35, abs=0.01)
    assert max(score.sigma for score in score_terms(search, base, list(TERMS))) < 4.0


def test_two_effects_that_do_the_same_look_alike() -> None:
    search = search_of(PLANT, draw(PLANT, {"t": 0.2}, NOISE, 7))
    base = find_map(search, (), {}, None)
    scores = {score.term.name: score for score in score_terms(search, base, list(TERMS))}
    bend, ripple, twist = (scores[name] for name in ("bend", "ripple", "twist"))
    assert cosine(twist, twist) == pytest.approx(1.0)
    assert abs(cosine(bend, twist)) < 1e-6
    assert abs(cosine(ripple, twist)) > 0.5


def test_excess_is_what_the_noise_does_not_explain() -> None:
    data = draw(PLANT, {"a": 1.0}, NOISE, 10, miss=0.05)
    search = search_of(PLANT, data)
    base = find_map(search, (), {}, None)
    assert excess(search, base) == pytest.approx((0.05 / NOISE) ** 2, rel=0.3)
    assert noise_scales(data, search.residual(base.prediction)).discrepancy == pytest.approx(0.05, rel=0.25)


def test_what_a_fit_leaves_to_be_gained_is_what_the_right_one_gains() -> None:
    search, findings = _found({"c": 0.3}, 5)
    right = next(each for each in findings.modes if each.terms == ("bend",))
    # By chance the density of the truth is that of half as many squares as there are rows.
    chance = 3.0 * np.sqrt(0.5 * search.data.measured.size)
    assert to_be_gained(search, right) < chance
    gained = right.noise_scales.value - findings.base.noise_scales.value
    assert gained > 10.0 * chance
    assert to_be_gained(search, findings.base) == pytest.approx(gained, abs=chance)


@pytest.mark.parametrize(("off", "all_of_it"), [(0.2, True), (0.6, False)])
def test_what_resembles_the_right_one_leaves_little_of_the_misfit_and_does_not_explain_all(
    off: float, all_of_it: bool
) -> None:
    """Six tenths of the noise, added in squares, are less than is known of the noise, but not in 120 rows."""
    search, findings = _found({"c": 1.5}, 5)
    right = next(each for each in findings.modes if each.terms == ("bend",))
    size = NOISE * np.sign(search.residual(right.prediction))
    rows = search.data.measured - size * np.sqrt(1.0 + off**2)
    like = replace(right, prediction=replace(right.prediction, rows=rows))
    like = replace(like, noise_scales=noise_scales(search.rows, search.missed(like.prediction)))
    assert left_over(search, findings.base, like) < DEFAULTS.explained_share
    assert explains_all(search, findings.base, like) == all_of_it


def test_what_leaves_more_than_a_baseline_that_left_nothing_explains_nothing() -> None:
    search = search_of(PLANT, draw(PLANT, {"a": 1.1}, NOISE, 2))
    base = find_map(search, (), {}, None)
    off = replace(base, prediction=replace(base.prediction, rows=base.prediction.rows + 3.0 * NOISE))
    perfect = replace(base, prediction=replace(base.prediction, rows=search.data.measured))
    assert left_over(search, perfect, base) == 0.0
    assert left_over(search, perfect, off) == np.inf


class _Breaking(ToyPlant):
    """What twists breaks the model; what ripples has a column that is no number."""

    def predict(
        self, terms: tuple[str, ...], values: Mapping[str, float], names: Sequence[str], warm_start: Any
    ) -> Prediction:
        found = super().predict(terms, values, names, warm_start)
        return replace(found, status=Status.STALLED) if "twist" in terms else found

    def sensitivities(
        self, terms: tuple[str, ...], values: Mapping[str, float], warm_start: Any, candidates: Sequence[Term]
    ) -> list[np.ndarray]:
        found = super().sensitivities(terms, values, warm_start, candidates)
        return [
            np.full_like(each, np.nan) if term.name == "ripple" else each
            for each, term in zip(found, candidates, strict=True)
        ]


def test_a_fit_without_motion_is_lost_and_a_column_that_is_no_number_not_scored() -> None:
    plant = _Breaking()
    search = search_of(plant, draw(plant, {"a": 1.0, "t": -0.8}, NOISE, 1))
    findings = forward_selection(search, find_map(search, (), {}, None), TERMS)
    assert (Hypothesis(("twist",)), Status.STALLED) in findings.lost
    assert all("twist" not in mode.terms and np.isfinite(mode.evidence) for mode in findings.modes)
    ripple = next(each for each in findings.scores if each.term.name == "ripple")
    assert (ripple.sigma, ripple.evidence, ripple.smallest) == (0.0, -np.inf, np.inf)
    assert ripple.status is Status.NOT_FINITE


class _Squared(ToyPlant):
    """What ripples and what bends grow with the square of their size: to first order they do nothing."""

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        return super().rows(dict(values) | {name: values.get(name, 0.0) ** 2 for name in "sc"})


@over("seed", range(5))
def test_what_shows_nothing_to_first_order_is_found_from_its_typical_size(seed: int) -> None:
    plant = _Squared()
    search = search_of(plant, draw(plant, {"a": 1.0, "s": 0.4, "w": 11.0}, NOISE, seed))
    findings = forward_selection(search, find_map(search, (), {}, None), TERMS)
    ripple = next(each for each in findings.scores if each.term.name == "ripple")
    assert ripple.sigma < 1.0
    assert best_of(findings).terms == ("ripple",)
    assert best_of(findings).values["w"] == pytest.approx(11.0, rel=0.05)


@over("seed", range(5))
def test_a_wanted_one_that_shows_nothing_to_first_order_is_found_from_its_typical_size(seed: int) -> None:
    plant = _Squared()
    search = search_of(plant, draw(plant, {"a": 1.0, "c": 0.6}, NOISE, seed))
    findings = forward_selection(search, find_map(search, (), {}, None), TERMS)
    assert "bend" not in best_of(findings).terms
    more = singles_among(search, findings, TERMS[:1], TERMS, _silent)
    assert best_of(more).terms == ("bend",)
    assert abs(best_of(more).values["c"]) == pytest.approx(0.6, rel=0.05)


class _Shapes(ToyPlant):
    """A line and six shapes.

    Two that are missing, two that look like both together, one like the line, one nearly like the first.
    """

    def rows(self, values: Mapping[str, float]) -> NDArray[np.float64]:
        x, v = self.x, dict.fromkeys("bdefgh", 0.0) | {"a": 1.0} | dict(values)
        round_, wavy = x**2, np.sin(6.0 * x)
        both = round_ + 0.3 * wavy
        line = (v["a"] + v["g"]) * x
        shapes = v["b"] * round_ + v["d"] * wavy + v["h"] * (round_ + 0.1 * wavy + 0.03 * np.cos(5.0 * x))
        return (
            line + shapes + v["e"] * (both + 0.3 * np.sin(13.0 * x)) + v["f"] * (both + 0.3 * np.cos(9.0 * x))
        )


SHAPES = tuple(
    Term(name, "spring", (Linear(symbol, "N", 0.0, 0.4),))
    for name, symbol in (("round", "b"), ("wavy", "d"), ("stand-in", "e"), ("other", "f"), ("line", "g"))
)


@over("seed", range(5))
def test_a_stand_in_for_two_does_not_keep_its_place_beside_one_of_them(seed: int) -> None:
    """Alone it is nearest, so that the two are never tried together but by exchanging it."""
    plant = _Shapes()
    search = search_of(plant, draw(plant, {"a": 1.0, "b": 0.3, "d": 0.15}, NOISE, seed))
    findings = forward_selection(search, find_map(search, (), {}, None), SHAPES)
    assert {score.term.name for score in findings.scores[:2]} == {"stand-in", "other"}
    assert set(best_of(findings).terms) == {"round", "wavy"}


@over("seed", range(5))
def test_two_of_which_neither_is_beside_the_nearest_are_found_together(seed: int) -> None:
    """With so few fits that exchanging one of two never meets them; to first order they promise most."""
    plant = _Shapes()
    search = search_of(plant, draw(plant, {"a": 1.0, "b": 0.3, "d": 0.15}, NOISE, seed))
    base = find_map(search, (), {}, None)
    findings = forward_selection(
        search, base, SHAPES, constants=replace(DEFAULTS, pairs_per_parent=1, parents=1)
    )
    assert set(best_of(findings).terms) == {"round", "wavy"}
    first, *_, last = best_pairs(search, base, findings.scores, 10)
    assert {term.name for term in first.terms} == {"round", "wavy"}
    for pair in (first, last):
        fit = find_map(search, pair.terms, pair.start, None)
        assert pair.evidence == pytest.approx(fit.evidence, abs=0.05)
        assert [pair.start[name] for name in "bd" if name in fit.values] == pytest.approx(
            [fit.values[name] for name in "bd" if name in fit.values], abs=1e-3
        )


@over("seed", range(5))
def test_what_conflicts_with_a_tolerance_is_tried_with_an_effect_that_relieves_it(seed: int) -> None:
    plant = _Shapes()
    search = search_of(plant, draw(plant, {"a": 1.8, "b": 0.3}, NOISE, seed))
    findings = forward_selection(search, find_map(search, (), {}, None), (SHAPES[0], SHAPES[4]))
    assert set(best_of(findings).terms) == {"round", "line"}


@over("seed", range(5))
def test_a_lookalike_of_one_of_two_is_not_named_in_its_place(seed: int) -> None:
    """It is nearest as long as the other is not there, and beside it leaves no more than half the noise."""
    plant = _Shapes()
    search = search_of(plant, draw(plant, {"a": 1.0, "b": 0.5, "d": 0.15}, NOISE, seed))
    lookalike = Term("lookalike", "spring", (Linear("h", "N", 0.0, 0.4),))
    findings = forward_selection(
        search,
        find_map(search, (), {}, None),
        (SHAPES[0], SHAPES[1], lookalike),
        constants=replace(DEFAULTS, parents=1),
    )
    assert findings.scores[0].term.name == "lookalike"
    assert set(best_of(findings).terms) == {"round", "wavy"}


def test_an_effect_at_the_location_of_what_is_left_is_found_beside_the_right_member() -> None:
    plant = _Shapes()
    search = search_of(plant, draw(plant, {"a": 1.0, "b": 0.3, "d": 0.15}, NOISE, 1))
    base = find_map(search, (), {}, None)
    by_name = {term.name: term for term in SHAPES}
    alone = find_map(search, (by_name["round"],), {}, None)
    wrong = find_map(search, (by_name["round"], by_name["other"]), {}, None)
    assert left_over(search, base, wrong) > 0.0
    found = pairs_with(search, Findings(base, (), (wrong, alone)), wrong, [by_name["wavy"]], SHAPES, _silent)
    assert best_of(found).terms == ("round", "wavy")
    assert left_over(search, base, best_of(found)) < 0.01
    assert {mode.terms for mode in found.modes} >= {wrong.terms, alone.terms}


@pytest.mark.parametrize(
    ("values", "times"), [({"a": 1.1}, 0), ({"a": 0.8, "c": 0.3}, 0), ({"a": 1.0, "c": 0.3, "t": -0.8}, 1)]
)
@over("seed", range(3))
def test_what_a_learned_law_needs_is_prepared_only_where_no_single_effect_explains_all(
    values: dict[str, float], times: int, seed: int
) -> None:
    search = search_of(PLANT, draw(PLANT, values, NOISE, seed))
    base, prepared = find_map(search, (), {}, None), list[str]()
    single_effects(search, base, TERMS, _silent, meanwhile=lambda: prepared.append("law"))
    assert len(prepared) == times
