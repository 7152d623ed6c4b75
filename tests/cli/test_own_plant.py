"""A plant of one's own from the command line: the page of the documentation, followed to the letter."""

import json
import shutil
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from click.testing import Result

from .installed import Installed

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SERVO, DAMPER = EXAMPLES / "servo", EXAMPLES / "damper"


def test_a_fit_is_written_as_it_is_shown_and_code_1_where_the_model_lacks_something(
    as_users_have_it: Callable[[Sequence[str]], Result], tmp_path: Path
) -> None:
    words = ["fit", str(DAMPER / "stroke.csv.gz"), "--plant", str(DAMPER / "damper.py")]
    done = as_users_have_it([*words, "--with", "cell_offset", "--json", "--quiet", "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert done.stdout == (tmp_path / "fit.json").read_text()
    record = json.loads(done.stdout)
    assert record["converged"]
    assert not record["trusted"]
    assert "diagnose" in done.stderr
    # The friction of its seals is missing, and the damping makes up for a part of it.
    assert record["parameters"]["c"]["value"] > 600.0
    kept = tomllib.loads((tmp_path / "model.toml").read_text())
    assert kept["parameters"]["c"]["value"] == record["parameters"]["c"]["value"]


@pytest.mark.slow
def test_the_shipped_example_is_checked_fitted_sampled_and_diagnosed(installed: Installed) -> None:
    for name in ("servo.py", "tests.csv.gz"):
        shutil.copy(SERVO / name, installed.folder)
    plant, tests = ("--plant", "servo.py"), "tests.csv.gz"

    def ended(code: int, *words: str) -> dict[str, object]:
        done = installed.run(*words, "--json", "--quiet")
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return dict(json.loads(done.stdout))

    assert ended(0, "check-plant", "servo.py")["findings"] == []
    assert len(ended(0, "inspect", tests, *plant)["dwells"]) == 10  # type: ignore[arg-type]
    ended(1, "fit", tests, *plant)
    verdict: dict[str, object] = ended(0, "diagnose", tests, *plant)["verdict"]  # type: ignore[assignment]
    assert verdict["ports"] == ["bearing"]
    assert verdict["families"] == ["bearing/friction"]
    assert verdict["effects"] == ["bearing_preload"]
    found: dict[str, dict[str, float]] = ended(0, "fit", tests, *plant, "--with", "bearing_preload")[
        "parameters"
    ]  # type: ignore[assignment]
    for name, truth in {"bearing_preload_force": 0.012, "J": 0.00213, "d": 0.0023, "L": 0.0062}.items():
        assert abs(found[name]["value"] - truth) < 4.0 * found[name]["stderr"], name
    words = ("posterior", "out/fit/model.toml", tests, *plant, "--sampler", "nuts", "--target-ess", "200")
    sampled = ended(0, *words)
    drawn: dict[str, float] = sampled["parameters"]["bearing_preload_force"]  # type: ignore[index]
    assert drawn["median"] == pytest.approx(found["bearing_preload_force"]["value"], abs=3.0 * drawn["sd"])
