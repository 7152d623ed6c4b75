"""Ways to fit: peak-to-peak only, other models, other parameters, names that do not fit."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.fit.least_squares import FitSettings, fit_least_squares
from savgs_ident.inference.problem import ProblemSettings, plan_task
from savgs_ident.plants.quarter_car.catalogue import MODELS
from savgs_ident.plants.quarter_car.model import FREE, RigModel
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.readings import harmonics

from .bench import TRUTH, true_rig


@pytest.mark.slow
def test_peak_to_peak_alone_identifies_them_too_as_in_the_paper(measured: HarmonicResponse, rig: Rig) -> None:
    """28 dwells and two channels, phases and waveforms unseen: wider errors about the same truth."""
    settings = FitSettings(quantity="peak_to_peak", fixed_tolerances=True)
    fit = fit_least_squares(measured, RigModel(true_rig(rig), MODELS["simtr"]), free=FREE, settings=settings)
    assert fit.trusted
    assert fit.quantity == "peak_to_peak"
    assert fit.dof == 28 * 2 - 4
    assert fit.chi2 / fit.dof < 1.6
    for name in FREE:
        found = fit.by_name[name]
        assert abs(found.value - TRUTH[name]) < 4.0 * found.stderr
        assert found.stderr < 0.05 * TRUTH[name]


def _simqc_data(response: HarmonicResponse, rig: Rig, damping: float) -> HarmonicResponse:
    """What SimQC would have given in the same dwells at ``damping``, without noise."""
    task = plan_task(
        response, RigModel(rig, MODELS["simqc"]), ("c_sd",), ProblemSettings(fixed_tolerances=True)
    )
    p = dict(task.problem.fixed) | {"c_sd": jnp.asarray(damping)}
    solution = simulate_periodic(task.problem.model, p, task.excitation)
    assert all(status.ok for status in solution.status())
    found = response.harmonics.copy()
    places = [response.channel("sprung_accel"), response.channel("susp_deflection")]
    found[:, places] = np.asarray(harmonics(task.problem.model, p, solution, response.orders))
    return replace(response, harmonics=found)


@pytest.mark.slow
def test_simqc_finds_the_damping_of_a_rig_without_friction(few: HarmonicResponse, rig: Rig) -> None:
    data = _simqc_data(few, rig, 5000.0)
    settings = FitSettings(fixed_tolerances=True)
    fit = fit_least_squares(data, RigModel(rig, MODELS["simqc"]), free=("c_sd",), settings=settings)
    assert fit.trusted
    assert fit.effects == ()
    assert fit.free_names == ("c_sd",)
    assert fit.chi2 < 1.0  # The nodes of the fit follow another start than those of the data.
    assert fit.by_name["c_sd"].value == pytest.approx(5000.0, rel=1e-4)
    assert fit.predicted == pytest.approx(fit.frictionless, abs=1e-3)


@pytest.mark.slow
def test_simqc_takes_the_friction_of_the_real_rig_for_damping(few: HarmonicResponse, rig: Rig) -> None:
    """What it cannot explain stays in chi2, thousands of times what noise would leave."""
    settings = FitSettings(fixed_tolerances=True)
    fit = fit_least_squares(few, RigModel(rig, MODELS["simqc"]), free=("c_sd",), settings=settings)
    assert fit.by_name["c_sd"].value > 1.2 * TRUTH["c_sd"]
    assert fit.chi2 / fit.dof > 1000.0
    assert len(fit.starts) == settings.starts


@pytest.mark.parametrize(
    ("model", "free", "what"),
    [
        ("simtr", ("mu_r", "mu_x"), "there is no parameter 'mu_x'"),
        ("simtr", ("motor_gear_ratio",), "does not depend on 'motor_gear_ratio'"),
        ("simqc", ("c_sd", "mu_r"), "does not depend on 'mu_r'"),
    ],
)
def test_a_name_that_cannot_be_fitted_is_refused_with_the_ones_that_can(
    few: HarmonicResponse, rig: Rig, model: str, free: tuple[str, ...], what: str
) -> None:
    with pytest.raises(InputError, match=what) as caught:
        fit_least_squares(few, RigModel(rig, MODELS[model]), free=free)
    assert "c_sd" in caught.value.remedy
    assert free[-1] not in caught.value.remedy.replace(":", ",").split(", ")


def test_a_name_given_twice_is_refused(few: HarmonicResponse, rig: Rig) -> None:
    with pytest.raises(InputError, match="'mu_r' is free twice"):
        fit_least_squares(few, RigModel(rig, MODELS["simtr"]), free=("mu_r", "mu_r"))


def test_a_known_parameter_may_be_free_and_then_has_no_prior(few: HarmonicResponse, rig: Rig) -> None:
    task = plan_task(few, RigModel(rig, MODELS["simtr"]), ("k_t", "mu_r"), ProblemSettings())
    assert task.problem.free.identified == ("k_t", "mu_r")
    assert "k_t" not in task.problem.free.tolerated
    assert {"k_sd", "c_sd"} <= set(task.problem.free.tolerated)
    assert not {"psi_nominal", "g", "motor_gear_ratio"} & set(task.problem.free.names)
