"""Gap figures from rows of which the answer is known."""

import numpy as np
import pytest

from savgs_ident.diagnosis.gap import Rows, Shrink, shrinks
from savgs_ident.inference.observations import Data

TESTS, ROWS = 30, 40
CHANNELS = ("sprung_accel", "susp_deflection")


def _case(seed: int, noise: float) -> tuple[Data, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    channel = np.tile(np.repeat([0, 1], ROWS // 2), TESTS)
    truth = rng.standard_normal(TESTS * ROWS) * np.where(channel == 0, 5.0, 0.01)
    variance = (noise * np.where(channel == 0, 5.0, 0.01)) ** 2
    measured = truth + np.sqrt(variance) * rng.standard_normal(truth.size)
    data = Data(measured, variance, np.ones_like(truth), np.repeat(np.arange(TESTS), ROWS))
    return data, truth, channel


def test_each_channel_counts_by_its_own_power() -> None:
    data, truth, channel = _case(1, 1e-6)
    off = np.where(channel == 0, 1.03, 1.04)
    together, by_channel = shrinks(data, Rows(truth * 1.2, truth * off, truth, channel, CHANNELS))
    assert by_channel["sprung_accel"].recalibrated == pytest.approx(0.03, rel=1e-3)
    assert by_channel["susp_deflection"].recalibrated == pytest.approx(0.04, rel=1e-3)
    assert together.recalibrated == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2.0), rel=1e-3)
    assert together.before == pytest.approx(0.2, rel=1e-3)


def test_a_model_that_leaves_the_noise_closes_all() -> None:
    data, truth, channel = _case(2, 0.01)
    together, _ = shrinks(data, Rows(truth * 1.1, truth * 1.05, truth, channel, CHANNELS))
    assert together.floor == pytest.approx(0.01, rel=0.05)
    assert together.after == pytest.approx(together.floor, rel=0.1)
    assert together.share_closed == pytest.approx(1.0, abs=0.005)
    low, high = together.interval
    assert low <= together.share_closed <= high <= 1.0


def test_half_of_the_amplitude_is_three_quarters_of_the_gap() -> None:
    data, truth, channel = _case(3, 1e-6)
    together, _ = shrinks(data, Rows(truth * 1.1, truth * 1.08, truth * 1.05, channel, CHANNELS))
    assert together.share_closed == pytest.approx(0.75, rel=1e-3)


def test_the_interval_is_wider_when_tests_differ() -> None:
    data, truth, channel = _case(4, 1e-6)
    uneven = np.where(data.test < 3, 1.1, 1.01)
    even, _ = shrinks(data, Rows(truth * 1.2, truth, truth * 1.05, channel, CHANNELS))
    rough, _ = shrinks(data, Rows(truth * 1.2, truth, truth * uneven, channel, CHANNELS))
    assert np.ptp(even.interval) < 1e-6 < 0.01 < np.ptp(rough.interval)


def test_what_the_effect_closes_has_an_interval_of_its_own() -> None:
    """Recalibrated from 20 % to 10 %; two halves of the tests are brought to 5 % and to 1 % of the response."""
    data, truth, channel = _case(4, 1e-6)
    uneven = np.where(data.test < TESTS // 2, 1.05, 1.01)
    found, _ = shrinks(data, Rows(truth * 1.2, truth * 1.1, truth * uneven, channel, CHANNELS))
    low, high = found.interval_by_effect
    assert 0.75 - 1e-6 < low < found.closed_by_effect < high < 0.99 + 1e-6
    assert found.closed_by_effect < found.share_closed


def test_where_there_is_nothing_to_close_no_share_is_given() -> None:
    data, truth, channel = _case(5, 0.01)
    perfect = data.measured
    together, _ = shrinks(data, Rows(perfect, perfect, truth, channel, CHANNELS))
    assert np.isnan(together.share_closed)
    assert np.isnan(together.interval).all()


def test_a_channel_that_is_missing_in_a_test_does_not_count_there() -> None:
    data, truth, channel = _case(6, 1e-6)
    kept = (channel == 0) | (data.test > 0)
    part = Data(data.measured[kept], data.variance[kept], data.discrepancy_scale[kept], data.test[kept])
    off = truth * np.where(channel == 0, 1.03, 1.04)
    together, _ = shrinks(part, Rows(truth[kept], off[kept], truth[kept], channel[kept], CHANNELS))
    assert together.recalibrated == pytest.approx(np.sqrt((0.03**2 + 0.04**2) / 2.0), rel=1e-3)


def test_what_calibration_and_the_effect_close_make_up_the_whole() -> None:
    """Of squares beyond the noise: what is left after both is the product of what each leaves."""
    gap = Shrink(0.3, 0.05, 0.004, 0.002, share_closed=0.0, interval=(0.0, 1.0))
    left = (1.0 - gap.closed_by_calibration) * (1.0 - gap.closed_by_effect)
    assert left == pytest.approx((0.004**2 - 0.002**2) / (0.3**2 - 0.002**2))
    assert gap.closed_by_effect == pytest.approx(1.0 - (0.004**2 - 0.002**2) / (0.05**2 - 0.002**2))
    nothing = Shrink(0.001, 0.001, 0.001, 0.002, share_closed=0.0, interval=(0.0, 1.0))
    assert np.isnan(nothing.closed_by_effect)


@pytest.mark.slow
def test_the_square_of_a_gap_of_noise_alone_scatters_as_it_says() -> None:
    data, truth, channel = _case(8, 0.02)
    rng = np.random.default_rng(9)
    squares = []
    for _ in range(400):
        drawn = truth + np.sqrt(data.variance) * rng.standard_normal(truth.size)
        together, _ = shrinks(data, Rows(drawn, data.measured + drawn - truth, truth, channel, CHANNELS))
        squares.append(together.recalibrated**2)
    assert np.std(squares) == pytest.approx(together.scatter, rel=0.12)
