"""The harness finds what it looks for, every loader stands its first inputs, and no loader is forgotten."""

import ast
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import pytest

from fuzz import __main__ as command
from fuzz import trial
from fuzz.loader import Form, Loader, Original
from fuzz.outcome import Kind, Outcome
from fuzz.pool import Batch, run_side_by_side
from fuzz.registry import LOADERS
from fuzz.report import count, page
from fuzz.trial import classify, input_of, original_of, place, run_trial
from savgs_ident.core.errors import InputError

from ..in_one_test import over
from ..relaxed import as_users_have_it

PACKAGE = Path(__file__).resolve().parents[2] / "savgs_ident"
INPUTS, SEED = 30, 2

PARSERS = (
    "json.loads", "json.load", "tomllib.loads", "tomllib.load", "h5py.File", "pd.read_csv", "pd.read_parquet",
    "np.loadtxt", "np.genfromtxt", "np.load", "pickle.loads", "pickle.load", "csv.reader", "zlib.decompressobj",
    "zlib.decompress", "gzip.open", "gzip.decompress", "zstandard.ZstdDecompressor", "lz4.frame.LZ4FrameDecompressor",
    "export.deserialize", "HDFBackend", "xr.open_dataset", "xr.open_datatree", "loadmat", "struct.unpack_from",
    "ElementTree.parse", "pq.read_table", "tomlkit.parse", "tomlkit.loads", "yaml.safe_load", "sqlite3.connect",
)  # fmt: skip
"""Calls that make something of the content of a file."""

NO_DATA = {
    "validation.blind_trial.diagnose_folder": "reads back what it has just written, in memory",
    "validation.blind_like.LikeBench.trial": "reads back what it has just written, in memory",
    "export.public.diagnosis_document": "reads back what it has just written, in memory",
    "inference.samplers.nuts.save_state": "writes",
    "inference.samplers.chains.Checkpoint.publish": "writes to the scratch file of its own run",
    "inference.samplers.emcee.sample_by_emcee": "goes on from what open_checkpoint took, as chain-emcee reads it",
    "simulate.program_cache._read": "a program of the cache, kept with its digest",
}
"""Functions with such a call that read no file of a user's."""


@pytest.fixture(scope="module", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with as_users_have_it():
        yield


def _planted(read: Callable[[Path], object], form: Form = Form.json) -> Loader:
    good = b'{"a": {"b": [1, 2, 3.5]}, "c": "text"}'
    return Loader("planted", "a planted fault", "planted.json", form, lambda: Original((good,)), read, ())


def _raises_key_error(path: Path) -> object:
    return {}[path]


def _gives_nan(path: Path) -> object:
    return {"a": [1.0, float("nan")]}


def _refuses_in_two_lines(path: Path) -> object:
    error = InputError("is bad", source=path)
    error.args = (f"{path}: is\nbad",)
    raise error


def _refuses_without_the_file(path: Path) -> object:
    raise InputError("is bad")


def _takes_memory(path: Path) -> object:
    return bytearray(5 << 25) and None


def _warns(path: Path) -> object:
    import warnings

    warnings.warn("overflow", RuntimeWarning, stacklevel=1)
    return 1.0


@pytest.mark.parametrize(
    ("read", "said"),
    [
        (_raises_key_error, "KeyError"),
        (_gives_nan, "accepted although what was read['a'][1] is nan"),
        (_refuses_in_two_lines, "not one line"),
        (_refuses_without_the_file, "does not name the file"),
        (_takes_memory, "MiB of memory"),
        (_warns, "warns: RuntimeWarning"),
    ],
)
def test_a_planted_fault_is_found(
    read: Callable[[Path], object], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "MEMORY", 1 << 27)
    if read is _takes_memory and not Path("/proc/self/clear_refs").exists():
        pytest.skip("the system does not say the memory of a process")
    outcome = run_trial(_planted(read), SEED, 0, tmp_path)
    assert outcome.kind is Kind.failed
    assert said in outcome.reason


def test_a_loader_that_does_not_end_is_stopped(tmp_path: Path) -> None:
    def never_ends(path: Path) -> object:
        while True:
            pass

    outcome = run_trial(_planted(never_ends), SEED, 0, tmp_path, seconds=0.2)
    assert outcome.kind is Kind.failed
    assert "takes more than" in outcome.reason


@pytest.mark.slow
@over("name", LOADERS)
def test_the_same_number_is_the_same_input(name: str) -> None:
    inputs = [input_of(LOADERS[name], SEED, number) for number in (1, 2, 3, 4)]
    assert inputs == [input_of(LOADERS[name], SEED, number) for number in (1, 2, 3, 4)]
    assert len({each.content for each in inputs}) > 1


def _called(work: Callable[[], object]) -> set[str]:
    """The functions of the package that ``work`` calls, as the registry names them."""
    found = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        module = frame.f_globals.get("__name__", "")
        if event == "call" and module.startswith("savgs_ident."):
            found.add(f"{module.removeprefix('savgs_ident.')}.{frame.f_code.co_qualname}")

    sys.setprofile(note)
    threading.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return found


@over("name", LOADERS)
def test_a_good_file_is_read_by_the_functions_that_it_is_to_cover(name: str, tmp_path: Path) -> None:
    loader, called = LOADERS[name], set()
    for number, content in enumerate(original_of(loader).contents):
        folder = tmp_path / name / str(number)
        path = place(loader, content, folder)
        assert classify(loader, path) == (Kind.read, "", "")
        called |= _called(lambda path=path: loader.read(path))
    assert set(loader.covers) <= called


@pytest.mark.parametrize("name", LOADERS)
def test_damaged_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    outcomes = []
    for number in range(INPUTS):
        folder = tmp_path / str(number)
        folder.mkdir()
        outcomes.append(run_trial(LOADERS[name], SEED, number, folder))
    assert [(each.number, each.reason) for each in outcomes if each.kind is Kind.failed] == []
    assert any(each.kind is Kind.refused for each in outcomes)


@pytest.mark.slow
def test_a_process_that_ends_costs_one_input(tmp_path: Path) -> None:
    batches = [Batch("no such loader", (7,)), Batch("weights", (0, 1, 2))]
    outcomes = list(run_side_by_side(batches, SEED, 2, tmp_path))
    lost = [each for each in outcomes if each.kind is Kind.failed]
    assert [(each.loader, each.number) for each in lost] == [("no such loader", 7)]
    assert "ends its process" in lost[0].reason
    assert sorted(each.number for each in outcomes if each.loader == "weights") == [0, 1, 2]


def test_the_command_says_failures_by_its_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def reported(*arguments: object) -> Iterator[Outcome]:
        yield Outcome("csv", 3, Kind.failed, "truncate", "KeyError: 'a'")
        yield Outcome("csv", 4, Kind.read)

    monkeypatch.setattr(command, "run_side_by_side", reported)
    page_file = tmp_path / "fuzzing.md"
    assert command.main(["--count", "2", "--only", "csv", "--out", str(page_file)]) == 1
    assert "csv 3: KeyError: 'a'" in capsys.readouterr().out
    assert "| csv | campaign as a table | CSV | 2 | 1 | 0 | 1 |" in page_file.read_text("utf-8")


def _parsing(source: str) -> Iterator[str]:
    """Qualified names of the functions in a module that call a parser."""

    def walk(node: ast.AST, within: tuple[str, ...]) -> Iterator[str]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Call) and ast.unparse(child.func) in PARSERS:
                yield ".".join(within)
            named = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
            yield from walk(child, (*within, child.name) if named else within)

    yield from walk(ast.parse(source), ())


def test_no_function_that_reads_files_is_forgotten() -> None:
    found = {
        ".".join((*path.relative_to(PACKAGE).with_suffix("").parts, name))
        for path in PACKAGE.rglob("*.py")
        for name in _parsing(path.read_text("utf-8"))
    }
    covered = {name for loader in LOADERS.values() for name in loader.covers}
    assert sorted(found - covered - set(NO_DATA)) == []
    assert sorted(set(NO_DATA) - found) == []


def test_a_new_function_that_reads_files_is_seen() -> None:
    source = "class A:\n    def read(self, path):\n        return json.loads(path.read_text())\n"
    assert list(_parsing(source)) == ["A.read"]
    assert list(_parsing("def f():\n    return json.dumps(1)\n")) == []


def test_the_page_has_a_row_for_every_loader_that_ran(tmp_path: Path) -> None:
    outcomes = [run_trial(LOADERS["weights"], SEED, number, tmp_path) for number in range(5)]
    text = page(count(outcomes), "python -m fuzz")
    assert "| weights | weights.toml of a design | TOML | 5 |" in text
    assert "Together 5 inputs" in text
