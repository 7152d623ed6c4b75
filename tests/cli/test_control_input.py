"""``linearise`` and ``design`` with input that cannot be used: a sentence and exit code 2, before any long work."""

from collections.abc import Callable
from pathlib import Path

import h5py
import pytest
from click.testing import Result

from savgs_ident.plants.quarter_car.rig import default_rig_path

Invoke = Callable[..., Result]
RIG = default_rig_path()


def _written(name: str, text: str) -> Path:
    path = Path(name)
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('accel = { value = 2.0, unit = "m/s^2" }', "there is no weight 'accel'"),
        ('accel_bound = { value = 2.0, unit = "g" }', "accel_bound is no number in 'm/s^2'"),
        ("accel_bound = 2.0", "accel_bound is no value with a unit"),
        ('accel_bound = { value = -2.0, unit = "m/s^2" }', "lies outside its bounds"),
        ("accel_bound =", "is not valid TOML"),
    ],
)
def test_weights_that_are_none_are_code_2_in_one_line(invoke: Invoke, text: str, said: str) -> None:
    done = invoke("design", RIG, "--weights", _written("weights.toml", text))
    assert done.exit_code == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert line.startswith("Error: weights.toml: ")
    assert said in line


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("design", "none.toml"), "none.toml: cannot be read"),
        (("linearise", "none.toml"), "none.toml: cannot be read"),
        (("design", RIG, "--weights", "none.toml"), "none.toml: cannot be read"),
        (("design", RIG, "--posterior", "none.nc"), "none.nc: cannot be read"),
        (("design", RIG, "--posterior", RIG), "gt_rear.toml: cannot be read"),
        (("design", RIG, "--rigs", "1", "--order", "40", "--quiet"), "cannot be reduced to 40"),
    ],
)
def test_files_and_orders_that_are_none_are_code_2_in_one_line(
    invoke: Invoke, words: tuple[object, ...], said: str
) -> None:
    done = invoke(*words)
    assert done.exit_code == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert said in line
    assert "Remedy: " in line


@pytest.mark.parametrize("words", [("--rate", "nan"), ("--rate", "1"), ("--rigs", "0"), ("--order", "0")])
def test_numbers_out_of_range_are_bad_usage(invoke: Invoke, words: tuple[str, str]) -> None:
    done = invoke("design", RIG, *words)
    assert done.exit_code == 2
    assert words[0] in done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_without_draws_is_no_posterior(invoke: Invoke) -> None:
    with h5py.File("empty.nc", "w") as file:
        file.create_group("something")
    done = invoke("design", RIG, "--posterior", "empty.nc")
    assert done.exit_code == 2
    assert "empty.nc: is no posterior" in done.stderr
