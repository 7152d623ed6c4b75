"""Draws of campaigns with nothing missing, through the program: kept, continued, refused."""

import json
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.validation.false_alarms import read_draw
from savgs_ident.validation.trials import known_trials, marks_of

from .conftest import Program

RIG = read_rig(default_rig_path())

DRAWS = ("false-alarms", "--max-frequency", "2.5", "--orders", "3", "--quiet", "--out", "o")
"""Dwells and orders as in :mod:`.test_exit_codes`: the programs are the same."""


@pytest.mark.parametrize("edited", ["rig file", "campaign", "channel map"])
def test_draws_from_files_that_were_edited_are_refused(edited: str, tmp_path: Path) -> None:
    files = {name: tmp_path / name for name in ("rig file", "campaign", "channel map")}
    for path in files.values():
        path.write_text("as it was")
    kept = tmp_path / "draws.jsonl"

    def marks() -> dict[str, object]:
        content = files["rig file"].read_bytes()
        rig = replace(RIG, source=str(files["rig file"]), sha256=sha256(content).hexdigest())
        return marks_of(RigModel(rig), files["campaign"], files["channel map"]) | {"seed": 1}

    kept.write_text(json.dumps(marks()) + "\n")
    assert known_trials(kept, marks(), read_draw) == []
    files[edited].write_text("as it is")
    with pytest.raises(InputError, match=f"holds trials of another state of the {edited}. Remedy"):
        known_trials(kept, marks(), read_draw)


@pytest.mark.slow
def test_draws_are_kept_gone_on_with_and_counted(
    program: Program, inside: Program, short_campaign: Path, tmp_path: Path
) -> None:
    first = program(*DRAWS, short_campaign, "--draws", "1")
    assert first.returncode == 0, first.stderr
    lines = (tmp_path / "o" / "draws.jsonl").read_text().splitlines()
    assert len(lines) == 2
    again = inside(*DRAWS, short_campaign, "--draws", "2", "--resume", "--json")
    assert again.returncode == 0, again.stderr
    record = json.loads(again.stdout)
    assert record == json.loads((tmp_path / "o" / "false_alarms.json").read_text())
    assert (record["drawn"], record["alarms"]) == (2, 0)
    assert (tmp_path / "o" / "draws.jsonl").read_text().splitlines()[:2] == lines
    assert (tmp_path / "o" / "false_alarms.png").stat().st_size > 10_000
    other = inside(*DRAWS, short_campaign, "--resume", "--seed", "2")
    assert other.returncode == 2
    assert "holds trials of another seed" in other.stderr
