"""Convergence figures on draws whose worth is known, and the reasons that follow from them."""

import numpy as np
import pytest
from scipy.signal import lfilter

from savgs_ident.inference.diagnostics import LEAST_DRAWS, Mixing, assess_convergence, least_ess, mixing_of
from savgs_ident.inference.result import Convergence
from savgs_ident.inference.samplers.chains import Chains

STEPS, CHAINS = 5000, 4


def _autoregressive(keep: float, steps: int = STEPS, seed: int = 1) -> np.ndarray:
    """Unit normal draws (steps, CHAINS) of which each holds ``keep`` of the one before."""
    shocks = np.random.default_rng(seed).standard_normal((steps, CHAINS))
    shocks[1:] *= np.sqrt(1.0 - keep**2)
    return np.asarray(lfilter([1.0], [1.0, -keep], shocks, axis=0))


def _chains(draws: np.ndarray, **changes: object) -> Chains:
    shape = draws.shape
    reported = Chains(draws[:, :, None], np.zeros(shape), np.ones(shape, bool), np.zeros(0), 0, draws.size, 0)
    return reported._replace(**changes)


def _assessed(draws: np.ndarray, target: float = 1000.0, **changes: object) -> Convergence:
    return assess_convergence(_chains(draws, **changes), [mixing_of(draws)], [], target, ())


def test_independent_draws_are_worth_their_number() -> None:
    mixing = mixing_of(_autoregressive(0.0))
    assert mixing.ess_bulk == pytest.approx(STEPS * CHAINS, rel=0.05)
    assert mixing.ess_tail == pytest.approx(STEPS * CHAINS, rel=0.08)
    assert mixing.r_hat == pytest.approx(1.0, abs=1e-3)
    assert mixing.autocorrelation == pytest.approx(1.0, abs=0.1)


def test_draws_that_swing_are_worth_more_than_their_number() -> None:
    mixing = mixing_of(_autoregressive(-0.3))
    assert mixing.ess_bulk == pytest.approx(STEPS * CHAINS * 1.3 / 0.7, rel=0.1)


@pytest.mark.parametrize("keep", [0.5, 0.8])
def test_autoregressive_draws_are_worth_what_theory_says(keep: float) -> None:
    time, steps = (1.0 + keep) / (1.0 - keep), 4 * STEPS
    mixing = mixing_of(_autoregressive(keep, steps))
    # Sokal's error of a time that is summed over a window of five of them: a twentieth for the longest here.
    error = np.sqrt(2.0 * (2.0 * 5.0 * time + 1.0) / (steps * CHAINS))
    assert mixing.autocorrelation == pytest.approx(time, rel=3.0 * error)
    assert mixing.ess_bulk == pytest.approx(steps * CHAINS / time, rel=3.0 * error)


def test_good_chains_may_be_used() -> None:
    draws = _autoregressive(0.3)
    found = _assessed(draws, unsolved=3, evaluations=31_000)
    assert found.converged
    assert found.reasons == ()
    assert found.ess_min == least_ess([mixing_of(draws)]) >= 1000.0
    assert (found.acceptance, found.unsolved, found.evaluations) == (1.0, 3, 31_000)
    assert np.isnan(found.pareto_k)
    assert np.isnan(found.heaviest_weight)


def test_chains_that_stay_apart_are_found_out() -> None:
    draws = _autoregressive(0.0)
    draws[:, 0] += 3.0
    found = _assessed(draws)
    assert not found.converged
    assert any("R-hat" in reason for reason in found.reasons)
    assert found.r_hat_max > 1.3


def test_a_tolerated_parameter_that_disagrees_is_a_reason() -> None:
    good, bad = _autoregressive(0.0), _autoregressive(0.0, seed=2)
    bad[:, 0] += 3.0
    found = assess_convergence(
        _chains(good), [mixing_of(good)], [mixing_of(good), mixing_of(bad)], 1000.0, ()
    )
    assert ["tolerated" in reason for reason in found.reasons] == [True]
    assert found.r_hat_max == pytest.approx(mixing_of(bad).r_hat)


def test_too_few_draws_are_a_reason() -> None:
    found = _assessed(_autoregressive(0.0, steps=100))
    assert ["effective sample size" in reason for reason in found.reasons] == [True]
    assert found.ess_min < 1000.0


def test_hardly_any_draws_say_nothing() -> None:
    draws = _autoregressive(0.0, steps=LEAST_DRAWS - 1)
    few = mixing_of(draws)
    assert np.isnan(few).all()
    found = assess_convergence(_chains(draws), [few], [few], 1000.0, ())
    assert not found.converged
    assert found.ess_min == 0.0


@pytest.mark.parametrize("place", [0, 1])
def test_one_parameter_that_does_not_move_is_enough(place: int) -> None:
    """Whichever comes first."""
    good = _autoregressive(0.0)
    mixing = [mixing_of(good), mixing_of(good)]
    mixing[place] = mixing_of(np.full_like(good, 0.3))
    assert least_ess(mixing) == 0.0
    found = assess_convergence(_chains(good), mixing, [], 1000.0, ())
    assert any("R-hat" in reason for reason in found.reasons)
    assert not assess_convergence(_chains(good), mixing[:1], mixing[1:], 1000.0, ()).converged


@pytest.mark.parametrize("steps", [LEAST_DRAWS, 1000])
def test_one_chain_that_does_not_move_is_found_out(steps: int) -> None:
    draws = _autoregressive(0.0, steps)
    draws[:, 2] = 0.5
    mixing = mixing_of(draws)
    assert np.isnan(mixing.autocorrelation)
    assert not assess_convergence(_chains(draws), [mixing], [], 10.0, ()).converged


def test_no_parameter_has_no_worth() -> None:
    assert least_ess([]) == 0.0
    assert least_ess([Mixing(300.0, 200.0, 1.0, 1.0), Mixing(250.0, 400.0, 1.0, 1.0)]) == 200.0


@pytest.mark.parametrize("index", [0.3, 0.5, 1.0])
def test_the_tail_of_the_weights_is_measured(index: float) -> None:
    # A Pareto variate of index 1 / k is the exponential of an exponential one of mean k.
    log_ratio = np.random.default_rng(4).exponential(index, size=20_000)
    found = _assessed(_autoregressive(0.0), log_ratio=log_ratio - 300.0)
    assert found.pareto_k == pytest.approx(index, abs=0.12)
    assert found.converged == (index < 0.7)
    assert any("Pareto" in reason for reason in found.reasons) == (index > 0.7)


def test_a_tail_of_weights_that_are_nearly_equal_is_no_reason() -> None:
    """Its index is the same as that of one that matters."""
    shape = np.exp(np.random.default_rng(4).exponential(1.0, size=20_000))
    even, uneven = (
        _assessed(_autoregressive(0.0), log_ratio=np.log1p(size * shape / shape.max()))
        for size in (0.05, 50.0)
    )
    assert even.converged
    assert not uneven.converged
    assert min(even.pareto_k, uneven.pareto_k) > 0.8
    assert even.heaviest_weight == pytest.approx(1.05, abs=0.01)
    assert uneven.heaviest_weight > 10.0


def test_divergences_are_a_reason_beyond_one_in_a_hundred() -> None:
    draws = _autoregressive(0.0)
    assert _assessed(draws, divergences=draws.size // 200).converged
    found = _assessed(draws, divergences=draws.size // 50)
    assert ["diverged" in reason for reason in found.reasons] == [True]
    assert found.divergences == draws.size // 50


def test_doubts_that_were_known_come_first() -> None:
    draws = _autoregressive(0.0)
    found = assess_convergence(_chains(draws), [mixing_of(draws)], [], 1e6, ("the mode was not found",))
    assert found.reasons[0] == "the mode was not found"
    assert len(found.reasons) == 2
