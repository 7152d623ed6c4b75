"""Tests that do not begin at rest: the states with which they begin, against an exact motion."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

import savgs_ident as si
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import as_values
from savgs_ident.inference.beginnings import Begun, compared_response, settle_beginnings
from savgs_ident.inference.problem import ProblemSettings, harmonic_target, whitened
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, Recording
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSettings, resolve, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import changes_of_beginnings
from tests.simulate.linear_roads import NOISE, RATE, READINGS, campaign, linear_readings, recording_of

TRUTH = {"k": 1.03 * PARAMETERS["k"].value, "c": 0.93 * PARAMETERS["c"].value}
RELEASED = {
    "release_up": (0.012, 0.004, 0.0, 0.0),
    "release_down": (-0.018, -0.002, 0.05, -0.1),
}
"""Heights of body and wheel [m] and their speeds [m/s] where decays begin."""


def free_motion(start: tuple[float, ...], time: NDArray[np.float64], **other: float) -> NDArray[np.float64]:
    """Acceleration of the body [m/s^2] and deflection [m], (2, n), of two masses that nothing drives."""
    p = PARAMETERS.as_dict() | other
    k, c, kt, ct, ms, mu = (p[name] for name in ("k", "c", "k_t", "c_t", "m_s", "m_u"))
    body, wheel = np.array([-k, k, -c, c]) / ms, np.array([k, -k - kt, c, -c - ct]) / mu
    a = np.stack([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0], body, wheel])
    step, states = expm(a * (time[1] - time[0])), [np.array(start)]
    for _ in time[1:]:
        states.append(step @ states[-1])
    found = np.array(states).T
    return np.stack([body @ found, found[1] - found[0]])


def decay(
    name: str, start: tuple[float, ...], seconds: float, held: float = 0.0, **other: float
) -> Recording:
    """A decay after so much time in which the rig is held [s]; the plate was not recorded."""
    time = np.arange(round(seconds * RATE)) / RATE
    random = np.random.default_rng(len(name))
    moving = free_motion(start, time, **other)
    still = np.array([[0.0], [moving[1, 0]]]) * np.ones(round(held * RATE))
    whole = np.concatenate([still, moving], axis=1)
    values = {
        each: row + NOISE[each] * random.standard_normal(row.size)
        for each, row in zip(READINGS, whole, strict=True)
    }
    return recording_of(name, "decay", np.arange(whole.shape[1]) / RATE, values)


def decays(**other: float) -> Campaign:
    random = np.random.default_rng(5)
    still = {name: sd * random.standard_normal(2000) for name, sd in NOISE.items()}
    rest = recording_of("standstill", "standstill", np.arange(2000) / RATE, still)
    tests = [decay(name, start, 5.0, **other) for name, start in RELEASED.items()]
    return Campaign("made", (*tests, rest), (), "")


@pytest.fixture(scope="module")
def model() -> si.PlantModel:
    return si.PlantModel(TwoMass(), PARAMETERS)


@pytest.fixture(scope="module")
def as_it_is(model: si.PlantModel) -> HarmonicResponse:
    return compared_response(decays(), model, 9)


def test_states_with_which_decays_begin_are_found(as_it_is: HarmonicResponse) -> None:
    assert as_it_is.tests == ("release_up, 0.0 to 5.0 s", "release_down, 0.0 to 5.0 s")
    known = as_it_is.beginnings
    assert known is not None
    target = harmonic_target(replace(as_it_is, beginnings=None), TwoMass.channels, 9)
    rows = np.asarray(target(jnp.zeros_like(target.measured))).reshape(2, -1)
    by_test = whitened(np.asarray(target.whitening), known.changes)
    for shown, columns, found, truth in zip(rows, by_test, known.states, RELEASED.values(), strict=True):
        off = found - np.array(truth)
        # Of the noise four numbers are made up for.
        assert np.linalg.norm(columns @ off) < 4.0
        assert np.linalg.norm(columns @ np.array(truth)) > 0.9 * np.linalg.norm(shown) > 500.0


def test_what_another_beginning_changes_is_what_differences_say(
    model: si.PlantModel, as_it_is: HarmonicResponse
) -> None:
    plant, p = model.build() + si.generic_effects(TwoMass.ports)["guide_preload"], model.table.as_dict()
    values = as_values(p | {"guide_preload_force": 20.0})
    begun = Begun.of_response(as_it_is, plant, 9)
    solution = simulate_periodic(plant, values, measured_excitation(plant, as_it_is, model.table))
    changes = np.asarray(changes_of_beginnings(plant, values, solution, 40, 4))
    z, step = begun.of(solution), 1e-4
    for state in range(4):
        # The first test begins otherwise: the second stays as it is.
        shift = np.zeros(z.size)
        shift[state] = step
        ahead, behind = (
            np.asarray(
                harmonics(plant, values, resolve(plant, values, begun.beginning(solution, z + each)), 40)
            )
            for each in (shift, -shift)
        )
        difference = (ahead - behind) / (2.0 * step * begun.sizes[state])
        assert np.max(np.abs(difference[1])) < 1e-8 * np.max(np.abs(difference[0]))
        off = np.abs(difference - changes[..., state])[0].max(axis=-1)
        assert np.all(off < 1e-4 * np.abs(difference[0]).max(axis=-1))


def test_residuals_say_nothing_in_the_directions_of_beginnings(
    model: si.PlantModel, as_it_is: HarmonicResponse
) -> None:
    target = harmonic_target(as_it_is, TwoMass.channels, 9)
    assert target.silent is not None
    np.testing.assert_allclose(target.silent.T @ target.silent, np.eye(8), atol=1e-12)
    assert as_it_is.beginnings is not None
    moved = target.measured + jnp.asarray(as_it_is.beginnings.changes @ np.array([1e-3, 2e-3, 0.1, -0.2]))
    np.testing.assert_allclose(target(moved), target(target.measured), atol=1e-6)
    free = eqx.tree_at(lambda each: each.silent, target, None, is_leaf=lambda each: each is None)
    assert np.linalg.norm(free(moved)) > 10.0
    assert target.entries == free.entries - 8


def test_a_fit_to_decays_finds_the_parameters(model: si.PlantModel) -> None:
    found = si.fit(model, decays(**TRUTH), ("k", "c"))
    assert found.trusted
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 4.0 * found[name].stderr
        assert found[name].stderr < 0.1 * value
    assert found.chi2 < 1.4 * found.dof


def test_parameters_and_beginnings_are_settled_together(model: si.PlantModel) -> None:
    given = compared_response(decays(**TRUTH), model, 9)
    settled = settle_beginnings(given, model, ("k", "c"), ProblemSettings())
    assert settled.response.beginnings is not None
    assert given.beginnings is not None
    heights = np.array([start[0] for start in RELEASED.values()])
    off, before = (
        np.max(np.abs(each.beginnings.states[:, 0] - heights)) for each in (settled.response, given)
    )
    assert off < 3e-4 < before


def test_a_decay_begins_where_the_rig_is_let_go(model: si.PlantModel) -> None:
    held = decay("release_up", RELEASED["release_up"], 4.0, held=1.5)
    found = compared_response(Campaign("made", (held,), (), ""), model, 9)
    assert found.beginnings is not None
    np.testing.assert_allclose(
        found.beginnings.states[0, :2], RELEASED["release_up"][:2], rtol=0.1, atol=3e-4
    )


def test_a_short_road_is_compared_from_its_beginning(model: si.PlantModel) -> None:
    road = campaign(seconds=9.0)
    late = [
        recording_of(
            "road_c",
            "road",
            np.arange(1250) / RATE,
            {name: each.values[2000:3250] for name, each in road.recordings[0].channels.items()},
        ),
        road.recordings[1],
    ]
    found = si.fit(model, Campaign("made", tuple(late), (), ""), ("k", "c"))
    assert found.measured.tests == ("road_c, 0.0 to 2.5 s",)
    assert found.trusted
    for name in ("k", "c"):
        assert abs(found[name].value - PARAMETERS[name].value) < 4.0 * found[name].stderr


def test_of_a_plant_that_forgets_nothing_tests_may_begin_moving() -> None:
    ringing = si.PlantModel(TwoMass(), PARAMETERS.with_values({"c": 40.0, "c_t": 0.0}))
    time = np.arange(8000) / RATE
    plate = 2e-3 * np.sin(2.0 * np.pi * (0.8 + 0.1 * time) * time)
    kept = slice(3000, 7000)
    values = dict(zip(READINGS, linear_readings(time, plate, c=40.0, c_t=0.0), strict=True))
    values = {name: each[kept] for name, each in ({"road_height": plate} | values).items()}
    made = Campaign("made", (recording_of("road_a", "road", time[kept] - time[3000], values),), (), "")
    found = compared_response(made, ringing, 9)
    assert found.tests == ("road_a, 0.0 to 8.0 s",)
    plant, p = ringing.build(), as_values(ringing.table.as_dict())
    excitation = measured_excitation(plant, found, ringing.table)
    solution = simulate_periodic(plant, p, excitation, PeriodicSettings(window_rate=2160.0))
    places = [found.channel(name) for name in READINGS]
    kept_orders = found.valid[0, places]
    predicted = np.asarray(harmonics(plant, p, solution, found.orders))[0]
    for recorded, seen, used in zip(found.harmonics[0, places], predicted, kept_orders, strict=True):
        assert np.linalg.norm((recorded - seen)[used]) < 5e-3 * np.linalg.norm(recorded[used])


def test_a_decay_in_which_nothing_moves_is_refused(model: si.PlantModel) -> None:
    with pytest.raises(InputError):
        compared_response(
            Campaign("made", (decay("release_up", (0.0, 0.0, 0.0, 0.0), 0.2),), (), ""), model, 9
        )
