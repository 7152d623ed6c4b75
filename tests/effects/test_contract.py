"""What every effect of the catalogue says of itself: one that is added is tested at once."""

import inspect
from math import inf
from pathlib import Path

import numpy as np
import pytest

import savgs_ident.effects
from savgs_ident.core.bijection import identified_bijection
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.core.rig_form import KNOWN_UNITS
from savgs_ident.effects.registry import CATALOGUE, build_model, model_parameters
from savgs_ident.model.effect import (
    AbstractChange,
    AbstractEffect,
    AbstractForce,
    AbstractSensorFault,
    AbstractSeries,
    Port,
)

from ..model.instants import as_values
from .kinds import PORTS, effects_of

FOLDER = Path(savgs_ident.effects.__file__).parent
NO_EFFECTS = {"__init__", "registry"}


def test_every_file_of_the_folder_is_in_the_catalogue_under_its_name() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - NO_EFFECTS
    homes = {Path(inspect.getfile(type(effect))).stem for effect in CATALOGUE.values()}
    assert files == set(CATALOGUE) == homes
    assert all(name == effect.name for name, effect in CATALOGUE.items())


def test_every_effect_has_a_test_of_its_own_physics() -> None:
    here = {path.stem for path in Path(__file__).parent.glob("test_*.py")}
    assert {f"test_{name}" for name in CATALOGUE} <= here


@pytest.mark.parametrize("effect", effects_of())
def test_it_says_what_it_is(effect: AbstractEffect) -> None:
    module = inspect.getmodule(type(effect))
    assert module is not None
    said = module.__doc__ or ""
    assert len(said.split()) > 15
    assert "=" in said or "\n    " in said, "there is no formula"
    assert (type(effect).__doc__ or "").strip()
    assert len(effect.symptom.split()) > 3
    assert "\n" not in effect.symptom
    assert effect.reference.strip()


@pytest.mark.parametrize("effect", effects_of())
def test_it_is_of_one_kind_and_acts_where_that_kind_can(effect: AbstractEffect) -> None:
    (kind,) = [kind for kind in PORTS if isinstance(effect, kind)]
    assert type(effect).__bases__ == (kind,)
    assert effect.port in PORTS[kind]
    if isinstance(effect, AbstractSeries) and effect.in_damper:
        assert effect.port is Port.STRUT


@pytest.mark.parametrize("effect", effects_of())
def test_its_parameters_have_units_bounds_and_a_scale(effect: AbstractEffect) -> None:
    names = [parameter.name for parameter in effect.parameters]
    assert len(set(names)) == len(names) > 0
    for parameter in effect.parameters:
        assert parameter.unit in KNOWN_UNITS, parameter.name
        assert parameter.about, parameter.name
        assert parameter.lower < parameter.upper
        assert parameter.lower > -inf or parameter.upper < inf or parameter.tolerance > 0.0, parameter.name
        identified_bijection(parameter)  # Refuses a parameter whose scale nothing tells.


@pytest.mark.parametrize("effect", effects_of())
def test_its_null_is_within_its_bounds_and_not_where_it_starts(effect: AbstractEffect) -> None:
    table = ParameterTable(effect.parameters)
    assert effect.null
    table.with_values(effect.null)  # Refuses a null that is no parameter or out of its bounds.
    for name, value in effect.null.items():
        assert value != table[name].value
        assert table[name].lower < table[name].value < table[name].upper


@pytest.mark.parametrize("effect", effects_of())
def test_its_states_have_names_units_and_scales(effect: AbstractEffect) -> None:
    assert len({state.name for state in effect.states}) == len(effect.states)
    for state in effect.states:
        assert state.name
        assert state.unit in KNOWN_UNITS
        assert state.scale > 0.0
    if isinstance(effect, AbstractSeries):
        assert effect.states[0].unit == ("rad" if effect.port is Port.LINK else "m")
    elif not isinstance(effect, AbstractForce):
        assert not effect.states


def test_no_two_effects_mean_different_things_by_one_name(rig: Rig) -> None:
    tables = [ParameterTable(effect.parameters) for effect in CATALOGUE.values()]
    names = [name for table in tables for name in table]
    assert len(set(names)) == len(names)
    assert set(names) <= set(merge_parameters(rig.parameters, *tables))
    assert set(model_parameters(rig, CATALOGUE)) == {*rig.parameters, *names}
    states = [state.name for state in build_model(rig, CATALOGUE).states]
    assert len(set(states)) == len(states)


@pytest.mark.parametrize("effect", effects_of(AbstractChange))
def test_a_change_is_of_numbers_of_the_rig_and_leaves_it_one(
    effect: AbstractChange, rig: Rig, numbers: dict[str, float]
) -> None:
    """Anywhere within its own bounds the changed numbers stay within those of the sheet."""
    for parameter in effect.parameters:
        for value in (parameter.lower, parameter.value, parameter.upper):
            changed = effect.changes(as_values(numbers | {parameter.name: value}))
            assert set(changed) <= set(rig.parameters)
            rig.parameters.with_values({name: float(number) for name, number in changed.items()})
            assert value == 0.0 or any(changed[name] != numbers[name] for name in changed)


@pytest.mark.parametrize("effect", effects_of(AbstractSensorFault))
def test_what_a_sensor_shows_of_a_real_signal_is_real(
    effect: AbstractSensorFault, numbers: dict[str, float]
) -> None:
    """Its transfer at a negative frequency is the conjugate one, and it takes frequencies of any shape."""
    p, frequency = as_values(numbers), np.array([[0.0, 0.3, 2.35], [6.0, 54.0, 300.0]])
    there, back = (np.asarray(effect.transfer(p, sign * frequency)) for sign in (1.0, -1.0))
    assert there.shape == frequency.shape
    assert there.dtype == np.complex128
    np.testing.assert_allclose(back, there.conj(), rtol=1e-15)
    assert there[0, 0].imag == 0.0
    single = np.asarray(effect.transfer(p, frequency[1, 0]))
    assert single == there[1, 0]
