"""What every effect of the catalogue keeps, whichever it is: an effect that is added is tested at once.

Forces are tested along a periodic motion of the port, through which the effect's internal states are marched
until they repeat: so they are where they come to in use, sticking and sliding, and the energy of a cycle is
that of the force alone.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

import savgs_ident.effects
from savgs_ident.core.bijection import identified_bijection
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig, merge_parameters
from savgs_ident.core.rig_form import UNIT_OF
from savgs_ident.effects.registry import CATALOGUE, build_model, model_parameters
from savgs_ident.model.effect import AbstractEffect, Port, PortSignals
from savgs_ident.model.quarter_car import HANDLED_PORTS, QuarterCar
from savgs_ident.model.values import Values

from ..model.instants import all_parameters, as_values, draw_instants, inputs_of, motion_of
from ..model.primitives import MAPPABLE, primitives_of

EFFECTS = [pytest.param(effect, id=name) for name, effect in CATALOGUE.items()]
STATEFUL = [pytest.param(effect, id=name) for name, effect in CATALOGUE.items() if effect.states]
FOLDER = Path(savgs_ident.effects.__file__).parent
NO_EFFECTS = {"__init__", "registry"}

CENTRE = {Port.STRUT: 0.45, Port.TYRE_RADIAL: 0.013, Port.TYRE_LATERAL: 0.65}
"""About where a port's displacement is [m]; elsewhere zero."""

INTO_THE_RIG = {Port.TYRE_RADIAL: -1.0}
"""Power into the rig per force and velocity, where it is not 1."""

NODES, PERIODS = 2048, 2


@dataclass(frozen=True)
class Cycle:
    """A periodic motion of a port, and an effect's states along it, (NODES, ...)."""

    step: float
    displacement: NDArray[np.float64]
    velocity: NDArray[np.float64]
    load: NDArray[np.float64]
    state: NDArray[np.float64]

    def signals(self) -> PortSignals:
        return PortSignals(jnp.asarray(self.displacement), jnp.asarray(self.velocity), jnp.asarray(self.load))


def _motion(port: Port, seed: int, frequency: float = 1.7) -> Cycle:
    rng = np.random.default_rng(seed)
    phase = 2.0 * np.pi * np.arange(NODES) / NODES
    order = np.arange(1, 4)[:, None]
    waves = (
        rng.standard_normal((3, 1)) / order**2 * np.exp(1j * (order * phase + rng.uniform(0, 6.3, (3, 1))))
    )
    amplitude = 0.01 / np.max(np.abs(np.sum(waves.real, axis=0)))
    displacement = CENTRE.get(port, 0.0) + amplitude * np.sum(waves.real, axis=0)
    velocity = amplitude * 2.0 * np.pi * frequency * np.sum((1j * order * waves).real, axis=0)
    load = 3000.0 * (1.0 + 0.6 * np.sin(phase + rng.uniform(0, 6.3)) + 0.3 * np.sin(3 * phase))
    return Cycle(1.0 / frequency / NODES, displacement, velocity, load, np.zeros((NODES, 0)))


@eqx.filter_jit
def _march(effect: AbstractEffect, p: Values, signals: PortSignals, start: Array, step: Array) -> Array:
    """States along a cycle by backward Euler, which is stable for every rate there may be."""

    def advance(state: Array, at: PortSignals) -> tuple[Array, Array]:
        def defect(now: Array) -> Array:
            return now - state - step * effect.rate(p, at, now)

        now = state
        for _ in range(4):
            now = now - jnp.linalg.solve(jax.jacfwd(defect)(now), defect(now))
        return now, now

    return jax.lax.scan(advance, start, signals)[1]


def _cycle(effect: AbstractEffect, p: Values, seed: int) -> Cycle:
    cycle = _motion(effect.port, seed)
    start = jnp.zeros(len(effect.states))
    if not effect.states:
        return cycle
    for _ in range(PERIODS):
        along = _march(effect, p, cycle.signals(), start, jnp.asarray(cycle.step))
        start = along[-1]
    return Cycle(cycle.step, cycle.displacement, cycle.velocity, cycle.load, np.asarray(along))


@eqx.filter_jit
def _forces_and_rates(effect: AbstractEffect, p: Values, signals: PortSignals, state: Array) -> Array:
    """Force and rates along a cycle, (NODES, 1 + states)."""

    def at(signals: PortSignals, state: Array) -> Array:
        return jnp.concatenate([effect.force(p, signals, state)[None], effect.rate(p, signals, state)])

    return jax.vmap(at)(signals, state)


@eqx.filter_jit
def _slopes(
    effect: AbstractEffect, p: Values, direction: Values, signals: PortSignals, state: Array
) -> Array:
    return jax.jvp(lambda q: _forces_and_rates(effect, q, signals, state), (p,), (direction,))[1]


@pytest.fixture(scope="module")
def numbers(rig: Rig) -> dict[str, float]:
    """All parameters of the rig and of the catalogue, SI."""
    return all_parameters(rig).as_dict()


def test_every_file_of_the_folder_is_in_the_catalogue_under_its_name() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - NO_EFFECTS
    homes = {Path(inspect.getfile(type(effect))).stem for effect in CATALOGUE.values()}
    assert files == set(CATALOGUE) == homes
    assert all(name == effect.name for name, effect in CATALOGUE.items())


def test_every_effect_has_a_test_of_its_own_physics() -> None:
    here = {path.stem for path in Path(__file__).parent.glob("test_*.py")}
    assert {f"test_{name}" for name in CATALOGUE} <= here


@pytest.mark.parametrize("effect", EFFECTS)
def test_it_says_what_it_is(effect: AbstractEffect) -> None:
    module = inspect.getmodule(type(effect))
    assert module is not None
    assert len((module.__doc__ or "").split()) > 20
    assert (type(effect).__doc__ or "").strip()
    assert len(effect.symptom.split()) > 3
    assert "\n" not in effect.symptom
    assert effect.reference.strip()
    assert effect.port in HANDLED_PORTS


@pytest.mark.parametrize("effect", EFFECTS)
def test_its_parameters_have_units_bounds_and_a_scale(effect: AbstractEffect) -> None:
    names = [parameter.name for parameter in effect.parameters]
    assert len(set(names)) == len(names) > 0
    for parameter in effect.parameters:
        assert parameter.unit in set(UNIT_OF.values()), parameter.name
        assert parameter.about, parameter.name
        assert parameter.lower < parameter.upper
        assert parameter.lower > -inf or parameter.upper < inf or parameter.tolerance > 0.0, parameter.name
        identified_bijection(parameter)  # Refuses a parameter whose scale nothing tells.
    table = ParameterTable(effect.parameters)
    assert effect.null
    table.with_values(effect.null)  # Refuses a null that is no parameter or out of its bounds.


@pytest.mark.parametrize("effect", STATEFUL)
def test_its_states_have_names_units_and_scales(effect: AbstractEffect) -> None:
    assert len({state.name for state in effect.states}) == len(effect.states)
    for state in effect.states:
        assert state.name
        assert state.unit in {*UNIT_OF.values(), "m", "m/s", "N", "1"}
        assert state.scale > 0.0


def test_no_two_effects_mean_different_things_by_one_name(rig: Rig) -> None:
    tables = [ParameterTable(effect.parameters) for effect in CATALOGUE.values()]
    names = [name for table in tables for name in table]
    assert len(set(names)) == len(names)
    assert set(names) <= set(merge_parameters(rig.parameters, *tables))
    assert set(model_parameters(rig, CATALOGUE)) == {*rig.parameters, *names}


@eqx.filter_jit
def _residuals(model: QuarterCar, p: Values, instants: Array, s: Array) -> Array:
    def at(instant: Array) -> Array:
        return model.residual(p, motion_of(instant), s, jnp.zeros_like(s), inputs_of(instant))

    return jax.vmap(at)(instants)


@pytest.fixture(scope="module")
def bare(rig: Rig, numbers: dict[str, float]) -> NDArray[np.float64]:
    """Residuals of the rig without any effect, (20, 2)."""
    model = build_model(rig, ())
    return np.asarray(_residuals(model, as_values(numbers), jnp.asarray(draw_instants(2, 20)), jnp.zeros(0)))


@pytest.mark.parametrize("effect", EFFECTS)
def test_at_its_null_it_changes_nothing(
    effect: AbstractEffect, rig: Rig, numbers: dict[str, float], bare: NDArray[np.float64]
) -> None:
    """Whatever its states are."""
    model, instants = build_model(rig, ()) + effect, jnp.asarray(draw_instants(2, 20))
    rng = np.random.default_rng(3)
    for scale in (0.0, 1.0):
        s = jnp.asarray([scale * state.scale * rng.standard_normal() for state in effect.states], float)
        null = np.asarray(_residuals(model, as_values(numbers | dict(effect.null)), instants, s))
        assert np.array_equal(null[:, :2], bare)
        there = np.asarray(_residuals(model, as_values(numbers), instants, s))
        assert not np.array_equal(there[:, :2], bare)


@pytest.mark.parametrize("effect", EFFECTS)
def test_force_and_rates_are_one_number_per_force_and_state(
    effect: AbstractEffect, numbers: dict[str, float]
) -> None:
    signals = PortSignals(*(jnp.asarray(value) for value in (0.01, 0.2, 3000.0)))
    state = jnp.zeros(len(effect.states))
    force, rate = effect.force(numbers, signals, state), effect.rate(numbers, signals, state)
    assert (force.shape, force.dtype) == ((), jnp.float64)
    assert (rate.shape, rate.dtype) == ((len(effect.states),), jnp.float64)


Difference = Callable[[float], NDArray[np.float64]]


def _central(at: Difference, step: float) -> NDArray[np.float64]:
    return (at(step) - at(-step)) / (2.0 * step)


def _into_the_bounds(at: Difference, step: float) -> NDArray[np.float64]:
    return (4.0 * at(step) - at(2.0 * step) - 3.0 * at(0.0)) / (2.0 * step)


@pytest.mark.parametrize("place", ["value", "null"])
@pytest.mark.parametrize("effect", EFFECTS)
def test_derivatives_in_its_parameters_are_those_of_differences(
    effect: AbstractEffect, numbers: dict[str, float], place: str
) -> None:
    """Along a cycle, off the few points at which a law changes within the difference.

    On a bound the difference goes inwards.
    """
    here = numbers | (dict(effect.null) if place == "null" else {})
    cycle = _cycle(effect, as_values(numbers), seed=5)
    still = as_values(dict.fromkeys(numbers, 0.0))
    state = jnp.asarray(cycle.state)
    for parameter in effect.parameters:
        value = here[parameter.name]
        room = (abs(parameter.value) or parameter.tolerance or parameter.upper - parameter.lower) * 1e-5
        inwards = 1.0 if value - room < parameter.lower else -1.0
        off_bounds = parameter.lower <= value - room and value + room <= parameter.upper

        def at(offset: float, name: str = parameter.name, value: float = value) -> NDArray[np.float64]:
            moved = as_values(here | {name: value + offset})
            return np.asarray(_forces_and_rates(effect, moved, cycle.signals(), state))

        difference = _central if off_bounds else _into_the_bounds
        expected, nearer = (difference(at, inwards * step) for step in (room, room / 2.0))
        direction = still | {parameter.name: np.asarray(1.0)}
        found = np.asarray(_slopes(effect, as_values(here), direction, cycle.signals(), state))
        size = np.max(np.abs(expected), axis=0) + 1e-9 * np.max(np.abs(at(0.0)), axis=0) / room
        smooth = np.abs(expected - nearer) <= 1e-6 * size
        assert np.mean(smooth) > 0.98, parameter.name
        assert np.all(
            np.abs(found - expected)[smooth] <= np.broadcast_to(1e-5 * size, found.shape)[smooth]
        ), parameter.name


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("effect", EFFECTS)
def test_it_adds_no_energy_over_a_cycle(effect: AbstractEffect, numbers: dict[str, float], seed: int) -> None:
    """Power of the force into the rig, with its internal states back where they were."""
    p = as_values(numbers)
    cycle = _cycle(effect, p, seed)
    if effect.states:
        scale = np.array([state.scale for state in effect.states])
        again = _march(effect, p, cycle.signals(), jnp.asarray(cycle.state[-1]), jnp.asarray(cycle.step))
        assert np.max(np.abs(np.asarray(again)[-1] - cycle.state[-1]) / scale) < 1e-6
    force = np.asarray(_forces_and_rates(effect, p, cycle.signals(), jnp.asarray(cycle.state)))[:, 0]
    power = INTO_THE_RIG.get(effect.port, 1.0) * force * cycle.velocity
    assert np.max(np.abs(power)) > 0.0
    assert np.mean(power) <= 1e-4 * np.mean(np.abs(power))


@pytest.mark.parametrize("effect", EFFECTS)
def test_it_is_made_of_what_can_be_translated(effect: AbstractEffect, numbers: dict[str, float]) -> None:
    signals = PortSignals(*(np.float64(value) for value in (0.01, 0.2, 3000.0)))
    state = np.zeros(len(effect.states))
    for law in (effect.force, effect.rate):
        assert set(primitives_of(law, as_values(numbers), signals, state)) <= MAPPABLE
