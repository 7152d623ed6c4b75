"""Figures of a posterior draw what the draws say: regions hold their share, bands their points, maps odd chains."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.report.bode import predictive_band, predictive_figure
from savgs_ident.report.html import embed
from savgs_ident.report.posterior.figures import (
    MOST_TRACES,
    axis_limits,
    corner_figure,
    joint_density,
    profile_figure,
    rank_surplus,
    region_levels,
    smooth_density,
    trace_figure,
)
from savgs_ident.report.text import MINUS

from .posterior_synthetic import (
    AUTOCORRELATION,
    nominal_response,
    renamed,
    synthetic_posterior,
    unconverged,
    wander,
)


@pytest.fixture(scope="module")
def posterior(nominal_campaign: Path) -> HarmonicPosterior:
    return synthetic_posterior(nominal_response(nominal_campaign))


def test_a_smooth_density_has_area_one_and_is_that_of_the_draws() -> None:
    draws = 3.0 + 0.5 * np.random.default_rng(1).standard_normal(200_000)
    points, density = smooth_density(draws, axis_limits(draws), 200_000.0)
    assert np.sum(density) * (points[1] - points[0]) == pytest.approx(1.0)
    assert_allclose(density, norm.pdf(points, 3.0, 0.5), atol=0.02)


def test_fewer_effective_draws_promise_less_detail() -> None:
    draws = np.random.default_rng(2).standard_normal(4000)
    for worth in (4000.0, 20.0):
        points, density = smooth_density(draws, (-6.0, 6.0), worth)
        weights = density / density.sum()
        spread = np.sum(weights * points**2) - np.sum(weights * points) ** 2
        # A kernel adds its own variance to that of the draws.
        width = 1.06 * draws.std() * worth**-0.2
        assert spread == pytest.approx(draws.var() + width**2, rel=0.01)


def test_regions_of_a_pair_hold_their_share_of_new_draws() -> None:
    rng = np.random.default_rng(3)
    factor = np.linalg.cholesky([[1.0, 0.8], [0.8, 1.0]])
    seen, new = (factor @ rng.standard_normal((2, 40_000)) for _ in range(2))
    limits = (axis_limits(seen[0]), axis_limits(seen[1]))
    x, y, shares = joint_density(seen[0], seen[1], limits, 40_000.0)
    outer, inner = region_levels(shares, (0.95, 0.5))
    column = np.clip(np.searchsorted(x, new[0]), 0, x.size - 1)
    row = np.clip(np.searchsorted(y, new[1]), 0, y.size - 1)
    assert np.mean(shares[row, column] > outer) == pytest.approx(0.95, abs=0.01)
    assert np.mean(shares[row, column] > inner) == pytest.approx(0.50, abs=0.03)


def test_independent_chains_scatter_by_one_standard_deviation_and_correlated_ones_by_less() -> None:
    rng = np.random.default_rng(4)
    independent = rank_surplus(rng.standard_normal((40, 4000)), 1.0)
    assert independent.shape == (40, 10)
    assert np.std(independent) == pytest.approx(1.0, abs=0.1)
    correlated = rank_surplus(wander(rng, 40, 4000), AUTOCORRELATION)
    assert np.max(np.abs(correlated)) < np.max(np.abs(independent)) < 4.5


def test_a_chain_that_strays_is_seen_even_if_the_draws_are_worth_next_to_nothing() -> None:
    draws = wander(np.random.default_rng(5), 8, 4000)
    draws[2] += 3.0
    surplus = rank_surplus(draws, 4000.0)
    assert surplus[2, -1] > 5.0
    assert np.argmax(np.abs(surplus).max(axis=1)) == 2


def test_outer_axes_of_the_corner_plot_have_names_and_units(posterior: HarmonicPosterior) -> None:
    figure = corner_figure(posterior)
    assert len(figure.axes) == 10
    below = [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()]
    beside = [axes.get_ylabel() for axes in figure.axes if axes.get_ylabel()]
    assert below == ["mu_r [\u2013]", "mu_t [\u2013]", "ydot_Hth [m/s]", "c_sd [N s/m]"]
    assert beside == below[1:]
    correlations = [text.get_text() for axes in figure.axes for text in axes.texts]
    names = ("mu_r", "mu_t", "ydot_Hth", "c_sd")
    found = posterior.correlation(names)[np.tril_indices(4, -1)]
    assert [float(text.replace(MINUS, "-")) for text in correlations] == pytest.approx(
        found.tolist(), abs=0.0051
    )


def test_a_trace_shows_some_chains_and_the_map_shows_all(nominal_campaign: Path) -> None:
    many = synthetic_posterior(nominal_response(nominal_campaign), chains=40, length=60)
    trace, ranks = trace_figure(many, many.marginals[0]).axes
    drawn = [line for line in trace.get_lines() if len(np.asarray(line.get_xdata())) == 60]
    assert len(drawn) == MOST_TRACES
    assert ranks.images[0].get_array().shape == (40, 10)
    assert trace.get_ylabel() == "mu_r [\u2013]"


def test_profile_marginal_and_parabola_of_a_normal_posterior_coincide(posterior: HarmonicPosterior) -> None:
    each = posterior.by_name["c_sd"]
    assert each.profile is not None
    axes = profile_figure(posterior, each, each.profile).axes[0]
    lines = {line.get_label(): line for line in axes.get_lines()}
    x = np.asarray(lines["marginal"].get_xdata())
    near = np.abs(x - each.median) < 1.5 * each.sd
    marginal, parabola = (np.asarray(lines[name].get_ydata())[near] for name in ("marginal", "Laplace"))
    assert_allclose(marginal, parabola, atol=0.35)
    assert_allclose(lines["profile"].get_ydata(), each.profile.rise)
    assert axes.get_xlabel() == "c_sd [N s/m]"


def test_misses_are_in_half_widths_of_a_band_that_holds_95_percent(posterior: HarmonicPosterior) -> None:
    band = predictive_band(posterior, 0)
    repeated = posterior.predictive.replicated[:, :, 0, 1]
    road = posterior.measured.harmonics[:, posterior.measured.channel("road_height"), 1]
    sizes = np.abs(repeated / road)
    held = np.mean((sizes >= band.magnitude[0]) & (sizes <= band.magnitude[1]), axis=0)
    assert_allclose(held, 0.95, atol=0.01)
    magnitude, phase = band.misses
    measured = np.abs(band.measured)
    within = (measured >= band.magnitude[0]) & (measured <= band.magnitude[1])
    assert np.array_equal(np.abs(magnitude) <= 1.0, within)
    assert np.mean(np.abs(phase) <= 1.0) > 0.8


def test_the_bode_figure_draws_every_compared_dwell_inside_its_panels(posterior: HarmonicPosterior) -> None:
    figure = predictive_figure(posterior, 1)
    assert [axes.get_ylabel().split("[")[1] for axes in figure.axes] == [
        "m per m of road]",
        "deg]",
        "band half-widths]",
    ]
    points = sum(
        len(np.asarray(line.get_xdata())) for line in figure.axes[0].get_lines() if line.get_marker() == "o"
    )
    assert points == 28
    low, high = figure.axes[2].get_ylim()
    offsets = np.concatenate([np.asarray(marks.get_offsets()) for marks in figure.axes[2].collections[1:]])
    assert low < offsets[:, 1].min() < offsets[:, 1].max() < high


def test_dwells_that_were_not_compared_are_left_out(posterior: HarmonicPosterior) -> None:
    used = posterior.predictive.used.copy()
    used[3:] = False
    band = predictive_band(replace(posterior, predictive=replace(posterior.predictive, used=used)), 0)
    assert np.array_equal(np.isfinite(band.measured), np.arange(28) < 3)
    assert np.array_equal(np.isfinite(band.misses[0]), np.arange(28) < 3)


def test_chains_that_never_moved_are_still_drawn(posterior: HarmonicPosterior) -> None:
    first = posterior.marginals[0]
    stuck = replace(
        first, sd=0.0, q025=0.03, q975=0.03, laplace_sd=0.0, ess_bulk=float("nan"), autocorrelation=np.inf
    )
    draws = dict(posterior.draws) | {first.name: np.full_like(posterior.draws[first.name], 0.03)}
    still = replace(posterior, draws=draws, marginals=(stuck, *posterior.marginals[1:]))
    for figure in (
        corner_figure(still),
        trace_figure(still, stuck),
        profile_figure(still, stuck, first.profile),
    ):
        assert embed(figure, "stuck").source.startswith("data:image/svg+xml;base64,")


def test_names_in_figures_are_neither_formulas_nor_missing_glyphs(posterior: HarmonicPosterior) -> None:
    named = renamed(unconverged(posterior, "why"), "$\\frac{1}{0}$\x1b漢\ud800", "", "<b>$")
    first = named.marginals[0]
    for figure in (
        corner_figure(named),
        trace_figure(named, first),
        profile_figure(named, first, first.profile),
    ):
        assert embed(figure, "hostile").width > 300
    assert "$\\frac{1}{0}$\\x1b" in trace_figure(named, first).axes[0].get_ylabel()
