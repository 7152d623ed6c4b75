"""Strict numerics for every test, and where the data is.

JAX reads its settings from the environment at its first import: double precision, no broadcasting of unequal
ranks, no silent promotion of dtypes. Warnings are errors (pyproject.toml).
"""

import gc
import getpass
import json
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits
from xdist.remote import Producer
from xdist.scheduler import LoadScopeScheduling
from xdist.workermanage import WorkerController

from savgs_ident.plants.quarter_car.rig import Rig, default_campaign_path, default_rig_path, read_rig

# Matrices are small here: threads of the linear algebra would only take the cores from the other tests.
threadpool_limits(1, "blas")
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["JAX_ENABLE_X64"] = "1"
os.environ["JAX_NUMPY_RANK_PROMOTION"] = "raise"
os.environ["JAX_NUMPY_DTYPE_PROMOTION"] = "strict"

# Traced programs are millions of objects that stay: to search them for garbage as often as by default takes a
# twentieth of the time.
gc.set_threshold(100_000, 50, 50)

# The first example of a test compiles; a deadline would time the compiler. No database: examples that failed are
# printed, and nothing is written into the working folder.
settings.register_profile(
    "fast", max_examples=8, deadline=None, database=None, print_blob=True, derandomize=True
)
settings.register_profile("thorough", max_examples=25, deadline=None, database=None, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fast"))

# A shell that runs the tests in its background ignores Ctrl-C, and so would the programs that the tests interrupt.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

REPOSITORY = Path(__file__).resolve().parents[1]
SHARED = REPOSITORY.parent / "shared" / "data"


SCRATCH = ("SAVGS_IDENT_CACHE", "XDG_CACHE_HOME", "MPLCONFIGDIR", "HYPOTHESIS_STORAGE_DIRECTORY")
"""Variables that name folders of caches; all processes of a run share one that is removed in the end."""

ENOUGH_KEPT = 4 * 2**30
"""Size of the programs [byte] that slow tests keep from one run to the next, above which a run begins with none."""

SHARING = {
    **{folder: folder for folder in ("control", "export", "fit", "inference", "simulate")},
    **dict.fromkeys(("effects", "symbolic"), "laws"),
    **{
        f"diagnosis/test_{name}.py": "diagnoses of few dwells"
        for name in ("another_law", "background", "diagnose", "false_alarms", "intervals", "learning")
    },
    **{f"cli/test_{name}.py": "diagnoses of two dwells" for name in ("exit_codes", "false_alarms")},
}
"""Folders and modules whose tests share expensive fixtures and compiled programs, and their room: one process takes
all of it. Two that began at the same time would compile the same."""

APART = ("tests/notebooks/test_notebooks.py",)
"""Modules whose tests share nothing and take minutes: each test is a room of its own."""

LONGEST_FIRST = (
    *("diagnosis/test_whole_diagnoses.py", "notebooks"),
    *("control", "export", "effects", "symbolic", "simulate", "fit", "plants/test_contract.py"),
    *("diagnosis/test_another_law.py", "inference", "diagnosis/test_motion_problem.py"),
    *("cli/test_posterior.py", "test_public.py"),
    *("validation", "diagnosis", "test_any_plant.py", "docs", "browser", "cli"),
)
"""Folders and modules in the order in which the rooms of their tests are begun with: what is left for the end must be
short, or one process works alone. Of one folder, those of :data:`COMPILED_MORE_THAN_COMPUTED` come first: where the
way of compiling changes, all programs are lost."""

UNOPTIMISED = "--xla_backend_optimization_level=0"
"""The compiler takes half the time with it. The fast tests compile more than they compute; of the slow ones those of
:data:`COMPILED_MORE_THAN_COMPUTED` do, and the others are compiled as in use."""

COMPILED_MORE_THAN_COMPUTED = (
    *("cli", "control", "effects", "export", "fit", "plants", "simulate", "symbolic"),
    *(
        "diagnosis/test_blind_rig.py",
        "diagnosis/test_drift.py",
        "diagnosis/test_dwell_problem.py",
        "diagnosis/test_two_mass.py",
        "diagnosis/test_whole_diagnoses.py",
        "docs/test_contributing.py",
        "test_any_plant.py",
        "validation/test_foreign_draw.py",
    ),
)
"""Folders and modules of tests that run each of their programs a few times."""


def pytest_configure(config: pytest.Config) -> None:
    """Nothing is cached outside temporary folders; compiler and cores are set up before the first program."""
    if not hasattr(config, "workerinput"):
        folder = Path(tempfile.mkdtemp(prefix="savgs-ident-tests-"))
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
        os.environ.update({name: str(folder / name.lower()) for name in SCRATCH})
        flags = os.environ.get("XLA_FLAGS", "")
        if not _only_the_fast(config):
            os.environ["SAVGS_IDENT_CACHE"] = str(_kept())
        elif "optimization_level" not in flags:
            os.environ["XLA_FLAGS"] = f"{flags} {UNOPTIMISED}".strip()
    from savgs_ident.core.executor import compute_on_one_core
    from savgs_ident.simulate.program_cache import spare_the_compiler

    spare_the_compiler()
    if hasattr(config, "workerinput"):
        compute_on_one_core()


def _kept() -> Path:
    """Where the slow tests keep programs from one run to the next; the fast ones begin with none.

    Among the temporary files, and this user's alone: what is read from there runs. A program is known by all that
    shapes it, so that what a change shapes is made anew.
    """
    folder = Path(tempfile.gettempdir()) / f"savgs-ident-tests-{getpass.getuser()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.is_symlink() or folder.owner() != getpass.getuser() or folder.stat().st_mode & 0o077:
        raise pytest.UsageError(f"{folder} is not this user's alone. Remedy: remove it.")
    if sum(each.stat().st_size for each in folder.rglob("*") if each.is_file()) > ENOUGH_KEPT:
        shutil.rmtree(folder)
        folder.mkdir(mode=0o700)
    return folder


def _only_the_fast(config: pytest.Config) -> bool:
    return bool(config.getoption("markexpr") == "not slow")


@cache
def _compiled_more_than_computed(path: Path) -> bool:
    places = {REPOSITORY / "tests" / name for name in COMPILED_MORE_THAN_COMPUTED}
    return not places.isdisjoint((path, *path.parents))


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Before the fixtures of a slow test are made; how the fast ones are compiled stands in the environment."""
    if not _only_the_fast(item.config):
        import jax

        unoptimised = _compiled_more_than_computed(item.path)
        if unoptimised != jax.config.read("jax_disable_most_optimizations"):
            # A program that is there already serves on, however it was compiled.
            jax.clear_caches()
            jax.config.update("jax_disable_most_optimizations", unoptimised)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests in the order of :data:`LONGEST_FIRST`."""
    place = {REPOSITORY / "tests" / name: number for number, name in enumerate(LONGEST_FIRST)}

    @cache
    def turn(path: Path) -> tuple[int, bool]:
        folders = (path, *path.parents)
        first = next((place[each] for each in folders if each in place), len(place))
        return first, not _compiled_more_than_computed(path)

    items.sort(key=lambda item: turn(item.path))


class _Rooms(LoadScopeScheduling):
    """One process takes all tests of a module, or of a folder where these share what is expensive.

    It gets its next room when one test is left of the last, not two: until then another one may be free for it.
    """

    def _reschedule(self, node: WorkerController) -> None:
        if not self.workqueue or self._pending_of(self.assigned_work[node]) < 2:
            super()._reschedule(node)

    def _split_scope(self, nodeid: str) -> str:
        path = Path(nodeid.partition("::")[0])
        if str(path) in APART:
            return nodeid
        if path.parts[0] != "tests":
            return str(path)
        return SHARING.get(path.parts[1]) or SHARING.get("/".join(path.parts[1:]), str(path))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadScopeScheduling:
    """Where tests run in several processes, spread them by room; see LONGEST_FIRST."""
    config.option.loadscopereorder = False
    return _Rooms(config, log)


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
    """Thousands of tests in a process compile more than it can hold; a module adds a few thousand regions."""
    yield
    from savgs_ident.simulate.program_cache import make_room_for_programs

    make_room_for_programs(most=30_000, most_memory=4 * 2**30)


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


@pytest.fixture(scope="module")
def undrawn() -> Iterator[None]:
    """Figures are made and written, and nothing is painted on them: for tests of what stands beside them."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "draw", lambda self, renderer: None)
        patch.setattr(ConstrainedLayoutEngine, "execute", lambda self, figure: None)
        yield
