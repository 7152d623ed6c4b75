"""Which constants are varied by new fits, and what is counted of them."""

import json
from dataclasses import asdict, fields
from pathlib import Path

import pytest

from benchmarks.refits import GROUPS, LEFT_OUT, Refit, table_of, variations
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.validation.varied_constants import VARIED
from tests.diagnosis.blind_answers import answer, diagnosis


def test_every_constant_is_varied_in_one_way_or_left_out_for_a_reason() -> None:
    named = [*VARIED, *(name for group in (*GROUPS.values(), *LEFT_OUT.values()) for name in group)]
    assert sorted(named) == sorted(each.name for each in fields(DEFAULTS))


def test_a_group_moves_together_and_what_is_counted_stays_whole() -> None:
    half, double = (each.applied() for each in variations() if each.name == "effort")
    assert (half.first_fits, half.further_fits, half.resonance_peaks) == (1, 2, 2)
    assert (double.first_fits, double.parents, double.resonance_peaks) == (4, 4, 6)
    assert half.amplitude_width == DEFAULTS.amplitude_width
    assert all(getattr(each.applied(), name) >= 1 for each in variations() for name in GROUPS["effort"])


def test_a_group_is_taken_apart_one_constant_at_a_time() -> None:
    apart = variations(["widths of effects"])
    assert [(each.name, each.factor) for each in apart] == [
        ("amplitude_width", 0.5),
        ("amplitude_width", 2.0),
        ("shape_width", 0.5),
        ("shape_width", 2.0),
    ]
    assert apart[1].applied().amplitude_width == pytest.approx(2.0 * DEFAULTS.amplitude_width)
    assert apart[1].applied().shape_width == DEFAULTS.shape_width


def test_verdicts_that_move_are_counted_and_told(tmp_path: Path) -> None:
    truths = {"trial_0001": answer("effect", "accel_lag"), "trial_0002": answer("none", number=2)}
    said = {"trial_0001": diagnosis("effect", "accel_lag"), "trial_0002": diagnosis("none")}
    for name, truth in truths.items():
        folder = tmp_path / name
        folder.mkdir()
        (folder / "answer.json").write_text(json.dumps({"answer": asdict(truth), "salt": "00"}))
        (folder / "diagnosis.json").write_text(json.dumps(said[name]))
    other = diagnosis("effect", "rail_viscous")
    refits = [
        Refit(0, "trial_0001", "gates", 0.5, other),
        Refit(1, "trial_0002", "gates", 0.5, said["trial_0002"]),
        Refit(2, "trial_0001", "gates", 2.0, said["trial_0001"]),
        Refit(3, "trial_0002", "gates", 2.0, said["trial_0002"]),
    ]
    lines = table_of(tmp_path, refits)
    assert lines[0].startswith("as they are: named_right 1/1, located_right 1/1, false_alarms 0/1")
    assert lines[1].startswith("gates x 0.5: 1 of 2 move; named_right 0/1")
    assert lines[2] == "    trial 1, accel_lag: accel_lag -> rail_viscous"
    assert lines[3].startswith("gates x 2: 0 of 2 move; named_right 1/1")
    assert len(lines) == 4
