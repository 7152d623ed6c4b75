"""The draw and the recording of a trial on the rig itself, in three dwells."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS
from savgs_ident.plants.quarter_car.model import FREE
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.validation.blind_answer import Answer
from savgs_ident.validation.blind_draw import (
    LARGEST,
    SMALLEST,
    Drawing,
    Present,
    Shares,
    draw_answer,
    drawing_of,
)
from savgs_ident.validation.virtual_campaign import record_campaign, write_recordings
from savgs_ident.validation.virtual_rig import ORDERS, Bench, Programme, change_of, draw_rig

from .blind_answers import BLANK, answer

DWELLS = (1.4, 2.35, 5.5)
EFFECTS = ("rail_viscous", "accel_lag", "cam_harmonic", "bump_stop")


@pytest.fixture(scope="module")
def bench(rig: Rig) -> Bench:
    return Bench(rig, MODELS["simtr"], FREE, Programme(DWELLS, standstill=2.0))


@pytest.fixture(scope="module")
def drawing(bench: Bench) -> Drawing:
    found = drawing_of(bench, draw_rig(bench, np.random.default_rng(5)))
    assert found is not None
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFECTS)
def test_effects_change_the_response_by_what_was_drawn(drawing: Drawing, name: str) -> None:
    """Solved once more from a cold start, on nodes of its own."""
    present = drawing.present(name, np.random.default_rng(2))
    assert present is not None
    assert SMALLEST * 0.98 <= present.change <= LARGEST * 1.02
    there = dict(drawing.rig) | dict(present.parameters)
    cold = drawing.bench.solve((name,), there)
    without = drawing.bench.solve((), drawing.rig)
    assert cold is not None
    assert without is not None
    responses = [
        drawing.bench.response((name,), given, solution)
        for given, solution in ((there, cold), (drawing.rig, without))
    ]
    assert change_of(*responses) == pytest.approx(present.change, rel=0.02)


def test_a_change_is_relative_to_the_larger_of_first_harmonic_and_waveform() -> None:
    without = np.zeros((2, 2, 4), dtype=np.complex128)
    without[..., 1], without[..., 3] = 3.0, 4.0
    first, third = without.copy(), without.copy()
    first[0, 1, 1] += 0.3j
    third[1, 0, 3] += 1.0
    mean = without.copy()
    mean[..., 0] += 5.0
    assert change_of(first, without) == pytest.approx(0.1)
    assert change_of(third, without) == pytest.approx(0.2)
    assert change_of(mean, without) == 0.0


@pytest.mark.slow
def test_what_calibration_or_a_tolerance_can_do_does_not_stand_out(drawing: Drawing) -> None:
    stiffer = 1.0 * drawing.bench.table["k_sd"].tolerance / drawing.bench.table["k_sd"].value
    for name, parameter, value in (
        ("damper_scale", "damper_scale_change", 0.1),
        ("spring_rate", "spring_rate_change", stiffer),
    ):
        response = drawing.solve((name,), {**drawing.rig, parameter: value})
        assert response is not None
        assert change_of(response, drawing.response) > 0.02, name
        assert drawing.sigma(response) < 2.5, name


@pytest.mark.slow
def test_a_damper_stands_out_by_its_ratio_to_its_tolerance_beside_another_effect_too(
    drawing: Drawing,
) -> None:
    """Far softer, known to 8 %: on the way to it no other tolerance is to be broken, and no bound left."""
    mass = _present(drawing, "unsprung_mass", unsprung_mass_change=38.0)
    both = {**drawing.rig, **mass.parameters, "damper_scale_change": -0.4}
    response = drawing.solve(("damper_scale", "unsprung_mass"), both)
    assert response is not None
    softer = 0.4 * drawing.rig["c_sd"] / drawing.bench.table["c_sd"].tolerance
    assert drawing.sigma(response, mass) == pytest.approx(softer, rel=0.05)


@pytest.mark.slow
def test_the_sizes_of_an_effect_end_where_its_parameters_do(drawing: Drawing) -> None:
    mass = Present("unsprung_mass", {"unsprung_mass_change": 10.0}, 0.1, drawing.response)
    lower, upper = mass.bounds
    assert (lower.item(), upper.item()) == (-2.0, 4.0)
    assert mass.at(upper)["unsprung_mass_change"] == 40.0
    nothing = Present("unsprung_mass", {"unsprung_mass_change": 0.0}, 0.0, drawing.response)
    assert (nothing.bounds[0].item(), nothing.bounds[1].item()) == (-np.inf, np.inf)


@pytest.mark.slow
def test_a_gain_stands_out_by_its_ratio_to_its_tolerance(drawing: Drawing) -> None:
    """The accelerometer's gain is known to half a per cent, and far better from the data than that."""
    response = drawing.solve(("accel_gain",), {**drawing.rig, "accel_gain_error": 0.035})
    assert response is not None
    assert drawing.sigma(response) == pytest.approx(0.035 / 0.005, rel=0.05)


def _present(drawing: Drawing, name: str, **parameters: float) -> Present:
    response = drawing.solve((name,), {**drawing.rig, **parameters})
    assert response is not None
    return Present(name, parameters, change_of(response, drawing.response), response)


@pytest.mark.slow
def test_lookalikes_imitate_each_other(drawing: Drawing) -> None:
    gain = _present(drawing, "accel_gain", accel_gain_error=-0.1)
    tilt = _present(drawing, "accel_tilt", accel_tilt_versine=0.04)
    lag = _present(drawing, "accel_lag", accel_lag_time=0.01)
    assert "accel_tilt" in drawing.imitators(gain)
    assert "accel_tilt" not in drawing.imitators(lag)
    # Beside an effect of any size, another one stands out only if it is something else.
    assert drawing.sigma(gain.response, tilt) < 2.5
    assert drawing.sigma(gain.response, lag) > 10.0
    assert drawing.sigma(lag.response, tilt) > 10.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shares", "count"),
    [
        (Shares(1, 0, 0, 0), 0),
        (Shares(0, 1, 0, 0), 1),
        (Shares(0, 0, 0, 1), 1),
    ],
)
def test_draws_are_what_was_asked_for_and_can_be_repeated(bench: Bench, shares: Shares, count: int) -> None:
    first, again = (draw_answer(bench, shares, 3, np.random.default_rng(11)) for _ in range(2))
    assert first == again
    assert len(first.effects) == count
    assert set(first.parameters) == {p.name for name in first.effects for p in CATALOGUE[name].parameters}
    assert first.ports == tuple(CATALOGUE[name].port.location for name in first.effects)
    assert {*first.sigmas} == {*first.effects}
    assert not {*first.imitators} & {*first.effects, *first.without}
    assert set(first.effects) <= set(CATALOGUE) - set(MODELS["simtr"])
    assert set(first.effects) <= set(first.without) if shares.unknown else first.without == ()


def test_the_rig_is_off_its_sheet_by_its_tolerances(bench: Bench) -> None:
    draws = [draw_rig(bench, np.random.default_rng(seed)) for seed in range(300)]
    table = bench.rig.parameters
    expected = {each.name: each.tolerance for each in table.entries if each.tolerance > 0.0}
    expected |= {name: 0.1 * table[name].value for name in ("mu_r", "mu_t", "ydot_Hth")}
    assert set(draws[0]) == set(expected)
    for name, spread in expected.items():
        values = np.array([draw[name] for draw in draws])
        assert values.min() >= table[name].lower
        assert values.max() <= table[name].upper
        if name != "motor_gear_efficiency":  # Its upper bound is near.
            assert np.mean(values) == pytest.approx(table[name].value, abs=4.0 * spread / np.sqrt(300))
            assert np.std(values) == pytest.approx(spread, rel=0.2)


@pytest.fixture(scope="module")
def truth(drawing: Drawing) -> Answer:
    """Two effects, one of which is in a sensor."""
    given = {"stribeck_rise": 0.2, "stribeck_velocity": 0.08, "accel_lag_time": 0.01}
    return replace(answer("two", "rail_stribeck", "accel_lag", **given), rig=drawing.rig)


@pytest.fixture(scope="module")
def campaign(bench: Bench, truth: Answer, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    folder = tmp_path_factory.mktemp("campaign")
    write_recordings(record_campaign(bench, truth, np.random.default_rng(4)), folder)
    return load_campaign(folder)


@pytest.mark.slow
def test_what_is_read_back_agrees_with_the_periodic_solution(
    bench: Bench, truth: Answer, campaign: Campaign
) -> None:
    """Time integration, logger and estimate on one side, collocation on the other: noise is all that is between."""
    response = estimate_response(campaign, ORDERS)
    np.testing.assert_allclose(response.frequency, DWELLS, rtol=1e-5)
    given = {**truth.rig, **truth.parameters}
    solution = bench.solve(truth.effects, given)
    assert solution is not None
    expected = bench.response(truth.effects, given, solution)
    places = [response.channel(name) for name in ("sprung_accel", "susp_deflection")]
    miss = (response.harmonics[:, places] - expected)[..., 1:]
    parts = np.stack([miss.real, miss.imag], axis=-1)
    inverse = np.linalg.inv(response.covariance[:, places, 1:])
    chi2 = np.einsum("dcki,dckij,dckj->dc", parts, inverse, parts) / (2 * ORDERS)
    assert np.all(chi2 < 2.2), chi2
    assert 0.75 < np.mean(chi2) < 1.35
    assert change_of(expected, bench.response((), truth.rig, _plain(bench, truth))) > 0.1


def _plain(bench: Bench, truth: Answer):
    solution = bench.solve((), truth.rig)
    assert solution is not None
    return solution


@pytest.mark.slow
def test_noise_stamps_and_lengths_are_those_of_the_sheet(bench: Bench, campaign: Campaign) -> None:
    assert [each.kind for each in campaign.recordings] == ["dwell", "dwell", "dwell", "standstill"]
    assert campaign.recordings[0].name == "dwell_1.40Hz"
    noise = {"road_height": 1e-5, "sprung_accel": 0.05, "susp_deflection": 1e-4}
    (still,) = campaign.of_kind("standstill")
    for name, sd in noise.items():
        values = still.channels[name].values
        assert np.std(values) == pytest.approx(sd, rel=0.1)
        assert abs(np.mean(values)) < 5.0 * sd / np.sqrt(values.size)
    for dwell in campaign.of_kind("dwell"):
        road, link = dwell.channels["road_height"], dwell.channels["link_angle"]
        periods = max(8, np.ceil(6.0 * dwell.frequency_hz))
        assert road.time.size == round(periods / dwell.frequency_hz * 500.0)
        jitter = road.time - np.arange(road.time.size) / 500.0
        assert np.std(jitter) == pytest.approx(4e-5, rel=0.1)
        assert np.ptp(road.values) == pytest.approx(0.0275, abs=1e-4)
        assert np.max(np.abs(link.values - np.pi / 2.0)) < 2e-5
    assert campaign.warnings == ()


@pytest.mark.slow
def test_the_same_draw_gives_the_same_bytes(bench: Bench, tmp_path: Path) -> None:
    short, files = replace(bench, programme=Programme((5.5,), standstill=0.5)), []
    for place, seed in (("one", 9), ("same", 9), ("other", 8)):
        (tmp_path / place).mkdir()
        recordings = record_campaign(short, BLANK, np.random.default_rng(seed))
        files.append(write_recordings(recordings, tmp_path / place).read_bytes())
    assert files[0] == files[1]
    assert files[0] != files[2]
