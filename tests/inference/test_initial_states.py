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
from savgs_ident.inference.initial_states import FreeInitialStates, compared_motion, settle_initial_states
from savgs_ident.inference.observations import Data, spanned
from savgs_ident.inference.problem import ProblemSettings
from savgs_ident.inference.targets import harmonic_target, whitened
from savgs_ident.plants.base import state_sizes
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.recordings.recording import Campaign, Recording, classify_test
from savgs_ident.responses.even_record import is_decay
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.responses.windows import estimate_windows
from savgs_ident.simulate.compared_tests import response_of_tests
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSettings, resolve, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.sensitivity import changes_by_initial_states
from tests.simulate.linear_roads import INPUTS, NOISE, RATE, READINGS, campaign, linear_readings, recording_of

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
    return compared_motion(decays(), model, 9)[0]


def test_states_with_which_decays_begin_are_found(as_it_is: HarmonicResponse) -> None:
    assert as_it_is.tests == ("release_up, 0.0 to 5.0 s", "release_down, 0.0 to 5.0 s")
    known = as_it_is.initial_states
    assert known is not None
    target = harmonic_target(replace(as_it_is, initial_states=None), TwoMass.channels, 9)
    sizes = state_sizes(TwoMass())
    rows = np.asarray(target(jnp.zeros_like(target.measured))).reshape(2, -1)
    by_test = whitened(np.asarray(target.whitening), known.changes)
    for shown, columns, found, truth in zip(rows, by_test, known.states, RELEASED.values(), strict=True):
        off = (found - np.array(truth)) / sizes
        # Of the noise four numbers are made up for.
        assert np.linalg.norm(columns @ off) < 4.0
        assert np.linalg.norm(columns @ (np.array(truth) / sizes)) > 0.9 * np.linalg.norm(shown) > 500.0


def test_what_other_initial_states_change_is_what_differences_say(
    model: si.PlantModel, as_it_is: HarmonicResponse
) -> None:
    plant, p = model.build() + si.generic_effects(TwoMass.ports)["guide_preload"], model.table.as_dict()
    values = as_values(p | {"guide_preload_force": 20.0})
    free = FreeInitialStates.of_response(as_it_is, plant, 9)
    solution = simulate_periodic(plant, values, measured_excitation(plant, as_it_is, model.table))
    changes, sizes = np.asarray(changes_by_initial_states(plant, values, solution, 40, 4)), state_sizes(plant)
    z, step = free.of(plant, solution), 2e-5
    for state in range(4):
        # The first test begins otherwise: the second stays as it is.
        shift = np.zeros(z.size)
        shift[state] = step
        ahead, behind = (
            np.asarray(
                harmonics(
                    plant, values, resolve(plant, values, free.beginning(plant, solution, z + each)), 40
                )
            )
            for each in (shift, -shift)
        )
        difference = (ahead - behind) / (2.0 * step * sizes[state])
        assert np.max(np.abs(difference[1])) < 1e-8 * np.max(np.abs(difference[0]))
        off = np.abs(difference - changes[..., state])[0].max(axis=-1)
        assert np.all(off < 1e-4 * np.abs(difference[0]).max(axis=-1))


def test_residuals_say_nothing_of_initial_states(model: si.PlantModel, as_it_is: HarmonicResponse) -> None:
    target = harmonic_target(as_it_is, TwoMass.channels, 9)
    assert target.nuisance is not None
    np.testing.assert_allclose(target.nuisance.T @ target.nuisance, np.eye(12), atol=1e-12)
    assert as_it_is.initial_states is not None
    moved = target.measured + jnp.asarray(as_it_is.initial_states.changes @ np.array([0.1, 0.2, 0.3, -0.2]))
    np.testing.assert_allclose(target(moved), target(target.measured), atol=1e-6)
    free = eqx.tree_at(lambda each: each.nuisance, target, None, is_leaf=lambda each: each is None)
    assert np.linalg.norm(free(moved)) > 10.0
    # Four states and the offsets of two sensors in either test.
    assert target.entries == free.entries - 12


def test_a_fit_to_decays_finds_the_parameters(model: si.PlantModel) -> None:
    found = si.fit(model, decays(**TRUTH), ("k", "c"))
    assert found.trusted
    for name, value in TRUTH.items():
        assert abs(found[name].value - value) < 4.0 * found[name].stderr
        assert found[name].stderr < 0.1 * value
    assert found.chi2 < 1.4 * found.dof


def test_parameters_and_initial_states_are_settled_together(model: si.PlantModel) -> None:
    given, _ = compared_motion(decays(**TRUTH), model, 9)
    settled = settle_initial_states(given, model, ("k", "c"), ProblemSettings())
    assert settled.response.initial_states is not None
    assert given.initial_states is not None
    heights = np.array([start[0] for start in RELEASED.values()])
    off, before = (
        np.max(np.abs(each.initial_states.states[:, 0] - heights)) for each in (settled.response, given)
    )
    assert off < 3e-4 < before


def test_a_decay_begins_where_the_rig_is_let_go(model: si.PlantModel) -> None:
    held = decay("release_up", RELEASED["release_up"], 4.0, held=1.5)
    found, _ = compared_motion(Campaign("made", (held,), (), ""), model, 9)
    assert found.initial_states is not None
    np.testing.assert_allclose(
        found.initial_states.states[0, :2], RELEASED["release_up"][:2], rtol=0.1, atol=3e-4
    )


@pytest.mark.slow
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


@pytest.mark.slow
def test_of_a_plant_that_forgets_nothing_tests_may_begin_moving() -> None:
    ringing = si.PlantModel(TwoMass(), PARAMETERS.with_values({"c": 40.0, "c_t": 0.0}))
    time = np.arange(8000) / RATE
    plate = 2e-3 * np.sin(2.0 * np.pi * (0.8 + 0.1 * time) * time)
    kept = slice(3000, 7000)
    values = dict(zip(READINGS, linear_readings(time, plate, c=40.0, c_t=0.0), strict=True))
    values = {name: each[kept] for name, each in ({"road_height": plate} | values).items()}
    made = Campaign("made", (recording_of("road_a", "road", time[kept] - time[3000], values),), (), "")
    found, _ = compared_motion(made, ringing, 9)
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
        compared_motion(Campaign("made", (decay("release_up", (0.0, 0.0, 0.0, 0.0), 0.2),), (), ""), model, 9)


def test_a_model_is_compared_from_where_its_own_values_say_that_tests_begin(model: si.PlantModel) -> None:
    made = decays(k=1.3 * PARAMETERS["k"].value, c=0.7 * PARAMETERS["c"].value)
    found = si.fit(model, made, ("k", "c"))
    assert found.trusted
    assert found.model.before.table["k"].value == PARAMETERS["k"].value
    compared = si.compare(found.model, made)
    miss = (compared.measured.harmonics[:, 1:, : compared.used.shape[2]] - compared.model.harmonics)[
        compared.used
    ]
    size = compared.measured.harmonics[:, 1:, : compared.used.shape[2]][compared.used]
    assert np.linalg.norm(miss) < 0.02 * np.linalg.norm(size)


@pytest.mark.slow
def test_a_posterior_of_decays_holds_the_truth(model: si.PlantModel) -> None:
    found = si.sample(si.fit(model, decays(**TRUTH), ("k", "c")), target_ess=200.0)
    assert found.trusted
    for name, value in TRUTH.items():
        assert abs(found[name].median - value) < 4.0 * found[name].sd
    inside, count = found.count_inside
    assert 0.8 * count < inside < count


def test_an_input_that_was_not_recorded_in_a_decay_rests() -> None:
    model = si.load_model()
    time = np.arange(1500) / RATE
    swing = np.exp(-3.0 * time) * np.cos(9.0 * time)
    values = {"sprung_accel": -0.8 * swing, "susp_deflection": 0.01 * swing}
    made = Campaign("made", (recording_of("release_1", "decay", time, values),), (), "")
    found = response_of_tests(made, model.plant, 9)
    excitation = measured_excitation(model.plant, found, model.table)
    rest = model.table["psi_nominal"].value
    assert np.asarray(excitation.harmonics["link_angle"])[0, 0].real == pytest.approx(rest)
    assert not np.asarray(excitation.harmonics["road_height"]).any()


def test_a_test_that_is_called_a_decay_and_driven_is_none() -> None:
    time = np.arange(4000) / RATE
    values = dict(zip(READINGS, linear_readings(time, 2e-3 * np.sin(9.0 * time)), strict=True))
    driven = recording_of("release_1", "decay", time, {"road_height": 2e-3 * np.sin(9.0 * time)} | values)
    assert not is_decay(driven, ("road_height",))
    quiet = recording_of("release_2", "decay", time, {"road_height": np.full(time.size, 0.3)} | values)
    assert is_decay(quiet, ("road_height",))
    assert is_decay(recording_of("release_3", "decay", time, values), ("road_height",))


def test_an_input_of_a_decay_is_what_it_is_after_the_release() -> None:
    time = np.arange(3000) / RATE
    swing = np.where(time < 2.0, 1.0, np.exp(-2.0 * (time - 2.0)) * np.cos(9.0 * (time - 2.0)))
    values = {"road_height": np.where(time < 2.0, 0.1, 0.03), "susp_deflection": 0.01 * swing}
    found = estimate_windows(
        Campaign("made", (recording_of("release_1", "decay", time, values),), (), ""), INPUTS, READINGS
    )
    assert found.harmonics[0, 0, 0].real == pytest.approx(0.03)
    assert found.tests == ("release_1, 2.0 to 6.0 s",)


def test_numbers_of_a_short_test_beside_a_long_one_have_noise_of_their_own() -> None:
    """Drawn again and again, their noise is that of independent numbers."""
    random, seconds = np.random.default_rng(3), (0.6, 12.0)
    drawn = []
    for _ in range(400):
        tests = [
            recording_of(
                f"release_{length:g}",
                "decay",
                np.arange(round(length * RATE)) / RATE,
                {"susp_deflection": random.standard_normal(round(length * RATE))},
            )
            for length in seconds
        ]
        found = estimate_windows(Campaign("made", tuple(tests), (), ""), INPUTS, READINGS)
        place = found.channel("susp_deflection")
        drawn.append(found.harmonics[0, place][found.valid[0, place]])
    numbers = np.array(drawn)
    parts = np.concatenate([numbers.real, numbers.imag], axis=1)
    correlation = np.corrcoef(parts.T)
    np.fill_diagonal(correlation, 0.0)
    assert np.max(np.abs(correlation)) < 0.35


def test_a_short_test_beside_a_long_one_keeps_its_numbers() -> None:
    """Orders that are compared are far apart where a test is long: those of a short one need no more distance."""
    road, _ = campaign(seconds=60.0).recordings
    seconds, time = 2.0, np.arange(round(2.0 * RATE)) / RATE
    values = dict.fromkeys(READINGS, np.random.default_rng(3).standard_normal(time.size))
    tests = (road, recording_of("release_short", "decay", time, values))
    found = estimate_windows(Campaign("made", tests, (), ""), INPUTS, READINGS, highest_hz=15.0)
    (short,) = (place for place, test in enumerate(found.tests) if test.startswith("release_short"))
    kept = found.valid[short, [found.channel(name) for name in READINGS]].sum(axis=1)
    # Two periods of what is compared lie between neighbours.
    assert np.all(kept > 0.6 * 15.0 * seconds / 2.0)


def test_a_motion_that_was_not_found_leaves_other_tests_alone(as_it_is: HarmonicResponse) -> None:
    target = harmonic_target(as_it_is, TwoMass.channels, 9)
    assert target.nuisance is not None
    predicted = np.asarray(target.measured) + 1e-3
    lost = predicted.copy()
    lost[0] = np.nan
    rows, with_lost = (
        np.asarray(target(jnp.asarray(each))).reshape(len(predicted), -1) for each in (predicted, lost)
    )
    assert np.isnan(with_lost[0][target.used[0].repeat(2)]).all()
    np.testing.assert_allclose(with_lost[1], rows[1], atol=1e-9)
    np.testing.assert_allclose(
        target.with_nuisances(lost)[1], target.with_nuisances(predicted)[1], atol=1e-12
    )


def test_what_columns_span_is_the_same_in_any_units() -> None:
    columns = np.random.default_rng(5).standard_normal((12, 3))
    assert spanned(columns * np.array([1e7, 1.0, 1e-7])).shape == (12, 3)
    assert spanned(np.column_stack([columns, columns @ [1.0, 2.0, -1.0], np.zeros(12)])).shape == (12, 3)


def test_so_many_numbers_are_independent_less() -> None:
    random = np.random.default_rng(4)
    nuisance, tolerated = random.standard_normal((30, 3)), random.standard_normal((30, 2))
    data = Data(
        random.standard_normal(30),
        np.exp(random.standard_normal(30)),
        np.abs(random.standard_normal(30)),
        np.zeros(30, np.intp),
        tolerated=tolerated,
        nuisance=nuisance,
    )
    assert data.independent.measured.size == 27
    np.testing.assert_allclose(data.turned(nuisance), 0.0, atol=1e-10)
    noise = np.diag(data.variance) + tolerated @ tolerated.T
    turning = data.turned(np.eye(30))
    np.testing.assert_allclose(turning @ noise @ turning.T, np.eye(27), atol=1e-10)
    made_up = nuisance @ np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(data.explained_by_nuisances(made_up), made_up, atol=1e-10)
    assert data.left_by_nuisances.sum() == pytest.approx(27.0)
    noise_alone = replace(data, tolerated=None)
    drawn = np.sqrt(data.variance)[:, None] * random.standard_normal((30, 20000))
    left = np.var(drawn - noise_alone.explained_by_nuisances(drawn), axis=1) / data.variance
    np.testing.assert_allclose(left, data.left_by_nuisances, atol=0.03)


@pytest.mark.parametrize("name", ["decay_1", "Release up", "pluck-3", "ring_down", "free vibration 2"])
def test_decays_are_known_by_their_names(name: str) -> None:
    assert classify_test(name) == ("decay", None)


def test_offsets_of_sensors_are_no_gap(model: si.PlantModel) -> None:
    made = decays()
    off = {"body_accel": 0.15, "susp_deflection": 6e-4}
    tests = tuple(
        replace(
            test,
            channels={
                name: replace(each, values=each.values + off[name]) for name, each in test.channels.items()
            },
        )
        for test in made.recordings
    )
    plain, shifted = (si.compare(model, replace(made, recordings=each)) for each in (made.recordings, tests))

    def missed(found: si.Comparison) -> float:
        orders = found.used.shape[2]
        off = (found.measured.harmonics[:, 1:, :orders] - found.model.harmonics)[found.used]
        return float(
            np.linalg.norm(off) / np.linalg.norm(found.measured.harmonics[:, 1:, :orders][found.used])
        )

    assert missed(shifted) == pytest.approx(missed(plain), rel=0.05)
    orders, kept = plain.used.shape[2], plain.used
    noise = np.trace(plain.measured.covariance[:, 1:, :orders], axis1=-2, axis2=-1)[kept].sum()
    size = np.sum(np.abs(plain.measured.harmonics[:, 1:, :orders][kept]) ** 2)
    assert missed(plain) < 1.3 * np.sqrt(noise / size)
