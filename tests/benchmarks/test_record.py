"""The benchmarks' table and record: contract keys, ratios, and that nothing measured is left out."""

import json
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import __main__ as program
from benchmarks.figures import FIGURES
from benchmarks.outcome import Outcome
from benchmarks.suite import NAMES, Size, posterior_speedup, run_suite, speedups
from benchmarks.table import make_table
from benchmarks.task import DWELLS_HZ, QUICK_HZ

CONTRACT = (
    "response_ms_per_frequency",
    "response_warm_ms_per_frequency",
    "gradient_over_value",
    "speedup_harmonicbalance",
    "speedup_scipy",
    "speedup_diffrax",
    "fit_cold_s",
    "fit_cached_s",
    "fit_peak_mb",
    "posterior_ess_per_s_emcee",
    "posterior_ess_per_s_nuts",
    "posterior_wall_s",
    "mcap_samples_per_s",
    "mcap_peak_mb",
)


def test_every_figure_of_the_contract_is_explained() -> None:
    assert set(CONTRACT) <= set(FIGURES)
    assert all(figure.meaning.endswith(".") for figure in FIGURES.values())


def test_speedups_are_ratios_to_the_cold_start() -> None:
    figures = {
        "response_ms_per_frequency": 10.0,
        "response_warm_ms_per_frequency": 2.0,
        "gradient_over_value_cold": 1.25,
        "scipy_ms_per_frequency": 400.0,
    }
    assert speedups(figures) == pytest.approx({"speedup_scipy": 40.0, "speedup_gradient_scipy": 160.0})


def test_speedup_of_the_posterior_is_a_ratio_of_draws_per_second() -> None:
    """Of the same posterior: a peer that sampled fewer dwells than our processes did is not compared."""
    figures = {"posterior_ess_per_s_emcee": 25.0, "posterior_ess_per_s_nuts": 20.0}
    assert posterior_speedup(figures, DWELLS_HZ) == {}
    both = figures | {"posterior_ess_per_s_scipy": 5e-5}
    assert posterior_speedup(both, DWELLS_HZ) == pytest.approx({"speedup_posterior_scipy": 5e5})
    assert posterior_speedup(both, QUICK_HZ) == {}


def test_what_is_asked_for_runs_with_what_it_is_compared_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """The posterior's peer brings the package's own processes along, and nothing else."""

    def stands_in(place: str, name: str, outcome: Outcome) -> None:
        monkeypatch.setattr(f"benchmarks.{place}.{name}", lambda *size: outcome)

    stands_in("posterior_process", "measure_posterior", Outcome({"posterior_ess_per_s_emcee": 20.0}))
    stands_in("posterior_by_scipy", "measure", Outcome({"posterior_ess_per_s_scipy": 0.5}))
    stands_in("cross_check", "measure", Outcome({"collocation_s": 30.0}))
    wanted = {"posterior": 1, "posterior-scipy": 3, "collocation": 1}
    for name, count in wanted.items():
        figures = run_suite((name,), program.FULL, lambda line: None).figures
        assert len(figures) == count
    assert run_suite(tuple(wanted), program.FULL, lambda line: None).figures == {
        "posterior_ess_per_s_emcee": 20.0,
        "posterior_ess_per_s_scipy": 0.5,
        "speedup_posterior_scipy": 40.0,
        "collocation_s": 30.0,
    }


def test_outcomes_add_up() -> None:
    total = Outcome({"a": 1.0}, ("one",)) + Outcome({"b": 2.0}, ("two",))
    assert (dict(total.figures), total.notes) == ({"a": 1.0, "b": 2.0}, ("one", "two"))


def test_table_shows_every_figure_with_its_meaning_and_the_notes() -> None:
    figures = dict.fromkeys(FIGURES, 1234.5)
    console = Console(width=200, record=True, file=StringIO())
    console.print(make_table(figures, ("a note",), {"machine_cores": 2.0}))
    text = console.export_text()
    for key, figure in FIGURES.items():
        (line,) = (each for each in text.splitlines() if each.split()[:1] == [key])
        assert format(1234.5, figure.shown) in line
        assert figure.meaning in line
    assert "a note" in text
    assert "cores 2.0" in text


def test_record_is_flat_and_holds_what_was_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked: list[tuple[tuple[str, ...], Size]] = []

    def run(names: tuple[str, ...], size: Size, progress: object) -> Outcome:
        asked.append((tuple(names), size))
        return Outcome({"mcap_peak_mb": 123.0}, ("short",))

    monkeypatch.setattr(program, "run_suite", run)
    file = tmp_path / "figures.json"
    program.main(["--quick", "--only", "mcap", "fit", "--json", str(file)])
    record = json.loads(file.read_text())
    assert asked == [(("mcap", "fit"), program.QUICK)]
    assert record["mcap_peak_mb"] == 123.0
    assert all(isinstance(value, str | float | int) for value in record.values())
    assert "mcap_peak_mb" in capsys.readouterr().out


def test_everything_runs_unless_asked_otherwise(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(program, "run_suite", lambda *each: asked.append(each[:2]) or Outcome())
    program.main([])
    assert asked == [(NAMES, program.FULL)]


def test_unknown_benchmark_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as raised:
        program.main(["--only", "nothing"])
    assert raised.value.code == 2
    assert "nothing" in capsys.readouterr().err
