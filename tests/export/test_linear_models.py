"""The linear models that travel along are those of the control stage; an effect that is no friction stays in."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.control.linear_equivalent import paper_masses, quarter_car_space
from savgs_ident.control.linearisation import linearise, resting
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce
from savgs_ident.effects.learned_functions import frictions_at
from savgs_ident.export.exported_model import ExportedModel
from savgs_ident.export.linear_models import (
    equation_8,
    exact,
    is_friction,
    values_without_friction,
    without_friction,
)
from savgs_ident.plants.quarter_car.catalogue import EFFECTS, LEARNED, MODELS, build_model
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.ports import RAIL
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over

DRY = {
    "rail_coulomb", "rail_preload", "rail_stribeck", "rail_asymmetry", "joint_friction", "strut_friction",
    "tyre_friction",
}  # fmt: skip


def test_friction_is_what_holds_at_rest() -> None:
    assert {name for name, effect in EFFECTS.items() if is_friction(effect)} == DRY


@pytest.mark.slow
def test_both_are_those_of_the_control_stage(rig: Rig) -> None:
    model = ExportedModel(RigModel(rig, MODELS["simtr"]))
    p, bare = as_values(rig.parameters.as_dict()), build_model(rig, ())
    printed = quarter_car_space(paper_masses(bare, p))
    linear = linearise(bare, p, resting(bare, p, p["psi_nominal"]))
    for found, wanted in ((equation_8(model.model).space, printed), (exact(model).space, linear)):
        for name in "ABCD":
            assert np.array_equal(getattr(found, name), getattr(wanted, name))
        assert found.state_labels == wanted.state_labels


@pytest.mark.slow
def test_every_signal_has_its_unit(model: ExportedModel) -> None:
    for each in (equation_8(model.model), exact(model)):
        space = each.space
        assert set(each.units) == {*space.state_labels, *space.input_labels, *space.output_labels}
    assert exact(model).units["0_mount_deflection"] == "m"


def _sag(rig: Rig, compliance: float) -> float:
    """Suspension deflection per acceleration of the body [s^2] in a slow motion, on a mount of a compliance [m/N]."""
    effects = (*MODELS["simtr"], "mount_compliance")
    table = ExportedModel(RigModel(rig, effects)).table.with_values({"mount_compliance": compliance})
    found = exact(ExportedModel(RigModel(replace(rig, parameters=table), effects))).response(np.array([1e-3]))
    return float(np.real(found[1, 0, 0] / found[0, 0, 0]))


@pytest.mark.slow
def test_a_mount_that_gives_way_is_in_the_exact_one(rig: Rig) -> None:
    """The strut's spring k and the mount C are in series: the stiffness falls in proportion to k C / (1 + k C)."""
    spring, some, more = rig.parameters["k_sd"].value, 5e-7, 1.5e-6
    softer = [1.0 - _sag(rig, 0.0) / _sag(rig, compliance) for compliance in (some, more)]
    series = [spring * compliance / (1.0 + spring * compliance) for compliance in (some, more)]
    assert softer[1] / softer[0] == pytest.approx(series[1] / series[0], rel=1e-4)
    # Nearly all stiffness is the spring's.
    assert softer[0] == pytest.approx(series[0], rel=0.1)
    stiff = exact(ExportedModel(RigModel(rig, MODELS["simtr"]))).response(np.array([1e-3]))
    assert float(np.real(stiff[1, 0, 0] / stiff[0, 0, 0])) == pytest.approx(_sag(rig, 0.0), rel=1e-4)


def _with(rig: Rig, effect: str, numbers: dict[str, float]) -> ExportedModel:
    """The rig with an effect of certain numbers [SI]."""
    table = ExportedModel(RigModel(rig, (effect,))).table.with_values(numbers)
    return ExportedModel(RigModel(replace(rig, parameters=table), (effect,)))


def _steepness(model: ExportedModel, effect: Effect, p: Values) -> float:
    """By how much a force [N] changes with the velocity over its port [m/s], nothing moving but a little."""

    def force(velocity: Array) -> Array:
        return effect.force(
            p, PortSignals(jnp.asarray(0.01), velocity, jnp.asarray(2e3), jnp.zeros(())), jnp.full(2, 0.01)
        )

    return abs(float(jax.grad(force)(jnp.zeros(()))))


@pytest.mark.slow
@over("name", [name for name in LEARNED if isinstance(LEARNED[name].law, LearnedForce)])
def test_what_turns_round_in_a_learned_force_is_left_out(rig: Rig, name: str) -> None:
    """Of coefficients of 100 N over 0.5 m/s, the dampings among them make 4e3 N s/m at most, the frictions 1e4."""
    effect = LEARNED[name]
    spans = {f"{name}_middle": 0.0, f"{name}_stroke": 0.03, f"{name}_speed": 0.5}
    model = _with(rig, name, dict.fromkeys(effect.null, 100.0) | spans)
    (kept,) = without_friction(model.equations.model).effects
    assert kept.name == name
    assert _steepness(model, effect, as_values(model.table.as_dict())) > 1e4
    assert 200.0 < _steepness(model, effect, values_without_friction(model)) < 4e3


DAMPING, SPEED = 150.0, 0.5
"""A damping on the rail [N s/m], and the velocity at which it was learned [m/s]."""

DAMPER = {
    "learned_rail_speed": SPEED, "learned_rail_stroke": 0.03, "learned_rail_carried": 4e3,
    "learned_rail_3": -DAMPING * SPEED,
}  # fmt: skip
RUBBING = DAMPER | dict.fromkeys(frictions_at(RAIL), -300.0)


@pytest.mark.slow
def test_friction_that_was_learned_is_not_in_the_exact_one(rig: Rig) -> None:
    found, wanted = (exact(_with(rig, "learned_rail", each)).space for each in (RUBBING, DAMPER))
    assert all(np.array_equal(getattr(found, name), getattr(wanted, name)) for name in "ABCD")


@pytest.mark.slow
def test_a_learned_damping_is_the_damper_of_the_catalogue(rig: Rig) -> None:
    found = exact(_with(rig, "learned_rail", RUBBING)).space
    wanted = exact(_with(rig, "rail_viscous", {"rail_viscous_damping": DAMPING})).space
    # The sliders of the learned force have states, of which nothing is seen.
    for frequency in (0.3, 1.5, 4.0, 11.0, 30.0):
        assert _response(found, frequency) == pytest.approx(_response(wanted, frequency), rel=1e-6, abs=1e-9)


def _response(space: Any, frequency: float) -> np.ndarray:
    """The frequency response [output per input] at a frequency [Hz]."""
    s = 2j * np.pi * frequency * np.eye(len(space.A))
    return np.asarray(space.C @ np.linalg.solve(s - space.A, space.B) + space.D)


def test_the_cam_behind_its_encoder_is_not_linearised(rig: Rig) -> None:
    model = ExportedModel(RigModel(rig, ("cam_harmonic", "cam_scale", "rail_viscous")))
    kept = without_friction(model.equations.model).effects
    assert [effect.name for effect in kept] == ["rail_viscous"]


def test_a_response_is_outputs_by_inputs_by_frequencies(model: ExportedModel) -> None:
    linear = equation_8(model.model)
    frequency = np.array([1.0, 2.0, 3.0])
    found = linear.response(frequency)
    assert found.shape == (4, 2, 3)
    assert found[0, 0, 1] == pytest.approx(complex(linear.space(2j * np.pi * 2.0)[0, 0]))
