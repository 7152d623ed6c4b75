"""Tests that do not repeat, cut into windows: a road in simulation, against an independent integration of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import StateSpace, lsim

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.effects.effect import generic_effects
from savgs_ident.fit.least_squares import fit_least_squares
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.harmonic_response import TAPER, HarmonicResponse, compared_share
from savgs_ident.responses.windows import CLOSING_S, HIGHEST_HZ, LEAD_S, SAMPLES, estimate_windows
from savgs_ident.simulate.excitation import SUMMED, measured_excitation, signals_at
from savgs_ident.simulate.forgetting import REMEMBERED, forgetful_motion, forgetful_response, remembered
from savgs_ident.simulate.mesh import uniform_mesh, waves
from savgs_ident.simulate.periodic import PeriodicSettings, layout_of, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from tests.simulate.linear_roads import INPUTS, NOISE, RATE, READINGS, campaign, channel_of, recording_of
from tests.simulate.slopes import assert_slopes_are_differences

LAG_S = 0.015


def predicted(measured: HarmonicResponse) -> NDArray[np.complex128]:
    plant, p = TwoMass(), as_values(PARAMETERS.as_dict())
    excitation = measured_excitation(plant, measured, PARAMETERS)
    solution = simulate_periodic(plant, p, excitation)
    assert all(status.ok for status in solution.status())
    return np.asarray(harmonics(plant, p, solution, measured.orders))


def used(measured: HarmonicResponse) -> NDArray[np.bool_]:
    return measured.valid[:, [measured.channel(name) for name in READINGS]]


def test_a_linear_plant_answers_in_windows_as_its_state_matrix_says() -> None:
    measured = estimate_windows(campaign(noise=0.0), INPUTS, READINGS)
    found, kept = predicted(measured), used(measured)
    recorded = measured.harmonics[:, [measured.channel(name) for name in READINGS]]
    for c in range(2):
        miss = np.abs(found[:, c] - recorded[:, c])[kept[:, c]]
        assert np.sqrt(np.mean(miss**2)) < 4e-3 * np.sqrt(np.mean(np.abs(recorded[:, c][kept[:, c]]) ** 2))


@pytest.mark.slow
def test_a_sensor_that_lags_shows_the_share_of_what_it_shows() -> None:
    test, still = campaign(noise=0.0).recordings
    accel = test.channels["body_accel"]
    _, late, _ = lsim(
        StateSpace([[-1.0 / LAG_S]], [[1.0 / LAG_S]], [[1.0]], [[0.0]]), accel.values, accel.time
    )
    other = dict(test.channels) | {accel.name: channel_of(accel.name, accel.time, np.ravel(late))}
    made = Campaign("made", (Recording(test.name, "road", None, other), still), (), "")
    measured = estimate_windows(made, INPUTS, READINGS)
    plant = TwoMass() + generic_effects(TwoMass.ports)["accelerometer_lag"]
    p = as_values(PARAMETERS.as_dict() | {"accelerometer_lag_time": LAG_S})
    solution = simulate_periodic(plant, p, measured_excitation(plant, measured, PARAMETERS))
    found, kept = np.asarray(harmonics(plant, p, solution, measured.orders))[:, 0], used(measured)[:, 0]
    recorded = measured.harmonics[:, measured.channel("body_accel")]
    miss = np.abs(found - recorded)[kept]
    # Without the rate of the share it is off by 1.5 %.
    assert np.sqrt(np.mean(miss**2)) < 4e-3 * np.sqrt(np.mean(np.abs(recorded[kept]) ** 2))


@pytest.mark.slow
def test_slopes_in_windows_are_those_of_differences() -> None:
    measured = estimate_windows(campaign(noise=0.0), INPUTS, READINGS)
    plant = TwoMass() + generic_effects(TwoMass.ports)["accelerometer_lag"]
    values = PARAMETERS.as_dict() | {"accelerometer_lag_time": LAG_S}
    solution = simulate_periodic(plant, as_values(values), measured_excitation(plant, measured, PARAMETERS))
    names = ("k", "c", "accelerometer_lag_time")
    assert_slopes_are_differences(plant, values, solution, names, orders=30, share=1e-4, tolerance=1e-5)


@pytest.mark.slow
def test_with_noise_the_misfit_is_that_of_the_covariance() -> None:
    # Three times the noise, beside which the finite number of nodes does not show.
    measured = estimate_windows(campaign(seed=3, noise=3.0), INPUTS, READINGS)
    miss = predicted(measured) - measured.harmonics[:, [measured.channel(name) for name in READINGS]]
    sd = np.sqrt(measured.covariance[..., 0, 0])[:, [measured.channel(name) for name in READINGS]]
    ratio = (np.abs(miss) ** 2 / (2.0 * sd**2))[used(measured)]
    # Of n numbers of unit variance the mean square scatters by the square root of 2 / n.
    assert np.mean(ratio) == pytest.approx(1.0, abs=5.0 / np.sqrt(ratio.size))


def test_what_is_compared_lies_within_the_record_and_within_the_band() -> None:
    measured = estimate_windows(campaign(), INPUTS, READINGS)
    assert measured.part is not None
    length = 1.0 / measured.frequency
    np.testing.assert_allclose(measured.part.begin * length / (2.0 * np.pi), LEAD_S)
    np.testing.assert_allclose((1.0 - measured.part.end / (2.0 * np.pi)) * length, CLOSING_S)
    hertz = np.flatnonzero(used(measured).any(axis=(0, 1))) * measured.spacing[0]
    assert hertz[-1] <= HIGHEST_HZ
    assert np.all(measured.part.every >= 2.0)


def test_the_band_goes_as_far_as_it_is_asked_to_and_the_samples_reach() -> None:
    """A linear plant shows beyond 15 Hz what its state matrix says, too."""
    measured = estimate_windows(campaign(noise=0.0), INPUTS, READINGS, highest_hz=25.0)
    hertz = np.flatnonzero(used(measured).any(axis=(0, 1))) * measured.spacing[0]
    assert 24.0 < hertz[-1] <= 25.0
    found, kept = predicted(measured), used(measured)
    miss = np.abs(found - measured.harmonics[:, [measured.channel(name) for name in READINGS]])
    for c in range(2):
        size = np.sqrt(np.mean(np.abs(found[:, c][kept[:, c]]) ** 2))
        assert np.sqrt(np.mean(miss[:, c][kept[:, c]] ** 2)) < 4e-3 * size
    with pytest.raises(InputError, match="too slow for what is compared up to 25 Hz"):
        estimate_windows(_thinned(campaign(), 10), INPUTS, READINGS, highest_hz=25.0)
    with pytest.raises(InputError, match=r"up to 60 Hz.*choose it from 0\.8 to 40 Hz"):
        estimate_windows(campaign(), INPUTS, READINGS, highest_hz=60.0)


def test_without_a_standstill_the_noise_is_read_from_the_roughness_and_said_to_be() -> None:
    measured = estimate_windows(campaign(standstill=False), INPUTS, READINGS)
    assert [each.code for each in measured.warnings] == ["noise_assumed"]
    for name, sd in NOISE.items():
        assert measured.noise_sd[:, measured.channel(name)] == pytest.approx(sd, rel=0.1)


def test_a_window_with_a_gap_is_not_compared_in_that_channel() -> None:
    whole = campaign()
    road_test, still = whole.recordings
    accel = road_test.channels["body_accel"]
    gap = (accel.time > 15.0) & (accel.time < 15.5)
    holed = channel_of(accel.name, accel.time[~gap], accel.values[~gap])
    channels = dict(road_test.channels) | {"body_accel": holed}
    test = Recording(road_test.name, "road", None, channels)
    measured = estimate_windows(Campaign("made", (test, still), (), ""), INPUTS, READINGS)
    kept = used(measured).any(axis=2)
    assert kept[:, 1].all()
    assert not kept[:, 0].all()
    assert kept[:, 0].any()


def test_the_band_ends_where_it_is_asked_to() -> None:
    measured = estimate_windows(campaign(), INPUTS, READINGS, 5.0)
    hertz = np.flatnonzero(used(measured).any(axis=(0, 1))) * measured.spacing[0]
    assert 4.0 < hertz[-1] <= 5.0
    with pytest.raises(InputError, match=r"cannot be compared up to 0\.5 Hz"):
        estimate_windows(campaign(), INPUTS, READINGS, 0.5)


def test_peak_to_peak_values_of_a_road_are_refused() -> None:
    with pytest.raises(InputError, match="no peak-to-peak"):
        si.fit(si.PlantModel(si.TwoMass(), PARAMETERS), campaign(), free=("k", "c"), peak_to_peak=True)


@pytest.mark.parametrize(
    ("made", "what"),
    [
        (lambda: Campaign("made", campaign().recordings[1:], (), ""), "there is no test"),
        (lambda: _standing(campaign()), "does not move"),
        (lambda: _thinned(campaign(), 50), "too slow"),
        (lambda: _apart(campaign()), "overlap for 0 s"),
    ],
)
def test_what_cannot_be_cut_is_refused_with_what_to_do(made, what: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=what) as refused:
        estimate_windows(made(), INPUTS, READINGS)
    assert refused.value.remedy


def test_a_record_that_is_sampled_slowly_is_compared_as_far_as_it_goes_and_that_is_said() -> None:
    """At 20 Hz up to 5 Hz, with a warning; what is asked for is compared, or refused."""
    measured = estimate_windows(_thinned(campaign(noise=0.0)), INPUTS, READINGS)
    order = np.flatnonzero(measured.valid[0, measured.channel("body_accel")])
    assert measured.part is not None
    highest = order[-1] * measured.part.every[0] * measured.frequency[0]
    assert 4.7 < highest <= RATE / 25.0 / SAMPLES
    (warning,) = (each for each in measured.warnings if each.code == "compared_less")
    assert "5 Hz in place of 15 Hz" in warning.what
    with pytest.raises(InputError, match="too slow"):
        estimate_windows(_thinned(campaign()), INPUTS, READINGS, highest_hz=HIGHEST_HZ)


def _standing(given: Campaign) -> Campaign:
    test, still = given.recordings
    level = test.channels["road_height"]
    channels = dict(test.channels) | {"road_height": channel_of("road_height", level.time, 0.0 * level.time)}
    return Campaign("made", (Recording(test.name, "road", None, channels), still), (), "")


def _apart(given: Campaign) -> Campaign:
    test, still = given.recordings
    accel = test.channels["body_accel"]
    later = channel_of(accel.name, accel.time + 100.0, accel.values)
    channels = dict(test.channels) | {accel.name: later}
    return Campaign("made", (Recording(test.name, "road", None, channels), still), (), "")


def _thinned(given: Campaign, every: int = 25) -> Campaign:
    test, still = given.recordings
    channels = {
        name: channel_of(name, each.time[::every], each.values[::every])
        for name, each in test.channels.items()
    }
    return Campaign("made", (Recording(test.name, "road", None, channels), still), (), "")


@pytest.mark.slow
def test_a_channel_with_a_clock_of_its_own_is_followed_as_well() -> None:
    test, still = campaign(noise=0.0).recordings
    deflection = test.channels["susp_deflection"]
    later = deflection.time[:-1] + 0.37 / RATE
    shifted = channel_of(deflection.name, later, CubicSpline(deflection.time, deflection.values)(later))
    other = Recording(test.name, "road", None, dict(test.channels) | {deflection.name: shifted})
    measured = estimate_windows(Campaign("made", (other, still), (), ""), INPUTS, READINGS)
    found, kept = predicted(measured), used(measured)[:, 1]
    recorded = measured.harmonics[:, measured.channel(deflection.name)][kept]
    miss = np.abs(found[:, 1][kept] - recorded)
    assert np.sqrt(np.mean(miss**2)) < 4e-3 * np.sqrt(np.mean(np.abs(recorded) ** 2))


def test_the_share_is_one_inside_zero_outside_and_smooth() -> None:
    phase = np.linspace(0.0, 2.0 * np.pi, 2001)
    share = compared_share(phase, 1.0, 5.0)
    edge = 4.0 * TAPER
    assert np.all(share[(phase < 1.0) | (phase > 5.0)] == 0.0)
    assert np.all(share[(phase > 1.0 + edge) & (phase < 5.0 - edge)] == 1.0)
    assert np.max(np.abs(np.diff(share))) < 1.01 * np.pi / 2.0 / edge * (phase[1] - phase[0])


def test_many_harmonics_by_a_table_are_the_sum() -> None:
    measured = estimate_windows(campaign(noise=0.0), INPUTS, READINGS)
    excitation = measured_excitation(TwoMass(), measured, PARAMETERS)
    assert excitation.harmonics["road_height"].shape[1] > SUMMED
    mesh = uniform_mesh(layout_of(excitation, PeriodicSettings(), TwoMass()))
    ((height, rate),), _ = signals_at(TwoMass(), excitation, mesh)
    dwell, order = mesh.layout.dwell, np.arange(excitation.harmonics["road_height"].shape[1])
    some = np.arange(0, dwell.size, 97)
    amplitudes = np.asarray(excitation.harmonics["road_height"])[dwell[some]]
    waves = amplitudes * np.exp(1j * order * np.asarray(mesh.phase)[some, None])
    omega = 2.0 * np.pi * measured.frequency[dwell[some]]
    np.testing.assert_allclose(np.asarray(height)[some], waves.real.sum(axis=1), atol=1e-8)
    np.testing.assert_allclose(
        np.asarray(rate)[some], (1j * order * waves).real.sum(axis=1) * omega, atol=1e-5
    )


def test_powers_of_a_turn_are_its_exponentials() -> None:
    phase = np.random.default_rng(0).uniform(0.0, 6.0, 50)
    for orders in (0, 9, 15, 16, 40, 200):
        exact = np.exp(1j * phase[:, None] * np.arange(orders + 1))
        cosines, sines = (np.asarray(each).T for each in waves(phase, orders))
        np.testing.assert_allclose(cosines + 1j * sines, exact, atol=1e-12)


def _damped(c: float) -> si.PlantModel:
    return si.PlantModel(si.TwoMass(), PARAMETERS.with_values({"c": c}))


@pytest.mark.slow
def test_windows_begin_as_long_before_what_is_compared_as_the_plant_remembers() -> None:
    made = campaign(noise=0.0)
    usual = forgetful_response(made, _damped(2100.0), 9)
    assert _leads(usual) == pytest.approx(LEAD_S)
    # exp(-r t) of the body's motion is left, with r = c / 2 m_s (k_t / (k + k_t))^2: 0.11 after three seconds.
    ringing = _damped(700.0)
    longer = forgetful_response(made, ringing, 9)
    assert LEAD_S * 1.2 < _leads(longer) < LEAD_S * 3.0
    p = as_values(ringing.table.as_dict())
    solution = simulate_periodic(
        ringing.build(), p, measured_excitation(ringing.plant, longer, ringing.table)
    )
    assert longer.part is not None
    assert np.max(remembered(solution, longer.part.begin)) < REMEMBERED


@pytest.mark.slow
@pytest.mark.parametrize("c", [250.0, 50.0])
def test_a_road_that_a_plant_never_forgets_is_compared_from_its_beginning(c: float) -> None:
    found = forgetful_response(campaign(seconds=10.0, noise=0.0), _damped(c), 9)
    assert found.tests == ("road_c, 0.0 to 10.0 s",)
    assert found.part is not None
    assert found.part.opens.all()


def test_a_road_that_is_too_short_for_a_window_is_compared_from_its_beginning() -> None:
    found = estimate_windows(_cut(campaign(), 6.0, 10.0), INPUTS, READINGS)
    assert found.tests == ("road_c, 0.0 to 4.0 s",)
    assert found.part is not None
    assert found.part.begins_moving.tolist() == [1.0]
    assert found.part.begin.tolist() == [0.0]


def _cut(made: Campaign, begin: float, end: float) -> Campaign:
    """A campaign with its road from one instant to another [s]."""
    road, *others = made.recordings
    channels = {
        name: replace(each, time=each.time[here] - begin, values=each.values[here])
        for name, each in road.channels.items()
        if (here := (each.time >= begin) & (each.time < end)).any()
    }
    return replace(made, recordings=(replace(road, channels=channels), *others))


@pytest.mark.slow
def test_windows_that_were_cut_already_are_refused_where_the_plant_remembers() -> None:
    windows = estimate_windows(campaign(noise=0.0), INPUTS, READINGS)
    # exp(-c / 2 m_s t) of the body's motion is left after three seconds: 0.6.
    with pytest.raises(InputError, match=r"remembers [4-9]\d %"):
        forgetful_response(windows, _damped(100.0), 9)


def _leads(response: HarmonicResponse) -> float:
    assert response.part is not None
    return float(np.max(response.part.begin / (2.0 * np.pi * response.frequency)))


def rested(seconds: float) -> Campaign:
    """A road after so much rest [s]."""
    test, still = campaign(noise=0.0).recordings
    time = next(iter(test.channels.values())).time
    count = round(seconds * RATE)
    after = np.arange(time.size + count) / RATE
    values = {name: np.concatenate([np.zeros(count), each.values]) for name, each in test.channels.items()}
    return Campaign("made", (recording_of(test.name, "road", after, values), still), (), "")


def test_a_test_that_begins_at_rest_is_compared_from_its_beginning() -> None:
    before, after = (estimate_windows(made, INPUTS, READINGS) for made in (campaign(noise=0.0), rested(0.3)))
    assert before.tests[0].startswith("road_c, 3.5 to ")
    assert after.tests[0].startswith("road_c, 0.0 to ")
    assert after.tests[-1].endswith(" to 20.3 s")


@pytest.mark.slow
def test_what_is_compared_of_the_beginning_is_what_the_plant_does_there() -> None:
    measured = estimate_windows(rested(0.3), INPUTS, READINGS)
    found, kept = predicted(measured), used(measured)
    recorded = measured.harmonics[:, [measured.channel(name) for name in READINGS]]
    miss = np.abs(found - recorded)[0][kept[0]]
    assert np.sqrt(np.mean(miss**2)) < 4e-3 * np.sqrt(np.mean(np.abs(recorded[0][kept[0]]) ** 2))


@pytest.mark.slow
def test_a_fit_of_a_road_finds_what_it_was_made_with() -> None:
    model = si.PlantModel(si.TwoMass(), PARAMETERS)
    fit = si.fit(model, campaign(seconds=40.0, seed=7), free=("k", "c"))
    assert fit.trusted
    for name in ("k", "c"):
        found = fit[name]
        assert abs(found.value - PARAMETERS[name].value) < 4.0 * found.stderr
        assert found.stderr < 0.02 * found.value


@pytest.mark.slow
def test_a_diagnosis_of_a_road_of_a_true_model_finds_nothing_missing(tmp_path: Path) -> None:
    found = si.diagnose(si.PlantModel(si.TwoMass(), PARAMETERS), campaign(seed=4, noise=3.0))
    assert found.verdict.kind == "none"
    assert found.shrink.recalibrated < 1.2 * found.shrink.floor
    page = found.to_html(tmp_path / "road.html").read_text()
    assert "2 windows of tests that do not repeat" in page
    assert list(found.figure_names) == ["gap spectrum body_accel", "gap spectrum susp_deflection", "shrink"]


@pytest.mark.slow
def test_a_fit_begins_with_the_motion_by_which_windows_were_judged() -> None:
    model = _damped(2100.0)
    response, motion = forgetful_motion(campaign(noise=0.0), model, 9)
    assert motion is not None
    known, anew = (fit_least_squares(response, model, free=("c",), motion=each) for each in (motion, None))
    np.testing.assert_allclose(known.as_given, anew.as_given, rtol=1e-6, atol=1e-9)
    assert known["c"].value == pytest.approx(anew["c"].value, rel=1e-6)
