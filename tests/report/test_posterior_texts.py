"""Page, record and terminal text say the numbers of the posterior, its failure first, and hostile names as text."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jinja2 import UndefinedError
from rich.console import Console

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.files import to_json
from savgs_ident.core.presentation import Origin
from savgs_ident.inference.result import HarmonicPosterior
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.recordings.recording import Campaign
from savgs_ident.report.html import render_page
from savgs_ident.report.posterior.page import posterior_html
from savgs_ident.report.posterior.record import posterior_record
from savgs_ident.report.posterior.text import checks, posterior_text, predictive_sentence, shift_in_sd
from savgs_ident.report.text import DASH

from .page_reader import HOSTILE, Reader
from .posterior_synthetic import SENTENCES, nominal_response, renamed, synthetic_posterior, unconverged

pytestmark = pytest.mark.usefixtures("undrawn")

ORIGIN = Origin(
    ("savgs-ident", "posterior", "m & m.toml"), "runs/a<b>.csv", "ab" * 32, "m & m.toml", {"savgs-ident": "0.1.0"},
    (DataWarning("odd", "something", test="dwell_2"),),
)  # fmt: skip


@pytest.fixture(scope="module")
def posterior(nominal_campaign: Path) -> HarmonicPosterior:
    return synthetic_posterior(nominal_response(nominal_campaign), length=400)


@pytest.fixture(scope="module")
def source(posterior: HarmonicPosterior) -> str:
    return posterior_html(posterior, ORIGIN)


@pytest.fixture(scope="module")
def page(source: str) -> Reader:
    return Reader(source)


def rendered(posterior: HarmonicPosterior, width: int = 100) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, highlight=False).print(posterior_text(posterior))
    return stream.getvalue()


def record_of(posterior: HarmonicPosterior) -> dict[str, Any]:
    return dict(json.loads(to_json(posterior_record(posterior, ORIGIN))))


def test_the_page_has_its_sections_in_order(page: Reader) -> None:
    sections = [attributes["id"] for tag, attributes in page.tags if tag == "section"]
    assert sections == [
        "summary", "parameters", "pairs", "chains", "profiles", "prediction", "convergence", "origin"
    ]  # fmt: skip
    assert not any(tag in ("script", "iframe", "object") for tag, _ in page.tags)
    for _, attributes in page.tags:
        for name in ("src", "href", "action", "data"):
            assert (attributes.get(name) or "#").startswith(("data:", "#")), "the page fetches something"


def test_the_page_says_numbers_sentences_and_origin(posterior: HarmonicPosterior, page: Reader) -> None:
    text = " ".join(page.texts)
    damping = posterior.by_name["c_sd"]
    numbers = (f"{damping.median:.0f}", f"{damping.q025:.0f} to {damping.q975:.0f}", "99.5 %")
    for part in (*SENTENCES, *numbers, "N s/m", "runs/a<b>.csv", "ab" * 32, "m & m.toml", "[odd]"):
        assert part in text
    assert "Not converged" not in text


def test_a_posterior_that_did_not_converge_says_so_first_and_hostile_names_stay_text(
    posterior: HarmonicPosterior,
) -> None:
    named = renamed(replace(posterior, sentences=(HOSTILE,)), HOSTILE, HOSTILE, HOSTILE)
    failed = unconverged(named, "the chains do not agree", "Too few draws.")
    page = Reader(posterior_html(failed, replace(ORIGIN, data=HOSTILE)))
    assert page.texts[:3] == [
        "Not converged: these numbers must not be used.",
        "The chains do not agree.",
        "Too few draws.",
    ]
    assert (
        sum(HOSTILE.replace("\x1b", "\\x1b").replace("\u202e", "\\u202e") in text for text in page.texts) >= 5
    )
    assert not any(tag == "script" for tag, _ in page.tags)
    reported = rendered(failed, width=200)
    assert reported.splitlines()[:3] == [page.texts[0], f"- {page.texts[1]}", f"- {page.texts[2]}"]
    assert "[bold red]\\x1b[2J" in reported


def test_that_the_model_does_not_explain_the_data_is_said_first(posterior: HarmonicPosterior) -> None:
    missed = tuple(
        replace(each, q025=0.02, median=0.03, q975=0.05) if each.name == "discrepancy" else each
        for each in posterior.marginals
    )
    unexplained = replace(posterior, marginals=missed)
    first = "The model does not explain the data: look for what is missing with `diagnose`."
    for each in (unexplained, unconverged(unexplained, "the chains do not agree")):
        assert not each.trusted
        assert "does not explain the data: for that it would have to err by 3 %" in each.doubts[0]
        assert rendered(each, width=200).splitlines()[0] == first
        assert record_of(each)["explained"] is False
    page = Reader(posterior_html(each, ORIGIN))
    assert page.texts[0] == first
    assert "The chains do not agree." in page.texts[:4]
    assert record_of(posterior)["explained"] is True


def test_a_posterior_of_one_parameter_and_one_channel_has_a_page(posterior: HarmonicPosterior) -> None:
    identified = tuple(replace(each, profile=None) for each in posterior.of_role("identified")[:1])
    kept = (*identified, *posterior.of_role("nuisance"))
    used = posterior.predictive.used & np.array([True, False])[:, None]
    predictive = replace(posterior.predictive, used=used)
    bare = replace(
        posterior,
        marginals=kept,
        predictive=predictive,
        sentences=(),
        model=replace(posterior.model, effects=()),
        sampler="emcee",
    )
    page = Reader(posterior_html(bare, replace(ORIGIN, warnings=())))
    # A corner plot, traces of the parameter and of the two scales, and the one channel that was compared.
    assert sum(tag == "img" for tag, _ in page.tags) == 5
    text = " ".join(page.texts)
    assert "No profiles were computed." in text
    assert "All other parameters were fixed" in text
    assert "no friction" in text
    assert "not applicable" in text
    assert "mu_r" in rendered(bare)
    assert record_of(bare)["correlation"] == {"mu_r": {"mu_r": pytest.approx(1.0)}}


def test_a_value_that_a_template_does_not_get_is_an_error() -> None:
    with pytest.raises(UndefinedError):
        render_page("posterior.html.j2", {})


def test_the_record_has_the_keys_of_the_contract_first(posterior: HarmonicPosterior) -> None:
    record = record_of(posterior)
    assert list(record)[:7] == [
        "parameters", "sampler", "wall_s", "ess_min", "converged", "divergences", "acceptance"
    ]  # fmt: skip
    assert list(record["parameters"])[:6] == [
        "mu_r",
        "mu_t",
        "ydot_Hth",
        "c_sd",
        "noise_scale",
        "discrepancy",
    ]
    entry = record["parameters"]["c_sd"]
    assert list(entry)[:8] == ["median", "sd", "q025", "q975", "unit", "ess_bulk", "ess_tail", "r_hat"]
    draws = posterior.draws["c_sd"]
    assert entry["median"] == pytest.approx(np.median(draws), rel=1e-12)
    assert [entry["q025"], entry["q975"]] == pytest.approx(
        np.quantile(draws, [0.025, 0.975]).tolist(), rel=1e-12
    )
    assert entry["unit"] == "N s/m"
    assert len(entry["profile"]["values"]) == len(entry["profile"]["rise"]) == 13
    assert record["parameters"]["noise_scale"]["profile"] is None
    assert record["predictive"]["inside"] == posterior.predictive.count_inside[0]
    assert record["correlation"]["mu_t"]["ydot_Hth"] == pytest.approx(0.85, abs=0.03)
    assert record["origin"]["data_sha256"] == "ab" * 32
    assert record["warnings"][0]["code"] == "odd"


def test_numbers_that_are_not_known_are_null_in_the_record(posterior: HarmonicPosterior) -> None:
    unknown = replace(posterior, convergence=replace(posterior.convergence, pareto_k=float("nan")))
    assert record_of(unknown)["pareto_k"] is None
    assert [check.value for check in checks(unknown) if check.name == "Pareto k"] == [DASH]
    assert "nan" not in rendered(unknown)


def test_the_terminal_says_the_numbers_in_80_columns(posterior: HarmonicPosterior) -> None:
    text = rendered(posterior, width=80)
    assert re.search(r"c_sd +5\d{3} ± \d+ +5\d{3} to 5\d{3} N s/m +99\.[45] % +427", text)
    assert "Strongest correlation: mu_t with ydot_Hth, +0.8" in text
    assert all(sentence in " ".join(text.split()) for sentence in SENTENCES)
    assert (
        text.index("Identified parameters")
        < text.index("Scales of the likelihood")
        < text.index("Identifiability")
    )


def test_the_predictive_sentence_counts_and_says_what_chance_would_do(posterior: HarmonicPosterior) -> None:
    inside, total = posterior.predictive.count_inside
    assert total == 504
    sentence = predictive_sentence(posterior)
    assert f"Of 504 measured harmonics {inside} (" in sentence
    # 0.95 * 504 = 478.8, and twice sqrt(0.95 * 0.05 * 504) is 9.8.
    assert sentence.endswith("for a perfect model it would be 469 to 489.")


def test_too_few_harmonics_inside_is_said_to_be_the_models_fault(posterior: HarmonicPosterior) -> None:
    inside = posterior.predictive.inside & (np.arange(28) % 5 > 0)[:, None, None]
    missed = replace(posterior, predictive=replace(posterior.predictive, inside=inside))
    assert predictive_sentence(missed).endswith("fewer than chance allows: the model misses something.")
    every = replace(posterior.predictive, inside=posterior.predictive.used)
    assert "more than chance allows" in predictive_sentence(replace(posterior, predictive=every))


def test_a_parameter_at_the_end_of_its_prior_interval_has_moved_by_two_deviations(
    posterior: HarmonicPosterior,
) -> None:
    each = posterior.of_role("tolerated")[0]
    assert shift_in_sd(replace(each, median=each.prior[1])) == pytest.approx(1.96, abs=1e-3)
    assert shift_in_sd(replace(each, median=sum(each.prior) / 2.0)) == pytest.approx(0.0, abs=1e-9)


def test_the_origin_of_a_result_names_data_versions_and_warnings() -> None:
    found, later = DataWarning("one", "x"), DataWarning("two", "y")
    campaign = Campaign("runs/c.csv", (), (found,), "cd" * 32)
    rig = replace(read_rig(default_rig_path()), source="model.toml")
    origin = RigModel(rig).origin(campaign, [later]).with_versions(["numpy", "no-such-package"])
    assert origin.data_sha256 == "cd" * 32
    assert origin.model == "model.toml"
    assert origin.versions["numpy"] == np.__version__
    assert origin.versions["no-such-package"] == "unknown"
    assert [warning.code for warning in origin.warnings] == ["one", "two"]
