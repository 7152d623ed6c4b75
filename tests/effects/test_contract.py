"""What every effect of the catalogue says of itself: one that is added is tested at once."""

import inspect
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

import savgs_ident.effects.laws
from savgs_ident.core.parameter import ParameterTable, merge_parameters
from savgs_ident.core.transforms import identified_bijection
from savgs_ident.effects.base import (
    AbstractLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    Port,
)
from savgs_ident.effects.effect import LAWS, Effect
from savgs_ident.plants.parameter_toml import KNOWN_UNITS
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, build_model, model_parameters
from savgs_ident.plants.quarter_car.ports import PORTS
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from ..plants.quarter_car.instants import as_values
from .kinds import KINDS, effects_of

NO_LAWS = {"__init__"}


def test_every_law_is_in_a_file_of_the_folder_and_in_a_name_of_the_catalogue_or_generic() -> None:
    folder = Path(savgs_ident.effects.laws.__file__).parent
    files = {path.stem for path in folder.glob("*.py")} - NO_LAWS
    homes = {Path(inspect.getfile(type(law))).stem for law in LAWS}
    assert files == homes
    assert {type(effect.law) for effect in CATALOGUE.values()} <= {type(law) for law in LAWS}
    assert all(name == effect.name for name, effect in CATALOGUE.items())


@over("law", LAWS, ids=lambda law: type(law).__name__)
def test_a_law_says_what_it_is(law: AbstractLaw) -> None:
    module = inspect.getmodule(type(law))
    assert module is not None
    said = module.__doc__ or ""
    assert "\n    " in said, "there is no formula"
    assert "Source: " in said
    assert sum(isinstance(law, kind) for kind in KINDS) == 1
    names = [role.name for role in law.roles]
    assert len(set(names)) == len(names)
    assert any(role.null is not None for role in law.roles)
    assert {role for role, _ in law.tried(Port("any", law.kind, "any"))} <= set(names)


def test_something_that_swings_is_looked_for_at_frequencies_no_further_apart_than_it_is_wide() -> None:
    """Of those of a rig's body; the half-power bandwidth of a resonance is twice its damping ratio."""
    effect = CATALOGUE["body_oscillator"]
    width = 2.0 * ParameterTable(effect.parameters)["body_oscillator_damping_ratio"].value
    frequency = np.array([each["body_oscillator_frequency"] for each in effect.tried])
    assert np.max(np.diff(frequency) / frequency[:-1]) <= width
    assert frequency[0] < 1.0 < 30.0 < frequency[-1]


@over("effect", effects_of())
def test_an_effect_says_how_it_shows_and_where_it_is_from(effect: Effect) -> None:
    assert len(effect.symptom.split()) > 3
    assert "\n" not in effect.symptom
    assert effect.reference.strip()
    assert effect.port in {port.name: replace(port, location=effect.port.location) for port in PORTS}.values()


@over("effect", effects_of())
def test_its_parameters_have_units_bounds_and_a_scale(effect: Effect) -> None:
    names = [parameter.name for parameter in effect.parameters]
    assert len(set(names)) == len(names) > 0
    for parameter in effect.parameters:
        assert parameter.unit in KNOWN_UNITS, parameter.name
        assert parameter.about, parameter.name
        assert parameter.lower < parameter.upper
        assert parameter.lower > -inf or parameter.upper < inf or parameter.tolerance > 0.0, parameter.name
        identified_bijection(parameter)  # Refuses a parameter whose scale nothing gives.


@over("effect", effects_of())
def test_its_null_is_within_its_bounds_and_not_where_it_starts(effect: Effect) -> None:
    table = ParameterTable(effect.parameters)
    assert effect.null
    table.with_values(effect.null)  # Refuses a null that is no parameter or out of its bounds.
    for name, value in effect.null.items():
        assert value != table[name].value
        assert table[name].lower < table[name].value < table[name].upper


@over("effect", effects_of())
def test_its_states_have_names_units_and_scales(effect: Effect) -> None:
    assert len({state.name for state in effect.states}) == len(effect.states)
    for state in effect.states:
        assert state.name
        assert state.unit in KNOWN_UNITS
        assert state.scale > 0.0


def test_no_two_effects_mean_different_things_by_one_name(rig: Rig) -> None:
    tables = [ParameterTable(effect.parameters) for effect in CATALOGUE.values()]
    names = [name for table in tables for name in table]
    assert len(set(names)) == len(names)
    assert set(names) <= set(merge_parameters(rig.parameters, *tables))
    assert set(model_parameters(rig, CATALOGUE)) == {*rig.parameters, *names}
    states = [state.name for state in build_model(rig, CATALOGUE).states]
    assert len(set(states)) == len(states)


@over("effect", effects_of(AbstractNumberLaw))
def test_a_change_is_of_numbers_of_the_rig_and_leaves_it_one(
    effect: Effect, rig: Rig, numbers: dict[str, float]
) -> None:
    """Anywhere within its own bounds the changed numbers stay within those of the sheet."""
    for parameter in effect.parameters:
        for value in (parameter.lower, parameter.value, parameter.upper):
            changed = effect.changes(as_values(numbers | {parameter.name: value}))
            assert set(changed) <= set(rig.parameters)
            rig.parameters.with_values({name: float(number) for name, number in changed.items()})
            assert value == 0.0 or any(changed[name] != numbers[name] for name in changed)


@over("effect", effects_of(AbstractSensorLaw))
def test_what_a_sensor_shows_of_a_real_signal_is_real(effect: Effect, numbers: dict[str, float]) -> None:
    """Its transfer at a negative frequency is the conjugate one, and it takes frequencies of any shape."""
    p, frequency = as_values(numbers), np.array([[0.0, 0.3, 2.35], [6.0, 54.0, 300.0]])
    there, back = (np.asarray(effect.transfer(p, sign * frequency)) for sign in (1.0, -1.0))
    assert there.shape == frequency.shape
    assert there.dtype == np.complex128
    np.testing.assert_allclose(back, there.conj(), rtol=1e-15)
    assert there[0, 0].imag == 0.0
    single = np.asarray(effect.transfer(p, frequency[1, 0]))
    assert single == there[1, 0]
