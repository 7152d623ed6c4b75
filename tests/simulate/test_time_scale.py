"""A plant that is so many times as fast, or as slow, on a road as fast: the same numbers, on its time scale."""

from dataclasses import replace

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.effects.effect import typical_effect
from savgs_ident.effects.laws.attached_oscillator import AttachedOscillator
from savgs_ident.effects.laws.lag import Lag
from savgs_ident.plants import time_scale
from savgs_ident.plants.time_scale import natural_frequencies, time_scale_of
from savgs_ident.plants.two_mass import GUIDE, PARAMETERS, SENSORS, TwoMass
from savgs_ident.recordings.checks_signal import DataLocation, check_time
from savgs_ident.recordings.recording import SLOWEST_HZ, Campaign, Recording
from savgs_ident.simulate.compared_tests import measured_response
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.forgetting import forgetful_motion
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics
from tests.simulate.linear_roads import INPUTS, READINGS, campaign, channel_of, dwell

POWERS = {"kg": -2, "N s/m": -1, "m/s^2": 2, "m/s": 1}
"""By which power of its speed a number changes where lengths and forces stay."""


def quicker(times: float) -> ParameterTable:
    """The numbers of a plant that moves the same way so many times as fast."""

    def changed(each: si.Parameter) -> si.Parameter:
        by = times ** POWERS.get(each.unit, 0)
        return replace(
            each,
            value=by * each.value,
            tolerance=by * each.tolerance,
            lower=by * each.lower,
            upper=by * each.upper,
        )

    return ParameterTable(tuple(changed(each) for each in PARAMETERS.entries))


def played(given: Campaign, times: float) -> Campaign:
    """Recordings of that plant on a road that it passes so many times as fast."""

    def changed(test: Recording) -> Recording:
        channels = {
            name: channel_of(
                name, each.time / times, each.values * (times**2 if name == "body_accel" else 1.0)
            )
            for name, each in test.channels.items()
        }
        return replace(test, channels=channels)

    return replace(given, recordings=tuple(changed(each) for each in given.recordings))


@pytest.mark.parametrize("times", [0.01, 0.1, 1.0, 7.3, 300.0])
def test_natural_frequencies_come_to_lie_where_those_of_a_quarter_car_do(times: float) -> None:
    known = natural_frequencies(TwoMass(), PARAMETERS.as_dict())
    k, kt, ms, mu = (PARAMETERS[name].value for name in ("k", "k_t", "m_s", "m_u"))
    squares = np.linalg.eigvals(np.array([[k / ms, -k / ms], [-k / mu, (k + kt) / mu]]))
    np.testing.assert_allclose(known, np.sort(np.sqrt(squares)) / (2.0 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(
        natural_frequencies(TwoMass(), quicker(times).as_dict()), times * known, rtol=1e-9
    )
    scale = time_scale_of(TwoMass(), quicker(times).as_dict())
    fastest = times * known[-1] * scale
    assert np.log2(scale) == round(np.log2(scale))
    if time_scale.SLOWEST_HZ <= times * known[-1] <= time_scale.FASTEST_HZ:
        assert scale == 1.0
    elif scale < 1.0:
        assert 0.5 * time_scale.FASTEST_HZ < fastest <= time_scale.FASTEST_HZ
    else:
        assert time_scale.SLOW_HZ <= fastest < 2.0 * time_scale.SLOW_HZ


def test_a_stiff_part_does_not_hide_what_swings_slowly() -> None:
    """A body at 2.2 Hz on a tyre that hardly gives: 230 Hz."""
    stiff = PARAMETERS.as_dict() | {"k_t": 1e8}
    slow, fast = natural_frequencies(TwoMass(), stiff)
    assert slow < 2.5
    assert fast > 200.0
    scale = time_scale_of(TwoMass(), stiff)
    assert scale == 0.5
    assert slow * scale > time_scale.BODY_HZ


def test_a_plant_that_swings_nowhere_or_whose_equations_fail_has_a_scale_of_one() -> None:
    limp = quicker(1.0).with_values({"k": 0.0, "k_t": 0.0})
    assert time_scale_of(TwoMass(), limp.as_dict()) == 1.0
    assert time_scale_of(TwoMass(), PARAMETERS.as_dict() | {"m_s": 0.0}) == 1.0

    class Broken(TwoMass):
        def evaluate(self, *given, **named):  # type: ignore[no-untyped-def]
            raise ZeroDivisionError

    assert si.PlantModel(Broken(), PARAMETERS).plant.time_scale == 1.0


@pytest.mark.parametrize(("times", "apart"), [(8.0, 1e-9), (1.0 / 64.0, 5e-3)])
def test_a_road_that_is_so_many_times_as_fast_gives_the_same_windows_and_motions(
    times: float, apart: float
) -> None:
    """Through a friction that sticks, by powers of two: numbers differ by rounding alone.

    On the slow road an elimination takes other pivots, and the search ends on other nodes, with another truncation.
    """
    slow = si.PlantModel(TwoMass(), PARAMETERS) + "guide_coulomb"
    fast = si.PlantModel(TwoMass(), quicker(times)) + "guide_coulomb"
    exact = replace(fast, plant=replace(fast.plant, time_scale=1.0 / times))
    plain = campaign(seconds=9.0, noise=0.3)
    (seen, before), (found, after) = (
        forgetful_motion(each, model, 9) for each, model in ((plain, slow), (played(plain, times), exact))
    )
    assert before is not None
    assert after is not None
    assert all(each.ok for each in after.status())
    np.testing.assert_allclose(found.frequency, times * seen.frequency, rtol=1e-12)
    np.testing.assert_array_equal(found.valid, seen.valid)
    for name, by in zip((*INPUTS, *READINGS), (1.0, times**2, 1.0), strict=True):
        c = seen.channel(name)
        scale = np.max(np.abs(seen.harmonics[:, c]))
        np.testing.assert_allclose(found.harmonics[:, c] / by, seen.harmonics[:, c], atol=1e-9 * scale)
    known, moved = (
        np.asarray(harmonics(model.build(), as_values(model.table.as_dict()), each, 150))
        for model, each in ((slow, before), (exact, after))
    )
    for c, by in enumerate((times**2, 1.0)):
        assert np.linalg.norm(moved[:, c] / by - known[:, c]) < apart * np.linalg.norm(known[:, c])


def test_a_dwell_that_is_so_many_times_as_fast_has_the_same_nodes() -> None:
    times = 16.0
    given = Campaign("made", tuple(dwell(each, 1) for each in (0.9, 3.0)), (), "")
    fast = Campaign(
        "made",
        tuple(
            replace(each, frequency_hz=times * (each.frequency_hz or 0.0))
            for each in played(given, times).recordings
        ),
        (),
        "",
    )
    counts = []
    for measured, table, scale in ((given, PARAMETERS, 1.0), (fast, quicker(times), 1.0 / times)):
        plant = TwoMass(time_scale=scale)
        response = measured_response(measured, plant, 9)
        solution = simulate_periodic(
            plant, as_values(table.as_dict()), measured_excitation(plant, response, table)
        )
        counts.append((solution.mesh.layout.counts, np.asarray(solution.mesh.phase)))
    assert counts[0][0] == counts[1][0]
    np.testing.assert_allclose(counts[0][1], counts[1][1], atol=1e-6)


def test_a_slow_plant_may_be_sampled_as_slowly_and_a_fast_one_no_faster() -> None:
    slow, usual, fast = (
        si.PlantModel(TwoMass(), quicker(each)).layout.slowest_hz for each in (0.02, 1.0, 50.0)
    )
    assert usual == fast == SLOWEST_HZ
    assert slow == SLOWEST_HZ / 16.0
    time = np.arange(400) * 4.0
    channel = channel_of("road_height", time, np.sin(0.01 * time))
    place = DataLocation("made", "road", "road_height")
    assert check_time(channel, place, slowest_hz=slow)[0] is channel
    with pytest.raises(si.InputError, match="4 s apart"):
        check_time(channel, place)


@pytest.mark.parametrize("scale", [0.25, 8.0])
def test_laws_have_their_times_on_the_time_scale_of_their_port(scale: float) -> None:
    swings = [
        typical_effect("swings", replace(GUIDE, time_scale=each), AttachedOscillator())
        for each in (1.0, scale)
    ]
    usual, other = (np.array([each["swings_frequency"] for each in effect.tried]) for effect in swings)
    np.testing.assert_allclose(other * scale, usual, rtol=1e-12)
    late = [
        ParameterTable(typical_effect("late", replace(SENSORS[0], time_scale=each), Lag()).parameters)
        for each in (1.0, scale)
    ]
    assert late[1]["late_time"].value == pytest.approx(scale * late[0]["late_time"].value)
    assert late[1]["late_time"].upper == pytest.approx(scale * late[0]["late_time"].upper)
