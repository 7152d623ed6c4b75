"""Several measured motions as one: each begins from rest, and counts as it would alone."""

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.values import as_values
from savgs_ident.inference.drive_force import force_rows
from savgs_ident.recordings.recording import RecordedChannel, Recording
from savgs_ident.responses.driven_motion import DrivenMotion, joined
from savgs_ident.responses.recorded_motion import recorded_motion, recorded_speed

STEP = 0.01
UNITS = {"position": "m", "speed": "m/s", "drive_force": "N"}


def _recording(name: str, seconds: float, hertz: float, step: float = STEP) -> Recording:
    time = np.arange(0.0, seconds, step)
    position = 0.02 * np.sin(2.0 * np.pi * hertz * time)
    speed = 0.02 * 2.0 * np.pi * hertz * np.cos(2.0 * np.pi * hertz * time)
    force = 100.0 * speed + np.random.default_rng(1).standard_normal(time.size)
    channels = {"position": position, "speed": speed, "drive_force": force}
    recorded = {each: RecordedChannel(each, UNITS[each], time, values) for each, values in channels.items()}
    return Recording(name, "other", None, recorded)


def _motion(name: str, seconds: float, hertz: float, step: float = STEP) -> DrivenMotion:
    return recorded_motion(_recording(name, seconds, hertz, step), "position", "drive_force", "tests.csv")


@pytest.mark.slow
def test_rows_and_slopes_of_several_are_those_of_each_alone() -> None:
    motions = [_motion("one", 4.0, 1.0), _motion("other", 3.0, 2.3)]
    model = si.PlantModel(si.Axis(), si.Axis.parameters) + "guide_preload"
    p, names = as_values(model.table.as_dict()), ("mass", "guide_preload_force", "k_pre")
    whole = force_rows(model.build(), p, joined(motions, "tests.csv"), names)
    alone = [force_rows(model.build(), p, each, names) for each in motions]
    assert whole.status.ok
    for found, parts in (
        (whole.rows, [each.rows for each in alone]),
        (whole.slopes, [e.slopes for e in alone]),
    ):
        expected = np.concatenate(parts)
        assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_no_block_is_of_two_tests_and_times_go_on() -> None:
    motions = [_motion("one", 4.3, 1.0), _motion("other", 3.0, 2.3)]
    both = joined(motions, "tests.csv")
    first = motions[0].row_times.size
    assert not {*both.blocks[:first]} & {*both.blocks[first:]}
    assert np.all(np.diff(both.row_times) > 0.0)
    assert both.row_times.size == both.blocks.size == sum(each.row_times.size for each in motions)
    assert [warning.code for warning in both.warnings] == list(
        dict.fromkeys(warning.code for each in motions for warning in each.warnings)
    )


def test_what_is_sampled_less_often_is_sampled_as_often() -> None:
    fine, coarse = _motion("one", 4.0, 1.0, 0.005), _motion("other", 4.0, 1.0, 0.01)
    both = joined([fine, coarse], "tests.csv")
    assert both.step == pytest.approx(0.005, rel=1e-6)
    half = both.starts[1]
    rest = min(half, both.position.size - half)
    moved = both.position[half : half + rest] - both.position[:rest]
    assert np.abs(moved).max() < 1e-3 * np.abs(both.position).max()


def test_a_speed_is_as_good_as_a_position() -> None:
    recording = _recording("run", 5.0, 1.3)
    by_position = recorded_motion(recording, "position", "drive_force", "tests.csv")
    by_speed = recorded_speed(recording, "speed", "drive_force", "tests.csv")
    inside = slice(50, -50)
    for name, bound in (("velocity", 2e-3), ("acceleration", 5e-3)):
        one, other = getattr(by_position, name)[inside], getattr(by_speed, name)[inside]
        assert np.abs(one - other).max() < bound * np.abs(one).max(), name
