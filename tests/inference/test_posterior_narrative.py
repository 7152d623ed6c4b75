"""The sentences about draws whose correlations are known."""

import numpy as np
import pytest

from savgs_ident.fit.sampling import log_covariance, sentences_of
from savgs_ident.inference.result import Marginal, Role


def _marginal(name: str, draws: np.ndarray, role: Role, **changes: float) -> Marginal:
    q025, median, q975 = np.quantile(draws, [0.025, 0.5, 0.975])
    sd = float(draws.std())
    reported = {"laplace_sd": sd, "contraction": 0.99} | changes
    return Marginal(
        name=name, unit="m", about="", role=role, median=float(median), sd=sd, q025=float(q025),
        q975=float(q975), prior=(0.0, 1.0), laplace_value=float(median), ess_bulk=1e3, ess_tail=1e3,
        r_hat=1.0, autocorrelation=1.0, **reported,
    )  # fmt: skip


def _log_normal(correlation: float, first: float = 0.05, second: float = 0.04) -> dict[str, np.ndarray]:
    """Draws of two parameters with these relative deviations, exactly so correlated."""
    z = np.random.default_rng(1).standard_normal((2, 4, 1000))
    flat = z.reshape(2, -1) - z.reshape(2, -1).mean(axis=1, keepdims=True)
    white = np.linalg.solve(np.linalg.cholesky(np.cov(flat)), flat)
    factor = np.linalg.cholesky(np.array([[1.0, correlation], [correlation, 1.0]]))
    logs = (factor @ white).reshape(2, 4, 1000)
    return {"mu_t": 0.25 * np.exp(first * logs[0]), "ydot": 0.05 * np.exp(second * logs[1])}


def _sentences(
    draws: dict[str, np.ndarray],
    miss: float = 0.001,
    noise: float = 1.0,
    advice: tuple[str, ...] = (),
    **changes: float,
) -> tuple[str, ...]:
    marginals = [_marginal(name, each, "identified", **changes) for name, each in draws.items()]
    random = np.random.default_rng(2)
    scales = {
        "noise_scale": noise * np.exp(0.01 * random.standard_normal((4, 1000))),
        "discrepancy": miss * np.exp(0.1 * random.standard_normal((4, 1000))),
    }
    marginals += [_marginal(name, each, "nuisance") for name, each in scales.items()]
    return sentences_of(marginals, draws | scales, advice)


def test_the_covariance_of_the_logarithms_is_the_one_drawn() -> None:
    found = log_covariance(("mu_t", "ydot"), _log_normal(0.9))
    np.testing.assert_allclose(found, [[2.5e-3, 1.8e-3], [1.8e-3, 1.6e-3]], rtol=1e-9)


@pytest.mark.parametrize(("correlation", "label"), [(0.95, "mu_t/ydot"), (-0.95, "mu_t x ydot")])
def test_two_that_trade_off_are_named_with_their_known_combination(correlation: float, label: str) -> None:
    sentences = _sentences(_log_normal(correlation))
    error = 100.0 * np.sqrt(0.05**2 + 0.04**2 - 2.0 * 0.95 * 0.05 * 0.04)
    assert (
        f"mu_t and ydot trade off along a line: {label} is known to {error:.2g} %, "
        "they themselves to 5 % and 4 %." in sentences
    )
    assert "These data identify mu_t to 5 %, ydot to 4 %." in sentences


def test_two_that_hardly_correlate_are_not_named() -> None:
    assert not any("trade off" in each for each in _sentences(_log_normal(0.7)))


def test_a_parameter_that_is_not_identified_is_named() -> None:
    sentences = _sentences(_log_normal(0.0, second=0.6), advice=("A dwell at 5 Hz would help.",))
    assert "These data do not identify ydot." in sentences
    assert "These data identify mu_t to 5 %." in sentences
    assert "A dwell at 5 Hz would help." in sentences


def test_two_that_cannot_be_distinguished_are_named_once() -> None:
    sentences = _sentences(_log_normal(0.999, first=0.6, second=0.6))
    assert [each for each in sentences if "trade off" in each] == [
        "mu_t and ydot cannot be distinguished: they trade off along a line."
    ]
    error = 100.0 * 0.6 * np.sqrt(2.0 * 0.001)
    assert any(
        each.startswith("What is known is mu_t/ydot = ") and f"{error:.2g} %" in each for each in sentences
    )


def test_the_discrepancy_of_a_model_is_reported() -> None:
    assert any(
        "err by 3 % of the response at each of its ports" in each
        for each in _sentences(_log_normal(0.0), miss=0.03)
    )
    small = _sentences(_log_normal(0.0), miss=0.001)
    assert any("errs by less than 0.12 % of the response" in each for each in small)
    assert any("noise is 1.3 times" in each for each in _sentences(_log_normal(0.0), noise=1.3))


def test_data_that_add_little_are_reported() -> None:
    assert any(
        "add little" in each and "mu_t, ydot" in each
        for each in _sentences(_log_normal(0.0), contraction=0.3)
    )
    assert not any("add little" in each for each in _sentences(_log_normal(0.0)))


@pytest.mark.parametrize("laplace_sd", [0.02, np.nan])
def test_a_posterior_that_is_not_normal_is_reported(laplace_sd: float) -> None:
    assert any(
        "not normal" in each and "mu_t" in each
        for each in _sentences(_log_normal(0.0), laplace_sd=laplace_sd)
    )
    assert any("same standard deviations to 15 %" in each for each in _sentences(_log_normal(0.0)))
