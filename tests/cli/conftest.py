"""The program as its users run it: as a process of its own, and in this one where that is enough."""

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd
import pytest
from click.testing import Result
from typer.testing import CliRunner

from savgs_ident.cli.app import app
from savgs_ident.cli.options import spread_values

from .. import relaxed
from .campaign_fakes import DAY, MONDAY, campaign_file
from .installed import Installed

REPOSITORY = Path(__file__).resolve().parents[2]
Program = Callable[..., "subprocess.CompletedProcess[str]"]
Invoke = Callable[..., Result]

COMMAND = (sys.executable, "-m", "savgs_ident.cli")


@pytest.fixture(scope="session")
def cache() -> Path:
    """Where compiled programs are kept during the tests, instead of in the user's folder; see tests/conftest.py."""
    return Path(os.environ["SAVGS_IDENT_CACHE"])


@pytest.fixture(scope="session")
def environment(cache: Path) -> dict[str, str]:
    """The environment of the program: the package importable from anywhere, JAX as it is outside of tests, but that
    programs which run a few times each are compiled in half the time."""
    outside = {name: value for name, value in os.environ.items() if not name.startswith("JAX_")}
    return outside | {
        "PYTHONPATH": str(REPOSITORY),
        "SAVGS_IDENT_CACHE": str(cache),
        "COLUMNS": "100",
        "JAX_DISABLE_MOST_OPTIMIZATIONS": "1",
    }


@pytest.fixture
def program(tmp_path: Path, environment: dict[str, str]) -> Program:
    """Run ``savgs-ident`` with some words, in an empty folder."""

    def run(*words: object) -> "subprocess.CompletedProcess[str]":
        command = [*COMMAND, *(str(word) for word in words)]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300, check=False
        )

    return run


@pytest.fixture
def installed(tmp_path: Path, environment: dict[str, str]) -> Installed:
    """The installed program, in an empty folder."""
    return Installed(tmp_path, environment)


@pytest.fixture(scope="session")
def as_users_have_it() -> Callable[[Sequence[str]], Result]:
    """Run ``savgs-ident`` with some words in this process, with JAX as it is outside of tests."""

    def run(words: Sequence[str]) -> Result:
        with relaxed.as_users_have_it():
            return CliRunner().invoke(app, spread_values(words), catch_exceptions=False)

    return run


@pytest.fixture
def invoke(
    tmp_path: Path,
    cache: Path,
    monkeypatch: pytest.MonkeyPatch,
    as_users_have_it: Callable[[Sequence[str]], Result],
) -> Invoke:
    """Run ``savgs-ident`` with some words in this process, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SAVGS_IDENT_CACHE", str(cache))
    monkeypatch.setenv("COLUMNS", "100")

    def run(*words: object) -> Result:
        return as_users_have_it([str(word) for word in words])

    return run


@pytest.fixture
def inside(invoke: Invoke) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """The same with the outcome of a process: for what does not depend on there being one."""

    def run(*words: object) -> "subprocess.CompletedProcess[str]":
        done = invoke(*words)
        return subprocess.CompletedProcess(words, done.exit_code, done.stdout, done.stderr)

    return run


@pytest.fixture(scope="session")
def short_campaign(nominal_campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four dwells and the standstill of the shipped campaign."""
    table = pd.read_csv(nominal_campaign)
    kept = ("dwell_1.40Hz", "dwell_2.35Hz", "dwell_4.00Hz", "dwell_6.00Hz", "standstill")
    path = tmp_path_factory.mktemp("short") / "short.csv"
    table[table["test"].isin(kept)].to_csv(path, index=False)
    return path


@pytest.fixture
def week(tmp_path: Path) -> Path:
    """A folder of eight campaigns on eight days, mu_r growing by 0.2 a day; files named against the order of time."""
    for day in range(8):
        campaign_file(tmp_path / "week" / f"run{10 - day}.csv", 3.0 + 0.2 * day, MONDAY + day * DAY)
    return tmp_path / "week"
