"""``linearise`` and ``design`` on the shipped rig: each run once, and what is made of it."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import Result

from savgs_ident.control import public
from savgs_ident.control.design import FACTORS, REGULARISATION, Design, read_controller
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS
from savgs_ident.control.linear_study import LinearStudy
from savgs_ident.control.synthesis import reduce_order
from savgs_ident.plants.quarter_car.rig import default_rig_path

pytestmark = pytest.mark.slow

Invoke = Callable[..., Result]
RIG = default_rig_path()
RIGS = 4
PICTURES = {
    "linearise": ("alpha", "responses", "described"),
    "design": ("gamma", "loop", "ride", "robustness", "regularisation"),
}


@pytest.fixture(scope="module")
def once(
    cache: Path,
    tmp_path_factory: pytest.TempPathFactory,
    as_users_have_it: Callable[[Sequence[str]], Result],
) -> Callable[..., Any]:
    """A command run once: its folder, its outcome, and the result of the work behind it."""

    def run(place: Any, work: str, *words: object) -> tuple[Path, Result, Any]:
        folder = tmp_path_factory.mktemp("control")
        found: list[Any] = []
        original = getattr(place, work)

        def remembering(*args: Any, **kwargs: Any) -> Any:
            found.append(original(*args, **kwargs))
            return found[-1]

        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("SAVGS_IDENT_CACHE", str(cache))
            patch.setattr(place, work, remembering)
            done = as_users_have_it([str(word) for word in (*words, "--json", "--out", folder)])
        return folder, done, found[0]

    return run


@pytest.fixture(scope="module")
def linearised(once: Callable[..., Any]) -> tuple[Path, Result, LinearStudy]:
    """A finished ``linearise``: folder, outcome, and the study behind it."""
    found: tuple[Path, Result, LinearStudy] = once(public, "study_linear", "linearise", RIG)
    return found


@pytest.fixture(scope="module")
def designed(once: Callable[..., Any]) -> tuple[Path, Result, Design]:
    """A finished ``design``: folder, outcome, and the design behind it."""
    found: tuple[Path, Result, Design] = once(public, "design_controller", "design", RIG, "--rigs", RIGS)
    return found


@pytest.mark.parametrize("command", ["linearise", "design"])
def test_the_files_are_there_and_standard_output_is_the_record(
    command: str, request: pytest.FixtureRequest
) -> None:
    folder, done, _ = request.getfixturevalue({"linearise": "linearised", "design": "designed"}[command])
    assert done.exit_code == 0, done.stderr
    assert done.stdout == (folder / f"{command}.json").read_text()
    pictures = [f"{stem}.{kind}" for stem in PICTURES[command] for kind in ("pdf", "png")]
    more = ["controller.json"] if command == "design" else []
    files = sorted([f"{command}.json", f"{command}.html", *pictures, *more])
    assert sorted(path.name for path in folder.iterdir()) == files
    page = (folder / f"{command}.html").read_text()
    assert "<script" not in page.lower()
    assert page.count("<img ") == len(PICTURES[command])
    for stem in PICTURES[command]:
        assert (folder / f"{stem}.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert (folder / f"{stem}.pdf").read_bytes().startswith(b"%PDF-")


@pytest.mark.parametrize(
    ("run", "stages"),
    [
        ("linearised", ("linear equivalent", "small motions", "motions of the test", "drawing", "writing")),
        ("designed", ("synthesis", f"robustness on {RIGS} rigs", "regularising", "drawing", "writing")),
    ],
)
def test_progress_is_said_on_the_way(
    run: str, stages: tuple[str, ...], request: pytest.FixtureRequest
) -> None:
    messages = request.getfixturevalue(run)[1].stderr
    places = [messages.index(stage) for stage in stages]
    assert places == sorted(places)


def test_the_linear_equivalent_is_that_of_the_paper(linearised: Any) -> None:
    record = json.loads(linearised[1].stdout)
    nominal = record["nominal"]
    assert nominal["k_eq"] == {"value": pytest.approx(59987.0, rel=0.01), "unit": "N/m"}
    assert nominal["c_eq"] == {"value": pytest.approx(2087.4, rel=0.01), "unit": "N s/m"}
    assert nominal["alpha"]["value"] < 0.0
    parabola = record["approximations"]["alpha by a parabola"]
    assert len(parabola["coefficients"]) == 3
    assert parabola["rms_percent"] < 3.0 < record["approximations"]["alpha by a constant"]["rms_percent"]
    curve = record["over_link_angle"]
    assert len(curve["alpha"]) == len(curve["link_angle_deg"]) == 181
    assert max(curve["alpha"]) < 1e-3


def test_the_exact_linearisation_is_the_rig_and_every_step_comes_nearer(linearised: Any) -> None:
    small = json.loads(linearised[1].stdout)["small_motions"]
    errors = [each["largest_error_percent"] for each in small["models"].values()]
    assert errors == sorted(errors, reverse=True)
    assert small["models"]["exact linearisation"]["largest_error_percent"] < 0.2
    assert all(each["explanation"].endswith(".") for each in small["models"].values())
    assert 0.9 < small["slow_link"]["value"] < 1.0


def test_describing_functions_hold_at_the_size_of_the_test(linearised: Any) -> None:
    test = json.loads(linearised[1].stdout)["test_motions"]
    assert test["largest_error_percent"] < 1.0
    for element in ("rail", "strut", "tyre_lateral"):
        described = test["describing_functions"][element]
        assert len(described["damping_n_s_per_m"]) == len(test["frequency_hz"])
        # Friction and damper take energy out of every motion.
        assert min(described["damping_n_s_per_m"]) > 0.0


def test_the_state_space_is_equation_8_in_named_signals(linearised: Any) -> None:
    record = json.loads(linearised[1].stdout)
    space = record["state_space"]
    states, outputs = list(space["states"]), list(space["outputs"])
    a, c, d = (np.array(space[name]) for name in "ACD")
    assert a.shape == (5, 5)
    assert d.shape == (4, 2)
    stiffness = -320.0 * a[0, states.index("lin_position")]
    assert stiffness == pytest.approx(record["nominal"]["k_eq"]["value"])
    assert np.array_equal(c[outputs.index("sprung_accel")], a[states.index("sprung_velocity")])
    assert set(space["inputs"].values()) == {"m/s"}


def test_a_rig_without_friction_has_nothing_to_describe(
    invoke: Invoke, linearised: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = replace(linearised[2], at_test=None)
    monkeypatch.setattr(
        public, "study_linear", lambda model, origin, _: replace(study, model=model, origin=origin)
    )
    done = invoke("linearise", RIG, "--model", "simqc", "--json", "--out", "o")
    assert done.exit_code == 0
    record = json.loads(done.stdout)
    assert record["test_motions"] is None
    assert record["effects"] == []
    assert not Path("o/described.png").exists()


def test_an_exact_linearisation_that_is_not_the_rig_is_code_1(
    invoke: Invoke, linearised: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = replace(linearised[2].small, nonlinear=1.1 * linearised[2].small.nonlinear)
    monkeypatch.setattr(public, "study_linear", lambda *args: replace(linearised[2], small=small))
    done = invoke("linearise", RIG, "--quiet", "--out", "o")
    assert done.exit_code == 1
    assert done.stdout == ""
    assert done.stderr.startswith("Not to be trusted: The exact linearisation is 9.")
    assert "Not to be trusted" in Path("o/linearise.html").read_text()


def test_gamma_is_confirmed_and_the_controller_trusted(designed: Any) -> None:
    record = json.loads(designed[1].stdout)
    assert record["trusted"]
    assert record["complaints"] == []
    assert record["gamma_least"] < record["gamma"]
    assert record["peak"] <= record["gamma"] * (1.0 + 1e-6)
    assert record["peak_in_use"] == pytest.approx(record["peak"])
    assert record["order"] == record["order_full"]
    for kind in ("continuous", "sampled"):
        margins = record["margins"][kind]
        assert margins["stable"]
        assert margins["phase_deg"] > 30.0
        assert margins["gain_up"] > 1.5
        assert margins["gain_down"] is None
    assert record["margins"]["sampled"]["delay_s"] < record["margins"]["continuous"]["delay_s"]


def test_robustness_regularisation_and_weights_are_whole(designed: Any) -> None:
    record = json.loads(designed[1].stdout)
    robust = record["robustness"]
    assert robust["count"] == RIGS == len(robust["peaks"])
    assert robust["all_stable"]
    assert robust["worst_peak"] == max(robust["peaks"])
    assert robust["least_phase_margin_deg"] == min(robust["phase_margins_deg"])
    assert f"{RIGS} rigs within the tolerances of the drawing" in robust["source"]
    rows = [(each["weight"], each["factor"]) for each in record["regularisation"]]
    assert rows == [(weight, factor) for weight in REGULARISATION for factor in FACTORS]
    assert {name: each["unit"] for name, each in record["weights"].items()} == {
        name: DEFAULT_WEIGHTS[name].unit for name in DEFAULT_WEIGHTS
    }


def test_the_controller_file_is_the_sampled_controller(designed: Any) -> None:
    folder, _, design = designed
    read = read_controller(folder / "controller.json")
    assert read.rate == 1000.0
    assert np.array_equal(read.space.A, design.digital.space.A)
    assert read.space.input_labels == design.digital.space.input_labels


@pytest.fixture
def again(invoke: Invoke, designed: Any, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """``design`` once more, with a given design in place of the work."""

    def run(design: Design, *words: object) -> Result:
        monkeypatch.setattr(public, "design_controller", lambda *args: design)
        return invoke("design", RIG, "--rigs", RIGS, "--out", "o", *words)

    return run


def test_tables_are_shown_without_json(again: Any, designed: Any) -> None:
    done = again(designed[2])
    assert done.exit_code == 0
    for words in ("gamma", "Margins at the command", "all stable", "accel_bound", "Written: "):
        assert words in done.stdout


def test_an_unstable_loop_is_code_1_with_the_reason(again: Any, designed: Any) -> None:
    margins = replace(designed[2].digital_margins, stable=False)
    done = again(replace(designed[2], digital_margins=margins), "--json")
    assert done.exit_code == 1
    assert done.stderr.endswith("Not to be trusted: The loop is not stable when sampled at 1000 Hz.\n")
    record = json.loads(done.stdout)
    assert not record["trusted"]
    assert record["margins"]["sampled"]["phase_deg"] is None
    page = Path("o/design.html").read_text()
    assert "does not pass its checks" in page


def test_a_reduced_controller_is_reported_with_its_own_peak(again: Any, designed: Any) -> None:
    design: Design = designed[2]
    reduced = replace(design, controller=reduce_order(design.controller, 4))
    record = json.loads(again(reduced, "--json").stdout)
    assert (record["order"], record["order_full"]) == (4, design.controller.nstates)
    assert record["peak"] < record["peak_in_use"]
    page = Path("o/design.html").read_text()
    assert f"The controller of order {design.controller.nstates} was reduced to 4" in page
    assert "keeps gamma" not in page


def test_a_rig_on_which_the_loop_is_unstable_is_named(again: Any, designed: Any) -> None:
    robust = designed[2].robustness
    margins = (replace(robust.margins[0], stable=False), *robust.margins[1:])
    worse = replace(robust, margins=margins, peaks=(float("inf"), *robust.peaks[1:]))
    done = again(replace(designed[2], robustness=worse), "--json")
    assert done.exit_code == 1
    assert f"The loop is not stable on 1 of {RIGS} rigs." in done.stderr
    record = json.loads(done.stdout)["robustness"]
    assert record["worst_peak"] is None
    assert record["peaks"][0] is None
    assert record["least_phase_margin_deg"] == min(each.phase_deg for each in robust.margins[1:])


def test_a_posterior_gives_the_rigs(invoke: Invoke, designed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    draws = np.linspace(0.02, 0.04, 30).reshape(3, 10)
    with h5py.File("posterior.nc", "w") as file:
        file.create_dataset("posterior/mu_r", data=draws)
    tried: list[Any] = []

    def noting(model: Any, rigs: Any, *args: Any) -> Design:
        tried.append(rigs)
        design: Design = designed[2]
        return design

    monkeypatch.setattr(public, "design_controller", noting)
    done = invoke("design", RIG, "--posterior", "posterior.nc", "--rigs", "3", "--quiet")
    assert done.exit_code == 0
    assert [values["mu_r"] for values in tried[0].values] == pytest.approx([0.02, draws[1, 4], 0.04])
