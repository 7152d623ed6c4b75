"""The posterior's figures from its processes: what is run in which order, and what is made of how it ended."""

import json
from collections.abc import Sequence

import pytest

from benchmarks import posterior_process
from benchmarks.posterior_process import measure_posterior, outcome_of
from benchmarks.processes import Ran
from savgs_ident.inference.sample import SAMPLERS


def _output(ess: float, reasons: Sequence[str] = ()) -> str:
    return json.dumps({"ess_min": ess, "reasons": reasons})


class _Processes:
    """Stands in for processes: remembers what was asked, with the exit code of each sampler's runs."""

    def __init__(self, codes: dict[str, int]) -> None:
        self.codes, self.asked = codes, []

    def __call__(self, arguments: Sequence[str]) -> Ran:
        self.asked.append(list(arguments))
        if "fit" in arguments:
            return Ran(11.0, 500.0, 0, "")
        sampler, target = (arguments[arguments.index(name) + 1] for name in ("--sampler", "--target-ess"))
        seconds = {"emcee": 40.0, "nuts": 50.0}[sampler] if float(target) > 1.0 else 300.0
        return Ran(seconds, 700.0, self.codes[sampler], _output(1.2 * float(target)))


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> _Processes:
    stand_in = _Processes({"emcee": 0, "nuts": 0})
    monkeypatch.setattr(posterior_process, "run_process", stand_in)
    return stand_in


def test_draws_count_over_the_whole_process_that_found_its_programs_on_disk(processes: _Processes) -> None:
    outcome = measure_posterior(1000.0, lambda line: None)
    assert dict(outcome.figures) == pytest.approx(
        {"posterior_ess_per_s_emcee": 30.0, "posterior_ess_per_s_nuts": 24.0, "posterior_wall_s": 50.0}
    )
    fit, *sampling = processes.asked
    assert fit[2] == "fit"
    assert fit[fit.index("--out") + 1] in sampling[0][3]
    assert [
        (each[each.index("--sampler") + 1], each[each.index("--target-ess") + 1]) for each in sampling
    ] == [(sampler, target) for sampler in SAMPLERS for target in ("1.0", "1000.0")]


def test_a_sampler_that_did_not_run_has_no_figure(processes: _Processes) -> None:
    processes.codes["nuts"] = 2
    outcome = measure_posterior(1000.0, lambda line: None)
    assert set(outcome.figures) == {"posterior_ess_per_s_emcee"}
    assert any("nuts ended with exit code 2" in note for note in outcome.notes)


def test_a_run_that_does_not_vouch_for_itself_says_why() -> None:
    outcome = outcome_of("nuts", Ran(600.0, 700.0, 1, _output(300.0, ["the chains disagree"])))
    assert dict(outcome.figures) == pytest.approx({"posterior_ess_per_s_nuts": 0.5})
    assert any("the chains disagree" in note for note in outcome.notes)
