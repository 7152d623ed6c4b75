"""``export`` end to end: files, record, exit codes; what a diagnosis adds and what is refused."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import Result

from savgs_ident.core.errors import InputError, SavgsIdentError
from savgs_ident.export import public
from savgs_ident.export.json_export import read_model_json
from savgs_ident.export.public import Exporter
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig, write_rig

from ..export.diagnoses import MOUNT, UNKNOWN, diagnosis

pytestmark = pytest.mark.slow


Invoke = Callable[..., Result]
RIG = default_rig_path()
SIMTR = list(MODELS["simtr"])


def _identified(**more: Any) -> Path:
    """A model.toml with a covariance, in the present folder."""
    drawing = read_rig(RIG)
    covariance = {"names": ["k_t"], "matrix": [[1e6]]}
    provenance = {"effects": SIMTR, "covariance": covariance, "trusted": True} | more
    path = Path("model.toml")
    write_rig(replace(drawing, provenance=provenance), path)
    return path


def _posterior(names: tuple[str, ...] = ("mu_r", "k_t")) -> Path:
    """Draws about the drawing, in the present folder."""
    random, table = np.random.default_rng(1), read_rig(RIG).parameters
    path = Path("posterior.nc")
    with h5py.File(path, "w") as file:
        for name in names:
            file[f"posterior/{name}"] = table[name].value * (1.0 + 0.01 * random.standard_normal((4, 200)))
    return path


def _diagnosis(document: dict[str, Any]) -> Path:
    path = Path("diagnosis.json")
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def test_files_and_record_are_written_and_reported(invoke: Invoke) -> None:
    done = invoke(
        "export", _identified(), "--to", "json", "--posterior", _posterior(), "--samples", 20, "--json"
    )
    assert done.exit_code == 0, done.stderr
    folder = Path("out/export")
    assert done.stdout == (folder / "export.json").read_text()
    assert sorted(path.name for path in folder.iterdir()) == ["export.json", "model.json"]
    record = json.loads(done.stdout)
    assert record["schema"] == 1
    assert record["model"] == "model.toml"
    assert record["files"] == ["out/export/model.json"]
    assert (record["samples"], record["covariance"], record["trusted"]) == (20, 1, True)
    model = read_model_json(folder / "model.json")
    assert model.model.rig == read_rig("model.toml")
    assert list(model.effects) == SIMTR == record["effects"]
    assert {name: values.size for name, values in model.samples.items()} == {"mu_r": 20, "k_t": 20}
    assert "writing json" in done.stderr


def test_several_formats_at_once_in_both_ways_of_saying_it(invoke: Invoke) -> None:
    for words in (("--to", "json", "python-control", "json"), ("--to", "python-control", "--to", "json")):
        done = invoke("export", RIG, *words, "--out", "o", "--json", "--quiet")
        assert done.exit_code == 0, done.stderr
        names = {Path(file).name for file in json.loads(done.stdout)["files"]}
        assert names == {"model.json", "model-control.json"}
        assert done.stderr == ""


def test_a_drawing_is_exported_with_the_model_asked_for(invoke: Invoke) -> None:
    done = invoke("export", RIG, "--to", "json", "--model", "simqc", "--out", "o")
    assert done.exit_code == 0
    assert "gt_rear: without effects" in done.stdout
    assert "no covariance, no posterior" in done.stdout
    assert read_model_json("o/model.json").effects == ()


def test_another_model_than_the_identified_one_is_reported(invoke: Invoke) -> None:
    done = invoke("export", _identified(), "--to", "json", "--model", "simqc", "--out", "o")
    assert done.exit_code == 0, done.stderr
    said = "identified with rail_coulomb and tyre_friction and is taken with no friction"
    assert said in " ".join(done.stdout.split())
    (reported,) = json.loads(Path("o/export.json").read_text())["said"]
    assert said in reported


def test_a_diagnosed_effect_joins_and_the_output_says_with_which_numbers(invoke: Invoke) -> None:
    done = invoke("export", _identified(), "--to", "json", "--diagnosis", _diagnosis(MOUNT), "--out", "o")
    assert done.exit_code == 0, done.stderr
    for words in (
        "mount_compliance = 1.65e-06 m/N",
        "2 more numbers (mu_r, k_t",
        "covariance of the rig file",
    ):
        assert words in done.stdout
    model = read_model_json("o/model.json")
    assert list(model.effects) == [*SIMTR, "mount_compliance"]
    assert model.model.rig.parameters["k_t"].value == MOUNT["identified"]["k_t"]
    assert model.diagnosis == MOUNT
    record = json.loads(Path("o/export.json").read_text())
    assert record["verdict"] == MOUNT["verdict"]
    assert model.model.rig.provenance["notes"] == record["said"]


def test_something_unknown_travels_along_as_data_and_that_is_said(invoke: Invoke) -> None:
    done = invoke("export", _identified(), "--to", "json", "--diagnosis", _diagnosis(UNKNOWN), "--out", "o")
    assert done.exit_code == 0
    assert "travels along as data, the equations are without it" in " ".join(done.stdout.split())
    model = read_model_json("o/model.json")
    assert list(model.effects) == SIMTR
    assert model.diagnosis == UNKNOWN


def test_a_diagnosed_drawing_takes_the_model_that_was_diagnosed(invoke: Invoke) -> None:
    document = diagnosis(
        "effect", ["rail_viscous"], ["rail"],
        baseline={"model": "simqc", "parameters": {}, "effects": []},
        which=[{"effect": "rail_viscous", "parameters": {"rail_viscous_damping": {"value": 50.0, "unit": "N s/m"}}}],
    )  # fmt: skip
    done = invoke("export", RIG, "--to", "json", "--diagnosis", _diagnosis(document), "--out", "o")
    assert done.exit_code == 0, done.stderr
    assert read_model_json("o/model.json").effects == ("rail_viscous",)


def test_a_posterior_of_the_model_without_the_effect_is_code_1(invoke: Invoke) -> None:
    words = ("--posterior", _posterior(), "--diagnosis", _diagnosis(MOUNT))
    done = invoke("export", _identified(), "--to", "json", *words, "--out", "o", "--quiet")
    assert done.exit_code == 1
    assert done.stdout == ""
    assert done.stderr.startswith(
        "Not to be trusted: posterior.nc is the posterior of a model without mount_compl"
    )
    assert Path("o/model.json").exists()
    record = json.loads(Path("o/export.json").read_text())
    assert not record["trusted"]
    assert record["doubts"]


def test_a_fit_that_was_not_trusted_is_code_1(invoke: Invoke) -> None:
    done = invoke("export", _identified(trusted=False), "--to", "json", "--quiet")
    assert done.exit_code == 1
    assert "own fit is not to be trusted" in done.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("none.toml", "--to", "json"), "none.toml: cannot be read"),
        ((RIG, "--to", "xlsx"), "--to: there is no format 'xlsx'. Remedy: choose among: json, mat"),
        ((RIG, "--to", "json", "--posterior", "none.nc"), "none.nc: cannot be read"),
        ((RIG, "--to", "json", "--posterior", RIG), "gt_rear.toml: cannot be read"),
        ((RIG, "--to", "json", "--diagnosis", "none.json"), "none.json: cannot be read"),
        ((RIG, "--to", "json", "--diagnosis", RIG), "gt_rear.toml: is not such JSON"),
    ],
)
def test_files_and_formats_that_are_none_are_code_2_in_one_line(
    invoke: Invoke, words: tuple[object, ...], said: str
) -> None:
    done = invoke("export", *words)
    assert done.exit_code == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert said in line
    assert "Remedy: " in line


def test_a_diagnosis_of_another_model_is_code_2_and_names_its_file(invoke: Invoke) -> None:
    words = ("--model", "simqc", "--diagnosis", _diagnosis(MOUNT))
    done = invoke("export", RIG, "--to", "json", *words)
    assert done.exit_code == 2
    assert done.stderr.startswith("Error: diagnosis.json: is of a model with rail_coulomb and tyre_friction")


def test_a_covariance_that_is_none_is_code_2(invoke: Invoke) -> None:
    path = _identified(covariance={"names": ["k_t", "nobody"], "matrix": [[1.0]]})
    done = invoke("export", path, "--to", "mat")
    assert done.exit_code == 2
    assert "model.toml: provenance.covariance.names[1] is 'nobody'" in done.stderr


def test_a_rig_that_finds_no_rest_is_code_2_and_names_its_file(invoke: Invoke) -> None:
    drawing = read_rig(RIG)
    write_rig(replace(drawing, parameters=drawing.parameters.with_values({"k_sd": 2e3})), Path("soft.toml"))
    done = invoke("export", "soft.toml", "--to", "casadi", "--quiet")
    assert done.exit_code == 2
    assert done.stderr.startswith(
        "Error: soft.toml: the plant finds no rest in its nominal state (link angle 1.571 rad)"
    )
    assert not list(Path("out/export").iterdir())


@pytest.mark.parametrize("words", [(RIG,), (RIG, "--to", "json", "--samples", "0"), ("--to", "json")])
def test_bad_usage_is_code_2(invoke: Invoke, words: tuple[object, ...]) -> None:
    done = invoke("export", *words)
    assert done.exit_code == 2
    assert "Traceback" not in done.stderr


def test_a_folder_that_cannot_be_is_code_2(invoke: Invoke) -> None:
    Path("taken").write_text("")
    done = invoke("export", RIG, "--to", "json", "--out", "taken")
    assert done.exit_code == 2
    assert "taken: cannot be written" in done.stderr


@pytest.mark.parametrize(
    ("raised", "said"),
    [
        (
            SavgsIdentError("no rule for 'sort'"),
            "--to json: no rule for 'sort'. Remedy: leave this format out.",
        ),
        (
            InputError("no compiler", source="--to fmu", remedy="install one"),
            "--to fmu: no compiler. Remedy: install",
        ),
    ],
)
def test_a_format_that_cannot_hold_the_model_is_code_2(
    invoke: Invoke, monkeypatch: pytest.MonkeyPatch, raised: Exception, said: str
) -> None:
    def fails(*args: object) -> tuple[Path, ...]:
        raise raised

    monkeypatch.setattr(public, "EXPORTS", {"json": Exporter("", fails)})
    done = invoke("export", RIG, "--to", "json", "--quiet")
    assert done.exit_code == 2
    assert said in done.stderr


def test_the_help_names_every_format(invoke: Invoke) -> None:
    reported = " ".join(invoke("export", "--help").output.split())
    for name in public.EXPORTS:
        assert name in reported


def test_the_help_says_what_becomes_of_something_unknown(invoke: Invoke) -> None:
    reported = " ".join(invoke("export", "--help").output.split())
    assert "so does the force that it learned for something unknown" in reported
