"""Both samplers on a model that their surrogate misjudges, against brute force."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from arviz_stats.base.array import array_stats

from savgs_ident.inference.diagnostics import mixing_of
from savgs_ident.inference.sample import SAMPLERS
from savgs_ident.inference.samplers.chains import Chains, new_checkpoint
from savgs_ident.inference.samplers.emcee import pcn_steps

from .toy import Toy
from .toy_reference import Reference, reference_of
from .toy_surrogate import Stand

STEPS = {"emcee": 500, "nuts": 500}
"""Steps of the 8 chains."""

SHARES = (0.025, 0.5, 0.975)

SURE = 4.0
"""Monte-Carlo standard errors within which two estimates agree."""

Estimate = tuple[float, float]
"""A number and its Monte-Carlo standard error."""


def _sampled(name: str, toy: Toy, stand: Stand, steps: int) -> Chains:
    sampler = SAMPLERS[name](toy, stand.surrogate, 3, new_checkpoint(None, ""))
    chains = next(sampler)
    while len(chains.points) < steps:
        chains = next(sampler)
    sampler.close()
    return chains


def _estimates(points: np.ndarray) -> dict[tuple[int, object], Estimate]:
    """Quantiles and standard deviations of every coordinate of (S, C, n + 2) draws."""
    found: dict[tuple[int, object], Estimate] = {}
    axes = {"chain_axis": 1, "draw_axis": 0}
    for place in range(points.shape[2]):
        # The discrepancy is the magnitude of its coordinate.
        draws = np.abs(points[:, :, place]) if place == points.shape[2] - 1 else points[:, :, place]
        for share in SHARES:
            error = float(array_stats.mcse(draws, method="quantile", prob=share, **axes))
            found[place, share] = float(np.quantile(draws, share)), error
        found[place, "sd"] = float(draws.std()), float(array_stats.mcse(draws, method="sd", **axes))
    return found


def _true(reference: Reference, key: tuple[int, object]) -> float:
    place, what = key
    return reference.sd(place) if what == "sd" else reference.quantile(place, float(str(what)))


@pytest.fixture(scope="module")
def chains(bent: Toy, rough: Stand) -> Mapping[str, Chains]:
    return {name: _sampled(name, bent, rough, steps) for name, steps in STEPS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLERS)
def test_draws_are_those_of_the_exact_posterior(
    name: str, chains: Mapping[str, Chains], reference: Reference
) -> None:
    assert reference.ess > 50_000.0
    assert min(mixing_of(chains[name].points[:, :, place]).ess_bulk for place in range(4)) > 700.0
    for key, (value, error) in _estimates(chains[name].points).items():
        assert abs(value - _true(reference, key)) < SURE * error, key


@pytest.mark.slow
def test_both_samplers_agree(chains: Mapping[str, Chains]) -> None:
    one, other = (_estimates(chains[name].points) for name in ("emcee", "nuts"))
    for key in one:
        assert abs(one[key][0] - other[key][0]) < SURE * np.hypot(one[key][1], other[key][1]), key


@pytest.mark.slow
def test_the_surrogate_alone_would_be_found_out(
    rough: Stand, reference: Reference, chains: Mapping[str, Chains]
) -> None:
    """Or the agreement above would say nothing."""
    end, _, _ = pcn_steps(rough.surrogate, 1, np.zeros((4000, 5)), rounds=2)
    off = [
        abs(value - _true(reference, key)) / np.hypot(error, chains_error)
        for (key, (value, error)), (_, chains_error) in zip(
            _estimates(rough.surrogate.points(end)[:, None]).items(),
            _estimates(chains["emcee"].points).values(),
            strict=True,
        )
    ]
    assert max(off) > 1.5 * SURE


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLERS)
def test_a_chain_says_where_it_was(name: str, chains: Mapping[str, Chains], bent: Toy, rough: Stand) -> None:
    reported = chains[name]
    points = reported.points.reshape(-1, 5)
    rows = bent.rows(points[:50, :-2])[0]
    densities = [rough.posterior.density(row, point) for row, point in zip(rows, points[:50], strict=True)]
    np.testing.assert_allclose(reported.log_density.ravel()[:50], densities, rtol=1e-10)
    moved = np.any(np.diff(reported.points, axis=0) != 0.0, axis=2)
    assert np.all(reported.accepted[1:] >= moved)
    # A trajectory may end where it began.
    assert np.mean(reported.accepted[1:] != moved) < 0.01
    assert 0.3 < reported.accepted.mean() < 1.0
    assert reported.unsolved == 0
    assert reported.evaluations >= reported.accepted.size


@pytest.mark.parametrize(
    ("name", "share"),
    [
        *(pytest.param(name, 0.5, id=f"half-{name}", marks=pytest.mark.slow) for name in SAMPLERS),
        pytest.param("nuts", 0.1, id="a tenth-nuts", marks=pytest.mark.slow),
        pytest.param("emcee", 0.1, id="a tenth-emcee"),
    ],
)
def test_no_point_without_a_solution_is_drawn(
    name: str, share: float, bent: Toy, rough: Stand, reference: Reference
) -> None:
    """Only this share of the posterior has a solution."""
    half = replace(bent, edge=reference.quantile(0, share))
    reported = _sampled(name, half, rough, 200 if share == 0.5 else 50)
    assert reported.points[:, :, 0].max() <= half.edge
    assert np.isfinite(reported.log_density).all()
    assert 0.5 * (1.0 - share) < reported.unsolved / reported.evaluations < 1.0
    if share == 0.5:
        true = reference_of(half, rough.point - np.eye(5)[0] * reference.sd(0))
        for key, (value, error) in _estimates(reported.points).items():
            assert abs(value - _true(true, key)) < SURE * error, key
