"""The contract of all formats: what is said to be written is written, whole, and nothing else."""

import importlib
import shutil
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.export import public
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.public import EXPORTS
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over

HERE = Path(__file__).parent


def _write(name: str, model: ExportedModel, folder: Path) -> tuple[Path, ...]:
    """Write a format; where an FMU cannot be compiled, the test is skipped."""
    if name == "fmu" and (find_spec("fmpy") is None or shutil.which("gcc") is None):
        pytest.skip("needs FMPy and gcc")
    return EXPORTS[name].write(model, folder)


COMPILED = ("casadi", "c", "fmu", "mat", "python-control")
"""Formats that take long, and whose own tests write them anyway."""


@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=pytest.mark.slow if each in COMPILED else ()) for each in EXPORTS]
)
def test_every_format_writes_the_files_that_it_says_and_nothing_else(
    name: str, model: ExportedModel, tmp_path: Path
) -> None:
    files = _write(name, model, tmp_path)
    assert files
    assert sorted(files) == sorted(tmp_path.iterdir())
    assert all(file.stat().st_size > 0 for file in files)


@pytest.mark.parametrize("name", EXPORTS)
def test_a_folder_that_is_not_there_is_an_input_error(
    name: str, model: ExportedModel, tmp_path: Path
) -> None:
    with pytest.raises(InputError):
        EXPORTS[name].write(model, tmp_path / "none")


@over("name", EXPORTS)
def test_every_format_has_a_test_of_its_own_numbers(name: str) -> None:
    assert (HERE / f"test_{name.replace('-', '_')}_export.py").is_file()


@over("name", EXPORTS)
def test_every_format_says_what_it_is(name: str) -> None:
    assert EXPORTS[name].about


def test_a_package_that_is_not_there_stands_in_the_way_of_no_other_format(
    monkeypatch: pytest.MonkeyPatch, model: ExportedModel, tmp_path: Path
) -> None:
    def lacking(name: str) -> object:
        if name.endswith("mat_export"):
            raise ImportError("no such package")
        return importlib.import_module(name)

    monkeypatch.setattr(public, "import_module", lacking)
    assert EXPORTS["json"].write(model, tmp_path)
    with pytest.raises(ImportError):
        EXPORTS["mat"].write(model, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) for name in EXPORTS if name != "json"]
)
def test_a_rig_that_finds_no_rest_is_refused_before_anything_is_written(
    name: str, rig: Rig, tmp_path: Path
) -> None:
    # model.json alone says nothing of a rest.
    soft = replace(rig, parameters=rig.parameters.with_values({"k_sd": 2e3}))
    with pytest.raises(
        InputError,
        match=r"no rest in its nominal state \(link angle 1\.571 rad\), .*Remedy: .*its spring",
    ):
        _write(name, ExportedModel(RigModel(soft, MODELS["simtr"])), tmp_path)
    assert not list(tmp_path.iterdir())
