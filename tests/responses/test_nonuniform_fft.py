"""Fast sums and least squares against the plain ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.responses.harmonic_response import peak_to_peak
from savgs_ident.responses.periodic_fit import fit_periodic, plan_basis, plan_transform, signals, sums


@given(highest=st.integers(0, 300), samples=st.integers(1, 400), seed=st.integers(0, 2**31))
def test_fast_sums_equal_plain_sums(highest: int, samples: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    phase = rng.uniform(-1e3, 1e3, samples)
    rows = rng.standard_normal((2, samples))
    turns = np.exp(-1j * np.outer(np.arange(highest + 1), phase))
    plan = plan_transform(phase, highest)
    # The phase of an order is known to its rounding only: here after hundreds of turns.
    precision = 2e-12 + 2.0 * np.finfo(float).eps * highest * np.abs(phase).max()
    assert np.max(np.abs(sums(plan, rows) - rows @ turns.T)) < precision * np.abs(rows).sum()
    amplitude = rng.standard_normal((2, highest + 1)) + 1j * rng.standard_normal((2, highest + 1))
    amplitude[:, 0] = amplitude[:, 0].real
    plain = (amplitude @ turns.conj()).real
    assert np.max(np.abs(signals(plan, amplitude) - plain)) < precision * np.abs(amplitude).sum()


@given(
    frequency=st.floats(0.5, 6.0),
    periods=st.floats(3.0, 15.0),
    jitter=st.floats(0.0, 0.3),
    seed=st.integers(0, 2**31),
)
def test_fit_equals_dense_least_squares(frequency: float, periods: float, jitter: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, highest = int(40 * periods), 9
    time = (np.arange(count) + jitter * rng.standard_normal(count)) / (40 * frequency)
    time -= time.mean()
    values = rng.standard_normal((2, count))
    fit = fit_periodic(plan_basis(time, frequency, highest), values, highest, 5)
    angle = 2 * np.pi * frequency * np.outer(time, np.arange(1, highest + 1))
    columns = np.column_stack([np.ones(count), time, np.cos(angle), np.sin(angle)])
    weights = np.linalg.lstsq(columns, values.T, rcond=None)[0]
    np.testing.assert_allclose(fit.amplitude[:, 0].real, weights[0], atol=1e-10)
    np.testing.assert_allclose(fit.slope, weights[1], atol=1e-9)
    np.testing.assert_allclose(
        fit.amplitude[:, 1:], (weights[2 : 2 + highest] - 1j * weights[2 + highest :]).T, atol=1e-10
    )
    inverse = np.linalg.inv(columns.T @ columns)
    for order in range(1, 6):
        re, im = 1 + order, 1 + order + highest
        gain = inverse[re, re] + inverse[im, im]
        skew = inverse[re, re] - inverse[im, im] - 2j * inverse[re, im]
        assert fit.gain[order] == pytest.approx(gain, rel=1e-6)
        assert fit.pseudo_gain[order] == pytest.approx(skew, abs=1e-6 * gain)
    assert fit.gain[0] == pytest.approx(inverse[0, 0], rel=1e-6)


def test_stamps_that_do_not_determine_the_harmonics_are_refused() -> None:
    time = np.repeat([-0.5, -0.25, 0.0, 0.25], 50)
    with pytest.raises(np.linalg.LinAlgError):
        fit_periodic(plan_basis(time, 1.0, 8), np.sin(time)[None] + time**2, 8, 0)


@given(shift=st.floats(0.0, 1.0), scale=st.floats(1e-3, 1e3), seed=st.integers(0, 2**31))
def test_peak_to_peak_scales_and_ignores_mean_and_phase(shift: float, scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    harmonics = rng.standard_normal(9) + 1j * rng.standard_normal(9)
    valid = np.ones(9, dtype=np.bool_)
    turned = scale * harmonics * np.exp(2j * np.pi * shift * np.arange(9))
    turned[0] = 17.0
    size = np.abs(harmonics).sum()
    plain = float(peak_to_peak(harmonics, valid))
    assert float(peak_to_peak(turned, valid)) == pytest.approx(scale * plain, abs=3e-3 * scale * size)
    assert 0.0 < plain <= 2.0 * size
    only_first = np.arange(9) == 1
    assert float(peak_to_peak(harmonics, only_first)) == pytest.approx(2 * abs(harmonics[1]), rel=2e-5)
