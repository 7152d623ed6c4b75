"""A plant that is no quarter car through the public interface: fitted, sampled, shown."""

import json

import pytest

import savgs_ident as si

from .relaxed import as_users_have_it

TRUTH = {"k": 5.5e4, "c": 2.5e3}
DWELLS = (0.8, 1.2, 1.6, 2.0, 2.5, 3.5, 5.0, 8.0, 11.0)
NOISE = {"sprung_accel": 0.05, "susp_deflection": 1e-4}


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> object:
    with as_users_have_it():
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
        si.simulate_dwells(model, DWELLS, {"road_height": 0.01}, {"sprung_accel": 0.05})


def test_a_fit_finds_the_truth(fit: si.Fit) -> None:
    assert fit.trusted
    assert fit.free_names == tuple(TRUTH)
    for name, true in TRUTH.items():
        assert abs(fit[name].value - true) < 3.0 * fit[name].stderr
        assert fit[name].stderr < 0.01 * true
    assert 0.7 < fit.chi2 / fit.dof < 1.3


def test_the_identified_model_is_one_of_the_same_plant(fit: si.Fit, model: si.PlantModel) -> None:
    found = fit.model
    assert isinstance(found, si.PlantModel)
    assert found.table["k"].value == fit["k"].value
    free, values = found.identified
    assert free == ("k", "c")
    assert values["c"] == fit["c"].value
    assert found.before.table == model.table
    with pytest.raises(si.InputError, match="TwoMass is no rig"):
        fit.rig  # noqa: B018


def test_a_fit_shows_itself(fit: si.Fit) -> None:
    assert "stiffness of the suspension at the wheel" in str(fit)
    record = json.loads(fit.to_json())
    assert record["parameters"]["k"]["unit"] == "N/m"
    assert set(record["gap"]) == {"sprung_accel", "susp_deflection", "together"}
    assert fit.figure_names == ()


@pytest.mark.slow
def test_the_posterior_agrees_with_the_fit(fit: si.Fit) -> None:
    posterior = si.sample(fit, target_ess=150.0, patience=1.0, time_limit=120.0)
    assert posterior.trusted
    for name in TRUTH:
        assert abs(posterior[name].median - fit[name].value) < fit[name].stderr
        assert posterior[name].sd == pytest.approx(fit[name].stderr, rel=0.3)
    assert "stiffness" in str(posterior) or "k" in str(posterior)
    assert json.loads(posterior.to_json())["parameters"]["k"]["unit"] == "N/m"
