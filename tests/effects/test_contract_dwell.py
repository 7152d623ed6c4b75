"""The catalogue in a dwell: the periodic solution and the transient agree, and what is at its null does nothing.

That of all effects none does anything at its null is seen at single instants, in :mod:`.test_contract_model`.
"""

from collections.abc import Iterable, Iterator

import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.inputs import RigSource, cam_excitation, cam_road, held_link
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.periodic import PeriodicSolution, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import PlantState, simulate_transient, unpack_state

from ..relaxed import with_kept_programs
from .kinds import KINDS, effects_of

LIFT, LINK, HERTZ = 0.0275, np.pi / 2.0, 2.35
PERIODS, SAMPLES, ORDERS = 30, 512, 9
STAYING = 4
"""Periods after which a motion that is not the periodic one has left it."""

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

AT_THE_BODY = ("rail", "suspension", "strut", "damper")
"""Ports between the body and the wheel; the others are at the link, at the tyre and below."""


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


def _periodic(model: QuarterCar, p: Values) -> tuple[PeriodicSolution, NDArray[np.complex128]]:
    """The dwell's solution, and its harmonics 1..ORDERS, (2, ORDERS)."""
    solution = simulate_periodic(model, p, cam_excitation([HERTZ], LIFT, LINK))
    assert all(status.ok for status in solution.status())
    return solution, np.asarray(harmonics(model, p, solution, ORDERS))[0, :, 1:]


def _transient(
    model: QuarterCar, p: Values, start: PlantState | None = None, periods: int = PERIODS
) -> NDArray[np.complex128]:
    """The same of the last but one of some periods: sensors know nothing of what follows the last.

    From rest, on a cam whose lift grows, or from a state ``start`` where the cam is highest.
    """
    times = np.arange(periods * SAMPLES + 1) / (HERTZ * SAMPLES)
    road = cam_road(LIFT, HERTZ, rise_time=1.0 if start is None else 0.0)
    solution = simulate_transient(model, p, RigSource(road, held_link(LINK)), times, start)
    assert solution.status().ok
    shown = np.stack(solution.readings)[:, (periods - 2) * SAMPLES : (periods - 1) * SAMPLES]
    return 2.0 * np.fft.rfft(shown, axis=1)[:, 1 : ORDERS + 1] / SAMPLES


def _where_the_cam_is_highest(model: QuarterCar, solution: PeriodicSolution) -> PlantState:
    """The state of a dwell at phase 0."""
    phase = np.asarray(solution.mesh.phase)
    state = [np.interp(0.0, phase, each, period=2.0 * np.pi) for each in np.asarray(solution.trajectory.x)]
    return unpack_state(model, jnp.asarray(state))


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
@pytest.mark.parametrize("at_the_body", [True, False], ids=["at the body", "elsewhere"])
def test_effects_with_states_at_all_places_together_stay_in_the_periodic_motion(
    rig: Rig, at_the_body: bool
) -> None:
    model, p = _bench(
        rig,
        [
            effect.name
            for effect in AT_EACH_PLACE.values()
            if effect.states and (effect.port.name in AT_THE_BODY) == at_the_body
        ],
    )
    solution, expected = _periodic(model, p)
    start = _where_the_cam_is_highest(model, solution)
    assert _differ(_transient(model, p, start, STAYING), expected) < 1e-3
