"""Dwells and roads in one campaign: each as it would be alone, and together more than either."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.fit.public import compare
from savgs_ident.inference.likelihood import likelihood_of
from savgs_ident.inference.targets import harmonic_target
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, ChannelSpec, RecordedChannel, RecordingLayout
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.selection import by_kind, only_tests
from savgs_ident.simulate.compared_tests import response_of_tests, up_to_frequency
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.forgetting import forgetful_motion, forgetful_response
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from tests.simulate.linear_roads import campaign, dwells_and_road

MODEL = si.PlantModel(si.TwoMass(), PARAMETERS)
ORDERS = 9


def only_kinds(campaign: Campaign, *kinds: str) -> Campaign:
    return replace(campaign, recordings=tuple(each for each in campaign.recordings if each.kind in kinds))


@pytest.fixture(scope="module")
def both() -> HarmonicResponse:
    return response_of_tests(dwells_and_road(), MODEL.plant, ORDERS)


@pytest.fixture(scope="module")
def alone() -> tuple[HarmonicResponse, HarmonicResponse]:
    made = dwells_and_road()
    kinds = ("dwell", "road")
    dwells, windows = (
        response_of_tests(only_kinds(made, kind, "standstill"), MODEL.plant, ORDERS) for kind in kinds
    )
    return dwells, windows


def test_dwells_out_of_both_are_the_dwells_alone(
    both: HarmonicResponse, alone: tuple[HarmonicResponse, HarmonicResponse]
) -> None:
    dwells, _ = alone
    found = only_tests(both, both.dwells)
    assert both.dwells.size == 5
    assert found.part is None
    assert found.channels == dwells.channels
    for each in fields(HarmonicResponse):
        if isinstance(getattr(dwells, each.name), np.ndarray) and each.name != "recorded":
            np.testing.assert_array_equal(getattr(found, each.name), getattr(dwells, each.name), each.name)


def test_windows_out_of_both_are_the_windows_alone(
    both: HarmonicResponse, alone: tuple[HarmonicResponse, HarmonicResponse]
) -> None:
    _, windows = alone
    found = only_tests(both, both.windows)
    assert found.tests == windows.tests
    assert found.part is not None
    assert windows.part is not None
    np.testing.assert_array_equal(np.stack(found.part), np.stack(windows.part))
    for name in ("harmonics", "covariance", "valid"):
        np.testing.assert_array_equal(getattr(found, name), getattr(windows, name), name)


def test_tests_are_in_the_order_in_which_they_were_recorded(both: HarmonicResponse) -> None:
    when = both.times
    np.testing.assert_allclose(when[both.dwells], np.arange(5.0))
    assert np.all(np.diff(when[both.windows]) > 0.0)
    assert np.all((when[both.windows] > 5.0) & (when[both.windows] < 6.0))


def test_each_kind_has_the_discrepancy_that_it_has_alone(
    both: HarmonicResponse, alone: tuple[HarmonicResponse, HarmonicResponse]
) -> None:
    channels = MODEL.plant.channels
    together = likelihood_of(harmonic_target(both, channels, ORDERS)).data
    parts = [likelihood_of(harmonic_target(each, channels, ORDERS)).data for each in alone]
    for name in ("measured", "variance", "discrepancy_scale"):
        np.testing.assert_allclose(
            getattr(together, name), np.concatenate([getattr(each, name) for each in parts]), err_msg=name
        )


def predicted(measured: HarmonicResponse) -> np.ndarray:
    plant = TwoMass()
    solution = simulate_periodic(
        plant, as_values(PARAMETERS.as_dict()), measured_excitation(plant, measured, PARAMETERS)
    )
    assert all(status.ok for status in solution.status())
    orders = harmonic_target(measured, plant.channels, ORDERS).used.shape[-1] - 1
    return np.asarray(harmonics(plant, as_values(PARAMETERS.as_dict()), solution, orders))


@pytest.mark.slow
def test_a_plant_does_in_both_what_it_does_in_each(
    both: HarmonicResponse, alone: tuple[HarmonicResponse, HarmonicResponse]
) -> None:
    together, (dwells, windows) = predicted(both), map(predicted, alone)
    size = np.abs(dwells).max()
    np.testing.assert_allclose(together[both.dwells, :, : ORDERS + 1], dwells, atol=1e-8 * size)
    np.testing.assert_allclose(together[both.windows], windows, atol=1e-8 * np.abs(windows).max())


def test_of_a_plant_that_forgets_too_slowly_the_road_is_compared_in_pieces() -> None:
    ringing = si.PlantModel(si.TwoMass(), PARAMETERS.with_values({"c": 50.0}))
    found, _ = forgetful_motion(dwells_and_road(noise=0.0), ringing, ORDERS)
    assert found.tests[5:] == ("road_c, 0.0 to 10.0 s", "road_c, 10.0 to 20.0 s")
    assert found.part is not None
    assert found.part.opens.tolist() == [False] * 5 + [True] * 2


def test_a_road_that_is_too_short_for_a_window_is_compared_from_its_beginning() -> None:
    found = forgetful_response(dwells_and_road(seconds=4.0), MODEL, ORDERS)
    assert found.tests[5:] == ("road_c, 0.0 to 4.0 s",)
    assert found.part is not None
    assert found.part.opens.tolist() == [False] * 5 + [True]


def test_a_comparison_shows_dwells_and_windows() -> None:
    compared = compare(MODEL, dwells_and_road(), ORDERS)
    assert list(compared.figure_names) == ["bode", "spectra"]
    dwells, windows = by_kind(compared)
    assert dwells is not None
    assert windows is not None
    assert dwells.used.sum() + windows.used.sum() == compared.used.sum()
    record = compared.to_dict()
    assert set(record["channels"]) == set(record["channels_in_windows"]) == {"body_accel", "susp_deflection"}
    assert len(record["channels"]["body_accel"]["measured"]["phase_deg"]) == 5


@pytest.mark.slow
def test_a_road_adds_to_what_noisy_dwells_say() -> None:
    """Not more than a road alone says of its own time: what is identified may drift over the campaign."""
    made = dwells_and_road(noise=30.0, seed=3)
    dwells = si.fit(MODEL, only_kinds(made, "dwell", "standstill"), free=("k", "c"))
    fit = si.fit(MODEL, made, free=("k", "c"))
    assert fit.trusted
    for name in ("k", "c"):
        found = fit[name]
        assert abs(found.value - PARAMETERS[name].value) < 4.0 * found.stderr
        assert found.stderr < 0.7 * dwells[name].stderr


@pytest.mark.slow
def test_a_diagnosis_of_both_finds_nothing_missing_in_a_true_model(tmp_path: Path) -> None:
    found = si.diagnose(MODEL, dwells_and_road(noise=3.0, seed=4))
    assert found.verdict.kind == "none"
    assert found.map
    names = list(found.figure_names)
    assert "gap body_accel" in names
    assert "gap spectrum body_accel" in names
    page = found.to_html(tmp_path / "both.html").read_text()
    assert "5 dwells between 0.90 and 9.00 Hz and 2 windows of tests that do not repeat" in page


def without_reading(campaign: Campaign, kind: str, *names: str) -> Campaign:
    """The campaign whose tests of a kind lack some channels."""
    changed = [
        replace(each, channels={n: c for n, c in each.channels.items() if n not in names})
        if each.kind == kind
        else each
        for each in campaign.recordings
    ]
    return replace(campaign, recordings=tuple(changed))


@pytest.mark.slow
def test_a_road_too_short_for_what_the_plant_remembers_is_compared_from_its_beginning() -> None:
    """It is long enough for the usual lead, and not for the one that is then asked for."""
    slow = si.PlantModel(si.TwoMass(), PARAMETERS.with_values({"c": 600.0}))
    found, _ = forgetful_motion(dwells_and_road(seconds=9.0), slow, ORDERS)
    assert found.tests[5:] == ("road_c, 0.0 to 9.0 s",)


def test_a_road_without_readings_is_left_out() -> None:
    made = without_reading(dwells_and_road(), "road", "body_accel", "susp_deflection")
    found = response_of_tests(made, MODEL.plant, ORDERS)
    assert len(found.tests) == 5
    (warning,) = [each for each in found.warnings if each.code == "tests_not_used"]
    assert "no window has body_accel or susp_deflection" in warning.what


def test_a_road_may_lack_a_reading_that_the_dwells_have() -> None:
    made = without_reading(dwells_and_road(), "road", "susp_deflection")
    compared = compare(MODEL, made, ORDERS)
    assert compared.used[compared.measured.dwells, 1].any()
    assert not compared.used[compared.measured.windows, 1].any()
    assert compared.used[compared.measured.windows, 0].any()
    assert compared.figure("spectra").axes


def test_no_more_is_compared_where_a_reading_was_not_recorded_at_all(both: HarmonicResponse) -> None:
    made = dwells_and_road()
    for kind in ("road", "dwell", "standstill"):
        made = without_reading(made, kind, "susp_deflection")
    less = harmonic_target(response_of_tests(made, MODEL.plant, ORDERS), MODEL.plant.channels, ORDERS)
    assert less.used.shape == harmonic_target(both, MODEL.plant.channels, ORDERS).used.shape


@pytest.mark.slow
def test_peaks_are_those_of_the_dwells() -> None:
    made = dwells_and_road()
    dwells = si.fit(MODEL, only_kinds(made, "dwell", "standstill"), free=("k",), peak_to_peak=True)
    fit = si.fit(MODEL, made, free=("k",), peak_to_peak=True)
    assert fit["k"].value == pytest.approx(dwells["k"].value, rel=1e-9)
    assert any(each.code == "tests_not_used" for each in fit.origin.warnings)
    with pytest.raises(InputError, match="no peak-to-peak"):
        si.fit(MODEL, only_kinds(made, "road", "standstill"), free=("k",), peak_to_peak=True)


def test_a_frequency_limits_dwells_and_what_is_compared_in_windows() -> None:
    found = response_of_tests(dwells_and_road(), MODEL.plant, ORDERS, max_frequency=4.0)
    assert found.frequency[found.dwells].max() == pytest.approx(3.0, rel=1e-3)
    places = [found.channel(each.name) for each in MODEL.plant.channels]
    hertz = found.spacing[found.windows][:, None, None] * np.arange(found.orders + 1)
    assert np.max(np.where(found.valid[found.windows][:, places], hertz, 0.0)) <= 4.0
    assert response_of_tests(dwells_and_road(), MODEL.plant, ORDERS, max_frequency=50.0).windows.size
    with pytest.raises(InputError, match=r"no dwell is at 0\.5 Hz"):
        up_to_frequency(found, 0.5)


def test_what_was_recorded_beside_is_known_in_windows() -> None:
    """Oil that warms by a tenth of a degree a second in every test: the mean of what is compared of a window."""
    made = dwells_and_road()
    warming = []
    for each in made.recordings:
        time = next(iter(each.channels.values())).time
        oil = RecordedChannel("oil_temperature", "degC", time, 20.0 + 0.1 * time)
        warming.append(replace(each, channels={**each.channels, oil.name: oil}))
    layout = RecordingLayout((ChannelSpec("oil_temperature", "degC", "oil", free=True),))
    found = response_of_tests(replace(made, recordings=tuple(warming), layout=layout), MODEL.plant, ORDERS)
    assert found.part is not None
    oil = found.beside["oil_temperature"]
    np.testing.assert_allclose(oil[found.dwells], 20.0 + 0.1 * 4.0, atol=1e-3)
    ends = [float(test.split(" to ")[1].removesuffix(" s")) for test in found.tests if " to " in test]
    compared = ((found.part.end - found.part.begin) / (2.0 * np.pi * found.frequency))[found.windows]
    np.testing.assert_allclose(oil[found.windows], 20.0 + 0.1 * (ends - 0.5 * compared), atol=0.01)


def test_a_channel_that_was_never_recorded_is_not_drawn(tmp_path: Path) -> None:
    made = without_reading(campaign(), "road", "susp_deflection")
    compared = compare(MODEL, replace(made, recordings=made.recordings[:1]), ORDERS)
    files = {each.name for each in compared.save(tmp_path)}
    assert {"spectra.png", "bode.json"} <= files
    assert compared.measured.channels == ("road_height", "body_accel")
