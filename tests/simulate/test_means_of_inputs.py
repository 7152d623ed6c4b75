"""A second input whose level matters, as the current of a coil: it counts, that of a road does not."""

from dataclasses import replace

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.plants.at_rest import carried_along
from savgs_ident.plants.axis import Axis
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording
from savgs_ident.responses.windows import estimate_windows
from savgs_ident.simulate.compared_tests import measured_response
from savgs_ident.simulate.excitation import means_that_count, measured_excitation
from savgs_ident.validation.check_plant import check_plant

RATE, HEIGHT = 200.0, 0.2
TRUTH = {"m": 60.0, "k": 8000.0, "c_0": 430.0, "c_1": 600.0}


class Seat(si.StateSpacePlant):
    """A mass over a base that moves, on a damper that hardens with its current."""

    states_declared = (
        si.State("z", "m", 0.01, "height"),
        si.State("v", "m/s", 0.1, "speed", rate_of="z"),
    )
    inputs = (
        si.Input("base", "m", "base", moves=(1.0,)),
        si.Input("current", "A", "current", moves=(5e-3,)),
    )
    channels = (si.Channel("stroke", "m", "stroke"),)
    ports = ()
    parameters = si.ParameterTable(
        (
            si.Parameter("m", 60.0, "kg", tolerance=0.6, lower=1.0, about="mass"),
            si.Parameter("k", 7500.0, "N/m", lower=10.0, upper=1e5, about="spring"),
            si.Parameter("c_0", 500.0, "N s/m", lower=0.0, upper=1e4, about="damping without current"),
            si.Parameter("c_1", 400.0, "N s/(m A)", lower=0.0, upper=1e4, about="damping by the current"),
        )
    )

    def rhs(self, x, u, p, f):  # type: ignore[no-untyped-def]
        """Acceleration."""
        damping = p["c_0"] + p["c_1"] * u.current
        return {"v": -(p["k"] * (x.z - u.base) + damping * (x.v - u.base_rate)) / p["m"]}

    def output(self, x, dx, u, p):  # type: ignore[no-untyped-def]
        """The stroke."""
        return (x.z - u.base,)


def dwell(frequency: float, current: float, seed: int = 0) -> Recording:
    """A dwell on a plate that lies at a height, by the transfer function that it has with a constant current."""
    time, random = np.arange(round(12.0 * RATE)) / RATE, np.random.default_rng(seed)
    omega, damping = 2.0 * np.pi * frequency, TRUTH["c_0"] + TRUTH["c_1"] * current
    stiff = TRUTH["k"] + 1j * omega * damping
    stroke = stiff / (stiff - TRUTH["m"] * omega**2) - 1.0
    moving = 0.004 * np.exp(1j * omega * time)
    values = {
        "base": HEIGHT + moving.real,
        "current": current + 3e-3 * random.standard_normal(time.size),
        "stroke": (stroke * moving).real + 2e-5 * random.standard_normal(time.size),
    }
    units = {"current": "A"}
    channels = {
        name: RecordedChannel(name, units.get(name, "m"), time, each) for name, each in values.items()
    }
    return Recording(f"dwell_{frequency:g}Hz_{current:g}A", "dwell", frequency, channels)


def campaign() -> Campaign:
    tests = [dwell(hertz, amps) for hertz in (1.0, 1.8, 3.1) for amps in (0.0, 0.5)]
    return Campaign("made", tuple(tests), (), "", layout())


def layout() -> si.RecordingLayout:
    return si.PlantModel(Seat(), Seat.parameters).layout


def test_what_a_plant_moves_along_with_has_no_mean_that_counts() -> None:
    values = as_values(Seat.parameters.as_dict())
    assert carried_along(Seat(), values) == (True, False)
    assert means_that_count(Seat(), Seat.parameters) == (False, True)
    assert carried_along(TwoMass(), as_values(PARAMETERS.as_dict())) == (True,)
    assert carried_along(Axis(), as_values(Axis.parameters.as_dict())) == (False,)
    measured = measured_response(campaign(), Seat(), 5)
    excitation = measured_excitation(Seat(), measured, Seat.parameters)
    levels = dict(zip(measured.tests, np.asarray(excitation.harmonics["current"][:, 0]).real, strict=True))
    assert all(abs(level - float(name.split("_")[2][:-1])) < 1e-3 for name, level in levels.items())
    assert not np.any(np.asarray(excitation.harmonics["base"][:, 0]))


def test_a_fit_finds_what_the_level_of_an_input_does() -> None:
    fit = si.fit(si.PlantModel(Seat(), Seat.parameters), campaign())
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 4.0 * fit[name].stderr, name
        assert fit[name].stderr < 0.05 * true


def test_tests_that_lack_an_input_which_others_have_are_left_out_and_named() -> None:
    """They would be compared as if it had been zero."""
    given = campaign()
    lacking = tuple(
        replace(each, channels={name: one for name, one in each.channels.items() if name != "current"})
        if each.name.endswith("0.5A")
        else each
        for each in given.recordings
    )
    some = replace(given, recordings=lacking)
    (warning,) = (each for check in given.layout.checks for each in check(some.recordings, "made"))
    assert warning.code == "input_not_recorded"
    assert warning.channel == "current"
    assert "2 more of 6" in warning.what
    assert not [each for check in given.layout.checks for each in check(given.recordings, "made")]
    measured = measured_response(some, Seat(), 5)
    assert sorted(measured.tests) == sorted(each.name for each in lacking if "current" in each.channels)
    none = replace(given, recordings=tuple(each for each in lacking if "current" not in each.channels))
    with pytest.raises(InputError, match="current was not recorded"):
        measured_excitation(Seat(), measured_response(none, Seat(), 5), Seat.parameters)


def test_check_plant_looks_at_what_does_something_at_a_level_of_a_second_input_only() -> None:
    found = check_plant(si.PlantModel(Seat(), Seat.parameters))
    assert not [each.what for each in found.findings if "moves nothing" in each.what]


def test_windows_keep_the_level_of_an_input_too() -> None:
    time = np.arange(round(20.0 * RATE)) / RATE
    base = 0.002 * np.sin(2.0 * np.pi * np.cumsum(np.linspace(0.5, 6.0, time.size)) / RATE)
    values = {"base": HEIGHT + base, "current": np.full(time.size, 0.5), "stroke": base}
    channels = {
        name: RecordedChannel(name, "A" if name == "current" else "m", time, each)
        for name, each in values.items()
    }
    made = Campaign("made", (Recording("road", "road", None, channels),), (), "")
    measured = estimate_windows(made, ("base", "current"), ("stroke",))
    excitation = measured_excitation(Seat(), measured, Seat.parameters)
    np.testing.assert_allclose(np.asarray(excitation.harmonics["current"][:, 0]), 0.5, rtol=1e-6)
    assert not np.any(np.asarray(excitation.harmonics["base"][:, 0]))


def test_a_plan_holds_a_second_input_at_levels_where_that_tells_something() -> None:
    model = si.PlantModel(Seat(), Seat.parameters)
    noise = {"stroke": 2e-5}
    found = si.plan(model, free=("c_0", "c_1"), tests=4, noise=noise)
    assert found.trusted
    assert {level for each in found.tests for level in each.programme.levels.values()} <= {1.0, 2.0}
    assert any(each.programme.levels for each in found.tests)
    without = si.plan(model, free=("c_0", "c_1"), tests=4, noise=noise, levels={})
    assert without.errors["c_1"] > 30.0 * found.errors["c_1"], (
        "without a current nothing is known of what it does"
    )
    with pytest.raises(InputError, match="no further input 'volts'"):
        si.plan(model, free=("c_0",), levels={"volts": (1.0,)})


def test_dwells_are_simulated_at_a_level() -> None:
    """By the damping that they have there, from the transfer function."""
    model = si.PlantModel(Seat(), Seat.parameters)
    p, omega = Seat.parameters.as_dict(), 2.0 * np.pi * 2.0
    found = si.simulate(model, (2.0,), amplitude=0.004, levels={"current": 0.5})
    stiff = p["k"] + 1j * omega * (p["c_0"] + 0.5 * p["c_1"])
    stroke = 0.004 * (stiff / (stiff - p["m"] * omega**2) - 1.0)
    assert found.harmonics[0, 0, 1] == pytest.approx(stroke, rel=1e-3)
    with pytest.raises(InputError, match="no input 'base'"):
        si.simulate(model, (2.0,), levels={"base": 0.1})
