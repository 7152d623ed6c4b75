"""The catalogue in a dwell: the periodic solution and the transient agree, and what is at its null does nothing."""

from collections.abc import Iterable, Iterator

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import AbstractSeriesLaw
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.inputs import RigSource, cam_excitation, cam_road, held_link
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSettings, PeriodicSolution, harmonics, simulate_periodic
from savgs_ident.simulate.transient import simulate_transient

from ..relaxed import with_kept_programs
from .kinds import KINDS, effects_of

LIFT, LINK, HERTZ = 0.0275, np.pi / 2.0, 2.35
PERIODS, SAMPLES, ORDERS = 30, 512, 9
SAME_NODES = PeriodicSettings(adaptations=0)
"""Nodes that do not follow a search which has more unknowns, at their null though they are."""

OF_ALL_KINDS = (
    *MODELS["simtr"],
    "rail_stribeck",
    "mount_compliance",
    "spring_rate",
    "cam_harmonic",
    "accel_lag",
)
"""One of each kind at least."""


AT_EACH_PLACE = {
    (effect.port.name, type(effect.law).__bases__[0], bool(effect.states)): effect
    for effect in effects_of()
    if effect.name not in OF_ALL_KINDS
}
"""Of the others one for each place in the equations: a port, a kind of law there, with or without states of its own.

What a law computes is compared for every one in :mod:`.test_contract_laws`.
"""


@pytest.fixture(scope="module", autouse=True)
def _as_users_have_it() -> Iterator[None]:
    with with_kept_programs():
        yield


def _bench(rig: Rig, names: Iterable[str]) -> tuple[QuarterCar, Values]:
    """SimTR and some effects, at their values."""
    names = tuple(dict.fromkeys((*MODELS["simtr"], *names)))
    return build_model(rig, names), as_values(model_parameters(rig, names).as_dict())


def _at_null(p: Values, names: Iterable[str]) -> Values:
    """With some effects at their null."""
    return dict(p) | {
        each: jnp.asarray(value) for name in names for each, value in CATALOGUE[name].null.items()
    }


def _periodic(
    model: QuarterCar, p: Values, settings: PeriodicSettings | None = None
) -> tuple[PeriodicSolution, NDArray[np.complex128]]:
    """The dwell's solution, and its harmonics 1..ORDERS, (2, ORDERS)."""
    solution = simulate_periodic(model, p, cam_excitation([HERTZ], LIFT, LINK), settings)
    assert all(status.ok for status in solution.status())
    return solution, np.asarray(harmonics(model, p, solution, ORDERS))[0, :, 1:]


def _transient(model: QuarterCar, p: Values) -> NDArray[np.complex128]:
    """The same of the last but one of some periods from rest: sensors know nothing of what follows the last."""
    times = np.arange(PERIODS * SAMPLES + 1) / (HERTZ * SAMPLES)
    road = cam_road(LIFT, HERTZ, settle=1.0)
    solution = simulate_transient(model, p, RigSource(road, held_link(LINK)), times)
    assert solution.status().ok
    shown = np.stack(solution.readings)[:, (PERIODS - 2) * SAMPLES : (PERIODS - 1) * SAMPLES]
    return 2.0 * np.fft.rfft(shown, axis=1)[:, 1 : ORDERS + 1] / SAMPLES


def _differ(found: NDArray[np.complex128], wanted: NDArray[np.complex128]) -> float:
    """Largest difference of any order, relative to the first of its channel."""
    return float(np.max(np.abs(found - wanted) / np.abs(wanted[:, :1])))


def test_there_is_one_of_each_kind() -> None:
    assert all(any(isinstance(CATALOGUE[name].law, kind) for name in OF_ALL_KINDS) for kind in KINDS)


@pytest.mark.slow
def test_effects_of_all_kinds_together_end_in_the_periodic_motion(rig: Rig) -> None:
    """And with all but the frictions of SimTR at their null it is that of SimTR."""
    model, p = _bench(rig, OF_ALL_KINDS)
    together = _periodic(model, p)[1]
    assert _differ(_transient(model, p), together) < 1e-3
    simtr = _periodic(*_bench(rig, ()))[1]
    found = _periodic(model, _at_null(p, set(OF_ALL_KINDS) - set(MODELS["simtr"])))[1]
    assert _differ(found, simtr) < 1e-9
    assert _differ(together, simtr) > 0.01


@pytest.mark.slow
def test_effects_without_states_at_all_places_together_end_in_the_periodic_motion(rig: Rig) -> None:
    model, p = _bench(rig, [effect.name for effect in AT_EACH_PLACE.values() if not effect.states])
    assert _differ(_transient(model, p), _periodic(model, p)[1]) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [effect for effect in AT_EACH_PLACE.values() if effect.states],
    ids=lambda effect: effect.name,
)
def test_an_effect_with_states_ends_in_its_periodic_motion(effect: Effect, rig: Rig) -> None:
    model, p = _bench(rig, [effect.name])
    assert _differ(_transient(model, p), _periodic(model, p)[1]) < 1e-3


@pytest.mark.slow
def test_the_whole_catalogue_at_its_null_is_simtr(rig: Rig) -> None:
    """Every yield is nought all along."""
    model, p = _bench(rig, CATALOGUE)
    at_null = _at_null(p, set(CATALOGUE) - set(MODELS["simtr"]))
    solution, found = _periodic(model, at_null, SAME_NODES)
    assert _differ(found, _periodic(*_bench(rig, ()), SAME_NODES)[1]) < 1e-9
    given = [effect for effect in CATALOGUE.values() if isinstance(effect.law, AbstractSeriesLaw)]
    yields = {state.name for effect in given for state in effect.states}
    for place, state in enumerate(model.states):
        if state.name in yields:
            along = np.asarray(solution.trajectory.x[4 + place])
            assert np.max(np.abs(along)) < 1e-10 * state.scale, state.name
