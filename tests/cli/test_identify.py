"""``fit``, ``bode`` and ``simulate`` on a few dwells: one real fit, and what is made of it."""

import json
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from savgs_ident.core.status import Status
from savgs_ident.fit import public
from savgs_ident.fit.identified import Verdict
from savgs_ident.fit.result import Fit
from savgs_ident.plants.quarter_car.rig import default_rig_path, read_rig
from savgs_ident.report import present_campaign

pytestmark = pytest.mark.slow

Invoke = Callable[..., Result]
WORDS = ("--free", "mu_r", "c_sd", "--fixed-tolerances", "--orders", "5")


@pytest.fixture(scope="module")
def fitted(
    short_campaign: Path,
    cache: Path,
    tmp_path_factory: pytest.TempPathFactory,
    as_users_have_it: Callable[[Sequence[str]], Result],
) -> tuple[Path, Result, Fit]:
    """A finished ``fit`` on four dwells: folder, outcome, and the record behind it."""
    folder = tmp_path_factory.mktemp("fit")
    found: list[Fit] = []
    original = public.fit_least_squares

    def remembering(*args: Any, **kwargs: Any) -> Fit:
        found.append(original(*args, **kwargs))
        return found[-1]

    words = ["fit", str(short_campaign), *WORDS, "--json", "--out", str(folder)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SAVGS_IDENT_CACHE", str(cache))
        patch.setattr(public, "fit_least_squares", remembering)
        done = as_users_have_it(words)
    return folder, done, found[0]


def _no_picture(*args: object) -> tuple[Path, ...]:
    return ()


@pytest.fixture
def again(
    invoke: Invoke, fitted: Any, short_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Result]:
    """``fit`` once more, with a given fit in place of the work and without its picture."""

    def run(fit: Fit, *words: str, draw: Callable[..., tuple[Path, ...]] = _no_picture) -> Result:
        monkeypatch.setattr(public, "fit_least_squares", lambda *args, **kwargs: fit)
        monkeypatch.setattr(present_campaign, "draw_comparison", draw)
        return invoke("fit", short_campaign, *WORDS, "--out", tmp_path / "again", *words)

    return run


def test_the_fit_writes_its_files_and_hands_over_the_same_record(fitted: Any) -> None:
    folder, done, fit = fitted
    assert sorted(path.name for path in folder.iterdir()) == [
        "bode.pdf",
        "bode.png",
        "fit.json",
        "model.toml",
    ]
    assert done.stdout == (folder / "fit.json").read_text()
    record = json.loads(done.stdout)
    assert record["parameters"]["mu_r"]["value"] == fit.by_name["mu_r"].value
    assert list(record["parameters"]) == ["mu_r", "c_sd"]
    assert len(record["dwells"]) == 4
    assert done.exit_code == (0 if fit.trusted else 1)


def test_progress_says_what_is_happening(fitted: Any) -> None:
    stages = (
        "reading",
        "estimating responses",
        "solving the model",
        "chi2 =",
        "between the dwells",
        "drawing",
    )
    messages = fitted[1].stderr
    places = [messages.index(stage) for stage in stages]
    assert places == sorted(places)


def test_the_model_file_is_a_rig_with_its_provenance(fitted: Any, short_campaign: Path) -> None:
    folder, _, fit = fitted
    rig = read_rig(folder / "model.toml")
    assert rig.parameters["mu_r"].value == fit.by_name["mu_r"].value
    reported = tomllib.loads((folder / "model.toml").read_text())["provenance"]
    assert reported["data"] == str(short_campaign)
    assert reported["free"] == ["mu_r", "c_sd"]
    assert reported["chi2"] == fit.chi2
    assert set(reported["versions"]) >= {"savgs_ident", "jax", "numpy", "python"}
    assert reported["covariance"]["matrix"][0][0] == fit.covariance[0, 0]


def test_bode_of_the_model_finds_the_gap_of_the_fit(
    fitted: Any, invoke: Invoke, short_campaign: Path
) -> None:
    folder, done, _ = fitted
    shown = invoke("bode", folder / "model.toml", short_campaign, "--orders", "5", "--json", "--out", "b")
    assert shown.exit_code == 0
    assert shown.stdout == Path("b/bode.json").read_text()
    gap = json.loads(shown.stdout)["gap"]["together"]
    wanted = json.loads(done.stdout)["gap"]["together"]
    assert gap["sigma"] == pytest.approx(wanted["after_sigma"], rel=0.02)
    assert Path("b/bode.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert Path("b/bode.pdf").read_bytes().startswith(b"%PDF-")


def test_without_json_a_table_is_shown_and_no_progress_on_it(again: Any, fitted: Any) -> None:
    done = again(fitted[2])
    assert "Identified parameters" in done.stdout
    assert "N s/m" in done.stdout
    assert "chi2/dof" in done.stdout
    assert "model.toml" in done.stdout
    assert "reading" not in done.stdout


def test_a_fit_that_did_not_converge_is_code_1_with_the_reason(again: Any, fitted: Any) -> None:
    explained = replace(fitted[2], status=Status.MAX_ITERATIONS, verdict=Verdict(True, ("",)))
    done = again(explained, "--quiet")
    assert done.exit_code == 1
    assert done.stdout == ""
    assert done.stderr == f"Not to be trusted: {Status.MAX_ITERATIONS.advice}.\n"


def test_a_model_that_misses_is_not_told_to_take_more_steps(again: Any, fitted: Any) -> None:
    missed = replace(fitted[2], status=Status.MAX_ITERATIONS, verdict=Verdict(True, ("",), explained=False))
    astray = replace(missed, dwell_status=(Status.STALLED, *missed.dwell_status[1:]))
    broken = replace(missed, status=Status.NOT_FINITE)
    for each in (missed, astray, broken):
        done = again(each, "--quiet")
        assert done.exit_code == 1
        assert done.stderr == (
            "Not to be trusted: the model does not explain the data: look for what is missing with `diagnose`.\n"
        )
    lost = replace(astray, status=Status.CONVERGED, verdict=Verdict(True, ("",)))
    assert "periodic motion was not found" in again(lost, "--quiet").stderr


def test_effects_that_a_diagnosis_names_are_fitted_along(
    invoke: Invoke, fitted: Any, short_campaign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, Any] = {}

    def remembering(response: Any, model: Any, **given: Any) -> Fit:
        asked.update(given, effects=model.effects)
        return fitted[2]

    monkeypatch.setattr(public, "fit_least_squares", remembering)
    monkeypatch.setattr(present_campaign, "draw_comparison", _no_picture)
    words = ("--with", "rail_stribeck", "accel_lag", "--quiet", "--out", tmp_path)
    invoke("fit", short_campaign, *words)
    assert asked["effects"] == ("rail_coulomb", "tyre_friction", "rail_stribeck", "accel_lag")
    own = ("stribeck_rise", "stribeck_velocity", "accel_lag_time")
    assert asked["free"] == ("mu_r", "mu_t", "ydot_Hth", "c_sd", *own)
    done = invoke("fit", short_campaign, "--with", "magic", "--out", tmp_path)
    assert done.exit_code == 2
    assert "there is no effect 'magic'" in done.stderr


def test_data_that_identify_too_little_are_code_1_with_the_verdict(again: Any, fitted: Any) -> None:
    blind = Verdict(False, ("mu_t and ydot_Hth cannot be distinguished.",), (("mu_t", "ydot_Hth"),))
    done = again(replace(fitted[2], verdict=blind))
    assert done.exit_code == 1
    assert "- mu_t and ydot_Hth cannot be distinguished." in done.stdout


def test_a_sound_fit_is_code_0(again: Any, fitted: Any) -> None:
    sound = replace(fitted[2], verdict=Verdict(True, ("All is reported.",)), status=Status.CONVERGED)
    assert again(sound, "--quiet").exit_code == 0


def test_ctrl_c_during_the_pictures_keeps_the_fit(again: Any, fitted: Any, tmp_path: Path) -> None:
    def stopped(*args: object) -> tuple[Path, ...]:
        raise KeyboardInterrupt

    done = again(fitted[2], draw=stopped)
    assert done.exit_code == 130
    assert done.stderr.endswith("Stopped by Ctrl-C; files that were finished are kept.\n")
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["fit.json", "model.toml"]
    json.loads((tmp_path / "again" / "fit.json").read_text())
    read_rig(tmp_path / "again" / "model.toml")


def test_simulate_writes_the_same_numbers_three_times(invoke: Invoke) -> None:
    words = ("--frequency", "2.35", "1.4", "--model", "simqc", "--orders", "5")
    done = invoke("simulate", default_rig_path(), *words, "--json", "--out", "s")
    assert done.exit_code == 0
    assert done.stdout == Path("s/simulate.json").read_text()
    record = json.loads(done.stdout)
    assert record["frequency_hz"] == [1.4, 2.35]
    assert record["effects"] == []
    header, *rows = Path("s/simulate.csv").read_text().splitlines()
    assert all("[" in name or name == "status" for name in header.split(","))
    assert [float(row.split(",")[0]) for row in rows] == [1.4, 2.35]
    place = header.split(",").index("sprung_accel peak to peak [m/s^2]")
    written = [float(row.split(",")[place]) for row in rows]
    assert written == record["channels"]["sprung_accel"]["peak_to_peak"]
    # The frictionless rig near its resonance shakes more per metre of road than well below it.
    gain = record["channels"]["sprung_accel"]["per_metre_of_road"]
    assert gain[1] > 1.5 * gain[0]
    assert Path("s/simulate.png").exists()
