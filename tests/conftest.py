"""Strict numerics for every test, and where the data is.

JAX reads its settings from the environment at its first import: double precision, no broadcasting of unequal
ranks, no silent promotion of dtypes. Warnings are errors (pyproject.toml).
"""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

from savgs_ident.core.rig import Rig, default_campaign_path, default_rig_path, read_rig

# Matrices are small here: threads of the linear algebra would only take the cores from the other tests.
threadpool_limits(1, "blas")
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["JAX_ENABLE_X64"] = "1"
os.environ["JAX_NUMPY_RANK_PROMOTION"] = "raise"
os.environ["JAX_NUMPY_DTYPE_PROMOTION"] = "strict"

# The first example of a test compiles; a deadline would time the compiler. CI has a profile of its own.
settings.register_profile("unhurried", deadline=None)
if "CI" not in os.environ:
    settings.load_profile("unhurried")

# A shell that runs the tests in its background ignores Ctrl-C, and so would the programs that the tests interrupt.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

REPOSITORY = Path(__file__).resolve().parents[1]
SHARED = REPOSITORY.parent / "shared" / "data"


def pytest_configure() -> None:
    """Have the compiler as users have it, twice as fast: later than here, the first program may be compiled."""
    from savgs_ident.simulate.compilation import spare_the_compiler

    spare_the_compiler()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line where reports were not opened in a browser, because there is none: a green run must not hide it."""
    reasons = [str(report.longrepr) for report in terminalreporter.stats.get("skipped", [])]
    left_out = sum("no browser" in reason for reason in reasons)
    if left_out:
        terminalreporter.write_line(
            f"{left_out} browser tests were LEFT OUT: chromium or chromedriver was not found"
        )


@pytest.fixture(scope="module", autouse=True)
def room_for_programs() -> Iterator[None]:
    """Thousands of tests in a process compile more than it can hold."""
    yield
    from savgs_ident.simulate.compilation import make_room_for_programs

    make_room_for_programs()


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recordings beside the repository; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip(f"needs the recordings in {SHARED}")
    return SHARED


@pytest.fixture(scope="session")
def shared_rig(shared_data: Path) -> Path:
    """The folder with the recordings of the rig and its data sheets."""
    return shared_data / "rig"


@pytest.fixture(scope="session")
def shared_mcap(shared_data: Path) -> Path:
    """The folder with MCAP files that others recorded."""
    return shared_data / "real" / "mcap"


@pytest.fixture(scope="session")
def rig_sheet(shared_rig: Path) -> dict[str, Any]:
    """The data sheet of the rig."""
    sheet: dict[str, Any] = json.loads((shared_rig / "rig_sheet.json").read_text())
    return sheet


@pytest.fixture(scope="session")
def nominal_campaign() -> Path:
    """The campaign that is shipped with the package."""
    return default_campaign_path()


@pytest.fixture(scope="session")
def rig() -> Rig:
    """The rig that is shipped with the package."""
    return read_rig(default_rig_path())
