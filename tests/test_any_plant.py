"""Plants that are no quarter car through the public interface: fitted, sampled, diagnosed, shown."""

import json
import re
import runpy
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.core.parameter import merge_parameters

from .relaxed import with_kept_programs
from .simulate.test_windows import campaign

TRUTH = {"k": 5.5e4, "c": 2.5e3}
DWELLS = (0.8, 1.2, 1.6, 2.0, 2.5, 3.5, 5.0, 8.0, 11.0)
NOISE = {"body_accel": 0.05, "susp_deflection": 1e-4}

PENDULUM = Path(__file__).resolve().parents[1] / "examples" / "pendulum.py"


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> object:
    with with_kept_programs():
        yield


@pytest.fixture(scope="module")
def model() -> si.PlantModel:
    return si.PlantModel(si.TwoMass(), si.TwoMass.parameters)


@pytest.fixture(scope="module")
def measured(model: si.PlantModel) -> si.HarmonicResponse:
    return si.simulate_dwells(model.with_values(TRUTH), DWELLS, {"road_height": 0.01}, NOISE, seed=2)


@pytest.fixture(scope="module")
def fit(model: si.PlantModel, measured: si.HarmonicResponse) -> si.Fit:
    return si.fit(model, measured)


def test_what_is_known_to_bounds_alone_is_identified(model: si.PlantModel) -> None:
    assert model.free() == ("k", "c")
    assert model.free(["c", "m_s"]) == ("c", "m_s")
    with pytest.raises(si.InputError, match="there is no parameter 'mu_r'"):
        model.free(["mu_r"])
    assert (model + "guide_coulomb").free() == ("k", "c", "guide_coulomb_coefficient")


def test_effects_are_added_by_name_or_as_they_are(model: si.PlantModel) -> None:
    rubbing = model + "guide_coulomb"
    assert (model.effects, rubbing.effects, str(rubbing)) == (
        (),
        ("guide_coulomb",),
        "TwoMass + guide_coulomb",
    )
    assert (rubbing + "guide_coulomb") is rubbing
    assert "guide_coulomb_coefficient" in rubbing.table
    mine = si.generic_effects(si.Axis.ports)["screw_stiffness"]
    assert (si.PlantModel(si.Axis(), si.Axis.parameters, {"mine": mine}) + mine).effects == (mine.name,)
    with pytest.raises(si.InputError, match=r"there is no effect 'magic'\. Remedy: choose among"):
        model + "magic"


def test_names_that_the_plant_does_not_have_are_refused(model: si.PlantModel) -> None:
    with pytest.raises(si.InputError, match="the plant has no input 'force'"):
        si.simulate_dwells(model, DWELLS, {"force": 1.0}, NOISE)
    with pytest.raises(si.InputError, match="channel 'susp_deflection' has no noise"):
        si.simulate_dwells(model, DWELLS, {"road_height": 0.01}, {"body_accel": 0.05})


@pytest.mark.slow
def test_a_fit_finds_the_truth(fit: si.Fit) -> None:
    assert fit.trusted
    assert fit.free_names == tuple(TRUTH)
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 3.0 * fit[name].stderr
        assert fit[name].stderr < 0.01 * true
    assert 0.7 < fit.chi2 / fit.dof < 1.3


@pytest.mark.slow
def test_a_contact_that_was_declared_far_too_soft_takes_no_parameter_along(model: si.PlantModel) -> None:
    """All masses, stiffnesses and forces together are seen in no reading: a contact that is off would scale them."""
    rubbing = model + "guide_coulomb"
    truth = TRUTH | {"guide_coulomb_coefficient": 0.05}
    noise = {name: 0.1 * each for name, each in NOISE.items()}
    measured = si.simulate_dwells(rubbing.with_values(truth), DWELLS, {"road_height": 0.01}, noise, seed=2)
    contact = {"k_pre": 2e4, "c_pre": 60.0}
    soft = [replace(rubbing.table[name], value=value) for name, value in contact.items()]

    def fitted(source: str) -> si.Fit:
        table = si.ParameterTable(tuple(replace(each, source=source) for each in soft))
        given = rubbing.with_parameters(merge_parameters(table, rubbing.table))
        found = si.fit(given, measured)
        assert isinstance(found, si.Fit)
        return found

    typical, exact = fitted("typical"), fitted("")
    assert typical.trusted, typical.doubt
    for name, true in truth.items():
        assert abs(typical[name].value - true) < 4.0 * typical[name].stderr, name
    assert not exact.trusted


@pytest.mark.slow
def test_the_identified_model_is_one_of_the_same_plant(fit: si.Fit, model: si.PlantModel) -> None:
    found = fit.model
    assert isinstance(found, si.PlantModel)
    assert found.table["k"].value == fit["k"].value
    free, values = found.identified
    assert free == ("k", "c")
    assert values["c"] == fit["c"].value
    assert found.before.table == model.table


@pytest.mark.slow
def test_a_fit_shows_itself(fit: si.Fit) -> None:
    assert "stiffness of the suspension at the wheel" in str(fit)
    record = json.loads(fit.to_json())
    assert record["parameters"]["k"]["unit"] == "N/m"
    assert set(record["gap"]) == {"body_accel", "susp_deflection", "together"}
    assert fit.figure_names == ("bode",)
    figure = si.plot_bode(fit)
    assert figure.axes[0].get_ylabel() == "magnitude [m/s² per m of road]"


@pytest.mark.slow
def test_a_model_is_compared_and_what_is_saved_is_read_back(
    model: si.PlantModel, measured: si.HarmonicResponse, fit: si.Fit, tmp_path: Path
) -> None:
    compared = si.compare(fit.model, measured)
    assert compared.trusted
    assert np.max(np.abs(compared.model.harmonics - fit.predicted)) < 1e-6
    record = json.loads(compared.to_json())
    assert len(record["channels"]["susp_deflection"]["identified"]["per_metre_of_road"]) == len(DWELLS)
    paths = fit.save(tmp_path / "fit")
    assert {path.name for path in paths} == {"fit.json", "model.toml", "bode.png", "bode.pdf"}
    again = si.load_plant(si.TwoMass, tmp_path / "fit/model.toml")
    assert again.table == fit.model.table
    assert again.identified == fit.model.identified


@pytest.mark.slow
def test_both_samplers_find_the_same_posterior_and_it_agrees_with_the_fit(fit: si.Fit) -> None:
    """Enough draws that Monte-Carlo error does not decide.

    Of a difference of means its standard deviation is 0.05 of one of the posterior, of a ratio of widths 0.035.
    """
    one, other = (
        si.sample(fit, sampler=sampler, target_ess=800.0, patience=0.0) for sampler in ("emcee", "nuts")
    )
    for name, true in TRUTH.items():
        assert abs(one.draws[name].mean() - other.draws[name].mean()) < 0.14 * one[name].sd, name
        assert one[name].sd == pytest.approx(other[name].sd, rel=0.14), name
        for posterior in (one, other):
            assert posterior.trusted
            assert posterior[name].q025 < true < posterior[name].q975, name
            assert abs(posterior[name].median - fit[name].value) < fit[name].stderr
            assert posterior[name].sd == pytest.approx(fit[name].stderr, rel=0.3)
    assert "\nk " in str(one)
    assert json.loads(one.to_json())["parameters"]["k"]["unit"] == "N/m"


@pytest.mark.slow
def test_a_road_has_a_comparison_and_a_posterior_as_dwells_have(model: si.PlantModel, tmp_path: Path) -> None:
    road = campaign(40.0)
    fit = si.fit(model, road)
    compared = si.compare(fit.model, road)
    assert compared.trusted
    assert np.max(np.abs(compared.model.harmonics - fit.predicted)) < 1e-4 * np.max(np.abs(fit.predicted))
    seen = json.loads(compared.to_json())["channels"]["body_accel"]
    assert np.all(np.array(seen["missed_rms"]) < 2.0 * np.array(seen["noise_rms"]))
    assert {each.name for each in compared.save(tmp_path)} == {"bode.json", "spectra.png", "spectra.pdf"}
    found = si.sample(fit.model, road, "nuts", target_ess=200.0, patience=0.0)
    assert found.trusted
    for name in fit.free_names:
        assert found[name].q025 < model.table[name].value < found[name].q975
        assert abs(found[name].median - fit[name].value) < fit[name].stderr
        assert found[name].sd == pytest.approx(fit[name].stderr, rel=0.3)
    assert "4 windows of tests that do not repeat" in str(found)


@pytest.mark.slow
def test_a_posterior_without_the_friction_that_is_there_is_not_to_be_trusted(model: si.PlantModel) -> None:
    rubbing = (model + "guide_coulomb").with_values(TRUTH | {"guide_coulomb_coefficient": 0.03})
    measured = si.simulate_dwells(rubbing, DWELLS, {"road_height": 0.01}, NOISE, seed=3)
    found = si.sample(si.fit(model, measured), target_ess=100.0, patience=0.0)
    assert found.convergence.converged
    assert not found.explained
    assert not found.trusted
    assert "does not explain the data" in str(found).splitlines()[0]
    assert "diagnose" in found.doubts[0]
    complete = si.sample(si.fit(model + "guide_coulomb", measured), target_ess=100.0, patience=0.0)
    assert complete.explained
    assert complete.trusted


@pytest.mark.slow
def test_friction_of_the_guide_is_diagnosed_and_reported_without_a_word_of_the_quarter_car(
    model: si.PlantModel, tmp_path: Path
) -> None:
    rubbing = (model + "guide_coulomb").with_values(TRUTH)
    measured = si.simulate_dwells(rubbing, (0.5, *DWELLS[::2]), {"road_height": 0.0137}, NOISE, seed=5)
    said: list[str] = []
    found = si.diagnose(model, measured, progress=said.append)
    assert found.trusted
    # What swings is tried at every frequency, which takes longer than all the rest, only where nothing explains all.
    assert not [line for line in said if "oscillator from its typical size" in line]
    verdict = found.verdict
    assert (verdict.kind, verdict.ports) == ("effect", ("guide",))
    # The load of the guide is its weight: there a friction in proportion to it is a constant one.
    assert {*verdict.effects, *verdict.confusable_with} == {"guide_coulomb", "guide_preload"}
    force = {"guide_coulomb": ("coefficient", 0.03), "guide_preload": ("force", 0.03 * 320.0 * 9.80665)}
    role, true = force[verdict.effects[0]]
    assert abs(found.identified[f"{verdict.effects[0]}_{role}"] / true - 1.0) < 0.03
    assert "The model lacks something at the guide" in str(found)
    record = json.loads(found.to_json())
    assert record["verdict"]["ports"] == ["guide"]
    assert record["baseline"]["model"] == "TwoMass"
    page = found.to_html(tmp_path / "gap.html").read_text()
    assert "Diagnosis of TwoMass" in page
    assert "per metre of road" in page
    _names_no_quarter_car(page + str(found))
    assert {"gap body_accel", "bode susp_deflection", "shrink", "force 0"} <= {*found.figure_names}
    assert "ports" in found.figure_names
    assert si.plot_bode(found).axes[0].get_ylabel() == "magnitude [m/s² per m of road]"


@pytest.mark.slow
def test_the_example_of_a_plant_of_ones_own_is_sampled_and_diagnosed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With fewer draws than by default."""
    monkeypatch.setattr(si, "sample", partial(si.sample, target_ess=150.0, patience=0.0))
    runpy.run_path(str(PENDULUM), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.startswith("The model lacks something at the pivot: ")
    assert "emcee: converged" in printed
    for name in ("c", "pivot_friction_force"):
        median, sd = re.search(rf"^{name} +([\d.]+) ± ([\d.]+) ", printed, re.M).groups()
        assert abs(float(median) - 0.02) < 3.0 * float(sd)


@pytest.mark.slow
def test_nothing_is_missing_in_the_model_of_a_pendulum_without_friction(tmp_path: Path) -> None:
    pendulum = runpy.run_path(str(PENDULUM))["Pendulum"]
    model = si.PlantModel(pendulum(), pendulum.parameters)
    tests = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.5)
    measured = si.simulate_dwells(
        model.with_values({"c": 0.03}), tests, {"pivot_accel": 0.3}, {"angle": 1e-3}
    )
    found = si.diagnose(model, measured)
    assert (found.trusted, found.verdict.kind) == (True, "none")
    assert abs(found.parameters["c"] / 0.03 - 1.0) < 0.05
    page = found.to_html(tmp_path / "gap.html").read_text()
    assert "First harmonic per m/s² of pivot" in page
    _names_no_quarter_car(page)
    assert "road" not in page


def _names_no_quarter_car(text: str) -> None:
    for word in ("uarter", "rail", "wishbone", "cam ", "SAVGS", "simtr", "simqc", "SimQC"):
        assert word not in text, word


def test_the_example_is_short_and_uses_the_public_interface_alone() -> None:
    lines = PENDULUM.read_text().splitlines()
    assert len(lines) <= 60
    ours = [line for line in lines if "import" in line and "savgs_ident" in line]
    assert ours == ["import savgs_ident as si"]
