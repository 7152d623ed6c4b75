"""What is reported of a posterior of tests that do not repeat: windows, frequencies and octaves."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.core.files import to_json
from savgs_ident.fit.result import OverWindows, recorded_spectra
from savgs_ident.inference.inference_data import inference_data
from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.report.posterior.page import posterior_html
from savgs_ident.report.posterior.predicted import octave_rows
from savgs_ident.report.posterior.record import posterior_record
from savgs_ident.report.posterior.text import scope_sentence
from savgs_ident.report.spectra import predicted_spectrum, predicted_spectrum_figure
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse

from .diagnosis_reading import ORIGIN
from .page_reader import Reader
from .posterior_synthetic import synthetic_posterior

WINDOWS, NUMBERS, LENGTH_S, EVERY = 4, 40, 12.5, 4
SPACING = EVERY / LENGTH_S

pytestmark = pytest.mark.usefixtures("undrawn")


def _windows() -> HarmonicResponse:
    """Windows of 12.5 s with numbers from 0.64 Hz to 12.5 Hz, and none of the last in one channel."""
    random = np.random.default_rng(6)
    shape = (WINDOWS, 3, NUMBERS)
    values = random.standard_normal(shape) + 1j * random.standard_normal(shape)
    valid = np.zeros(shape, np.bool_)
    valid[:, 1:, 2:] = True
    valid[:, 2, -1] = False
    sd = np.full(shape[:2], 0.05)
    return HarmonicResponse(
        tests=tuple(f"road, {3 + 9 * number}.0 to {12 + 9 * number}.0 s" for number in range(WINDOWS)),
        channels=("road_height", "sprung_accel", "susp_deflection"),
        frequency=np.full(WINDOWS, 1.0 / LENGTH_S),
        frequency_sd=np.zeros(WINDOWS),
        harmonics=values,
        covariance=sd[:, :, None, None, None] ** 2 * np.ones(NUMBERS)[:, None, None] * np.eye(2),
        valid=valid,
        peak_to_peak=np.zeros(shape[:2]),
        peak_to_peak_sd=np.zeros(shape[:2]),
        noise_sd=sd,
        periods=np.ones(WINDOWS, np.int64),
        part=ComparedPart(*(np.full(WINDOWS, each) for each in (1.5, 6.0, float(EVERY), 0.0, 0.0))),
    )


@pytest.fixture(scope="module")
def posterior() -> HarmonicPosterior:
    return synthetic_posterior(_windows(), length=200)


def test_root_mean_squares_are_over_the_windows_of_what_is_compared(posterior: HarmonicPosterior) -> None:
    measured = posterior.measured
    used = posterior.predictive.used[:, 0].copy()
    used[0, 5] = False
    over = OverWindows.of(measured, used)
    np.testing.assert_allclose(over.frequency, SPACING * np.arange(2, NUMBERS))
    recorded, spread = recorded_spectra(measured, "sprung_accel", NUMBERS)
    found = over.rms(np.abs(recorded) ** 2)
    assert found[3] == pytest.approx(np.sqrt(np.mean(np.abs(recorded[1:, 5]) ** 2)))
    assert found[4] == pytest.approx(np.sqrt(np.mean(np.abs(recorded[:, 6]) ** 2)))
    np.testing.assert_allclose(over.rms(spread), 0.05 * np.sqrt(2.0))


def test_of_repetitions_95_per_cent_lie_in_the_band(posterior: HarmonicPosterior) -> None:
    for c in range(2):
        frequency, recorded, ends = predicted_spectrum(posterior, c)
        over = OverWindows.of(posterior.measured, posterior.predictive.used[:, c])
        repeated = over.rms(np.abs(posterior.predictive.replicated[:, :, c]) ** 2)
        np.testing.assert_allclose(np.mean((ends[0] <= repeated) & (repeated <= ends[1])), 0.95, atol=0.01)
        # What was recorded is one of them.
        assert np.mean((ends[0] <= recorded) & (recorded <= ends[1])) > 0.8
        assert frequency.size == NUMBERS - 2 - c


def test_the_figure_draws_every_frequency_inside_its_panels(posterior: HarmonicPosterior) -> None:
    figure = predicted_spectrum_figure(posterior, 0)
    above, below = figure.axes
    assert above.get_ylabel() == "amplitude, rms over windows [m/s²]"
    assert below.get_xlabel() == "frequency [Hz]"
    for axes in figure.axes:
        low, high = axes.get_ylim()
        (points,) = (line for line in axes.get_lines() if line.get_marker() == "o")
        values = np.asarray(points.get_ydata())
        assert values.size == NUMBERS - 2
        assert low < values.min() <= values.max() < high


def test_the_page_speaks_of_windows_and_octaves(posterior: HarmonicPosterior) -> None:
    page = Reader(posterior_html(posterior, ORIGIN))
    text = " ".join(page.texts)
    assert (
        "4 windows of tests that do not repeat (300 harmonics at 38 frequencies from 0.64 to 12.5 Hz)" in text
    )
    assert "by octave" in text
    assert "dwell" not in scope_sentence(posterior)
    rows = octave_rows(posterior)
    octaves = "0.64 to 0.96", "1.3 to 2.2", "2.6 to 4.8", "5.1 to 9.9", "10 to 12"
    assert [row.where for row in rows] == [f"{each} Hz" for each in octaves]
    used = posterior.predictive.used
    totals = [sum(int(row.cells[c].split(" of ")[1]) for row in rows) for c in range(2)]
    assert totals == [int(np.sum(used[:, c])) for c in range(2)]
    inside = [sum(int(row.cells[c].split(" of ")[0]) for row in rows) for c in range(2)]
    assert sum(inside) == posterior.predictive.count_inside[0]


def test_the_record_and_the_data_of_arviz_hold_it(posterior: HarmonicPosterior) -> None:
    assert "nan" not in to_json(posterior_record(posterior, ORIGIN)).lower()
    tree = inference_data(posterior)
    np.testing.assert_allclose(tree["observed_data"].coords["spacing"], SPACING)


def test_a_channel_that_was_not_compared_has_no_picture(posterior: HarmonicPosterior) -> None:
    used = posterior.predictive.used.copy()
    used[:, 0] = False
    less = replace(posterior, predictive=replace(posterior.predictive, used=used))
    titles = [attributes["alt"] or "" for attributes in Reader(posterior_html(less, ORIGIN)).pictures]
    assert sum(each.startswith("Spectrum of the") for each in titles) == 1
