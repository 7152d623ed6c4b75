"""Tests that do not repeat, as `inspect` shows them: sizes and spectra are those of what was recorded."""

from collections.abc import Mapping
from math import sqrt

import numpy as np
import pytest
from numpy.typing import NDArray

import savgs_ident as si
from savgs_ident.recordings.recording import Campaign, RecordedChannel, Recording, TestKind
from savgs_ident.report.campaigns.motions import motion_records, motions_figure, moving_tests

RATE, LENGTH_S, RMS, HERTZ = 200.0, 60.0, 2e-3, 7.0
KINDS: Mapping[str, TestKind] = {"road": "road", "step": "step", "standstill": "standstill"}


def _road(values: NDArray[np.float64]) -> RecordedChannel:
    return RecordedChannel("road_height", "m", np.arange(values.size) / RATE, values)


def _campaign(scale: float = 1.0) -> Campaign:
    """A road with a sine in it, a step, and a standstill; ``scale`` is what the road was multiplied by."""
    time = np.arange(int(LENGTH_S * RATE)) / RATE
    road = scale * (0.01 + sqrt(2.0) * RMS * np.sin(2.0 * np.pi * HERTZ * time))
    tests = {"road": road, "step": np.where(time[:2000] < 5.0, 0.0, scale * RMS), "standstill": 0.0 * road}
    recordings = tuple(
        Recording(name, kind, None, {"road_height": _road(tests[name])}) for name, kind in KINDS.items()
    )
    layout = si.load_plant("two_mass").layout
    return Campaign("tests.csv", recordings, (), "", layout)


def test_sizes_are_those_about_the_mean() -> None:
    road, step = motion_records(_campaign())
    assert (road["test"], step["kind"]) == ("road", "step")
    assert road["channels"] == {
        "road_height": {
            "unit": "m",
            "mean": pytest.approx(0.01, rel=1e-9),
            "rms": pytest.approx(RMS, rel=1e-9),
            "largest": pytest.approx(sqrt(2.0) * RMS, rel=1e-2),
        }
    }


def test_the_spectrum_has_the_power_of_the_signal_where_it_is() -> None:
    campaign = _campaign()
    figure = motions_figure(campaign)
    course, spectrum = figure.axes[:2]
    assert course.get_ylabel().endswith("[mm]")
    assert spectrum.get_ylabel() == "[mm/√Hz]"
    line = next(each for each in spectrum.get_lines() if each.get_label() == "road")
    frequency, density = (np.asarray(each, np.float64) for each in line.get_data())
    assert frequency[np.argmax(density)] == pytest.approx(HERTZ, abs=0.1)
    near = np.abs(frequency - HERTZ) < 0.5
    power = np.sum(density[near] ** 2) * (frequency[1] - frequency[0])
    assert sqrt(power) == pytest.approx(1e3 * RMS, rel=0.01)


def test_a_standstill_is_no_motion_and_the_longest_test_comes_first() -> None:
    assert [each.name for each in moving_tests(_campaign())] == ["road", "step"]


@pytest.mark.parametrize(("scale", "said"), [(1.0, False), (1e3, True), (1e-4, True)])
def test_an_input_in_another_unit_is_said_to_be_implausible(scale: float, said: bool) -> None:
    campaign = _campaign(scale)
    check = campaign.layout.checks[0]
    found = check(campaign.recordings, campaign.source)
    assert [each.code for each in found] == ["implausible_unit"] * said
    if said:
        assert found[0].channel == "road_height"
        assert "0.01 m" in str(found[0])
