"""What is wrong with input or usage is said in a sentence, with exit code 2 and before any long work."""

import errno
from pathlib import Path

import pytest

from savgs_ident.plants.quarter_car.catalogue import EFFECTS
from savgs_ident.plants.quarter_car.rig import default_rig_path
from savgs_ident.report import presenters


def flat(text: str) -> str:
    return " ".join(text.replace("│", " ").split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("fit", "{campaign}", "--free", "mu_x"), "there is no parameter 'mu_x'. Remedy: choose among:"),
        (("fit", "{campaign}", "--model", "simxx"), "'simxx' is not one of 'simqc', 'simtr'"),
        (("fit", "{campaign}", "--orders", "0"), "Invalid value for '--orders'"),
        (("fit", "{campaign}", "--rig", "none.toml"), "none.toml: cannot be read"),
        (("fit", "{campaign}", "--max-frequency", "0.1"), "no dwell is at 0.1 Hz or below"),
        (("fit", "{campaign}", "--channels", "none.toml"), "none.toml: cannot be read"),
        (("fit",), "Missing argument 'CAMPAIGN'"),
        (("inspect", "{rig}"), "gt_rear.toml"),
        (("inspect", "{folder}"), "the folder holds no campaign"),
        (("bode", "{campaign}", "{campaign}"), "is not valid TOML"),
        (("simulate", "{rig}", "--sweep", "--frequency", "2"), "choose one of --frequency, --sweep"),
        (("simulate", "{rig}", "--frequency", "-1"), "give a frequency above 0 Hz"),
        (("simulate", "{rig}", "--frequency", "nan"), "give a frequency above 0 Hz"),
        (("simulate", "{rig}", "--frequency", "fast"), "Invalid value for '--frequency'"),
        (("simulate", "none.toml"), "none.toml: cannot be read"),
        (("diagnose", "{campaign}", "--without", "rail_stribek"), "there is no effect 'rail_stribek'"),
        (("diagnose", "{campaign}", "--without", "tyre_friction"), "'tyre_friction' is part of the baseline"),
        (("diagnose", "{campaign}", "--max-frequency", "0.1"), "no dwell is at 0.1 Hz or below"),
        (("diagnose", "{campaign}", "--rig", "none.toml"), "none.toml: cannot be read"),
        (("diagnose", "none.csv"), "none.csv"),
        (("false-alarms", "{campaign}", "--draws", "0"), "Invalid value for '--draws'"),
        (("false-alarms", "{campaign}", "--rig", "none.toml"), "none.toml: cannot be read"),
        (("blind", "--rig", "none.toml"), "none.toml: cannot be read"),
        (("blind", "--shares", "1", "2", "3", "-4"), "shares"),
        (("nonsense",), "No such command 'nonsense'"),
    ],
)  # fmt: skip
def test_bad_input_is_code_2_with_a_reason(
    invoke, short_campaign: Path, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    (tmp_path / "empty").mkdir()
    places = {"campaign": short_campaign, "rig": default_rig_path(), "folder": tmp_path / "empty"}
    done = invoke(*(word.format(**places) for word in words))
    assert done.exit_code == 2
    assert said in flat(done.stderr)
    assert done.stdout == ""
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["inspect", "fit"])
def test_a_file_in_place_of_the_output_folder(
    invoke, short_campaign: Path, tmp_path: Path, command: str
) -> None:
    (tmp_path / "taken").write_text("mine")
    done = invoke(command, short_campaign, "--out", tmp_path / "taken")
    assert done.exit_code == 2
    assert "cannot be written" in flat(done.stderr)
    assert "--out DIR" in flat(done.stderr)
    assert (tmp_path / "taken").read_text() == "mine"


def test_a_full_disk_is_said(
    invoke, short_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, record: object) -> Path:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    monkeypatch.setattr(presenters, "write_json", full)
    done = invoke("inspect", short_campaign, "--out", tmp_path / "o")
    assert done.exit_code == 2
    assert "inspect.json: No space left on device" in flat(done.stderr)
    assert "Traceback" not in done.stderr


def test_effects_that_nobody_knows_are_refused(invoke, tmp_path: Path) -> None:
    text = default_rig_path().read_text() + '\n[provenance]\neffects = ["rail_coulomb", "[bold]magic[/]"]\n'
    (tmp_path / "model.toml").write_text(text)
    done = invoke("simulate", "model.toml", "--frequency", "2")
    assert done.exit_code == 2
    assert "'[bold]magic[/]'" in flat(done.stderr)
    assert f"list known effects: {', '.join(sorted(EFFECTS))}." in flat(done.stderr)


def test_markup_in_a_path_is_shown_as_it_is(invoke) -> None:
    done = invoke("inspect", "[bold red]run[/bold red].csv")
    assert done.exit_code == 2
    assert "[bold red]run[/bold red].csv: does not exist" in flat(done.stderr)
