"""The model against the same rig taken apart: poses, forces, reactions, accelerations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.kinematics import Linkage, linkage, strut_length
from savgs_ident.plants.quarter_car.plant import Loads, QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from .free_body import Drive, FreeBodies, State
from .instants import as_values, draw_instants, inputs_of, motion_of, shifted

FORCE = 5e3
"""Size of the forces in the rig [N]: what a difference is measured by."""


class Seen(NamedTuple):
    """What the model says of an instant."""

    residual: Array
    loads: Loads
    pose: Linkage
    length: Array


@dataclass(frozen=True)
class Case:
    """A rig, an instant (10,), a stretch of the rail's bristle [m]."""

    bodies: FreeBodies
    numbers: dict[str, float]
    instant: NDArray[np.float64]
    stretch: float

    @property
    def state(self) -> State:
        return self.bodies.state(*self.instant[:4])

    @property
    def drive(self) -> Drive:
        return Drive(*self.instant[6:])


def _damper(rig: Rig, c_sd: float) -> Callable[[float], float]:
    curve = PchipInterpolator(rig.damper_velocity, rig.damper_force)

    def power(amplitude: float) -> float:
        phase = (np.arange(100_000) + 0.5) / 100_000 * 2.0 * np.pi
        speed = amplitude * np.sin(phase)
        return float(np.mean(curve(speed) * speed))

    scale = c_sd * 0.15**2 / 2.0 / power(0.15)
    return lambda velocity: float(curve(velocity)) * scale


def _case(rig: Rig, numbers: dict[str, float], seed: int) -> Case:
    moved = shifted(numbers, seed)
    rng = np.random.default_rng([seed, 1])
    limit = moved["mu_r"] * FORCE / moved["k_pre"]
    bodies = FreeBodies(moved, _damper(rig, moved["c_sd"]))
    return Case(bodies, moved, draw_instants(seed, 1)[0], limit * rng.uniform(-1.5, 1.5))


@pytest.fixture(scope="module")
def cases(rig: Rig, numbers: dict[str, float]) -> list[Case]:
    """Sixty rigs at sixty instants."""
    return [_case(rig, numbers, seed) for seed in range(60)]


Look = Callable[[dict[str, float], NDArray[np.float64], float], Seen]


def _look(model: QuarterCar) -> Look:
    states = len(model.states)

    @jax.jit
    def look(p: Values, instant: Array, stretch: Array) -> Seen:
        motion, inputs = motion_of(instant), inputs_of(instant)
        s = jnp.stack([motion.q.z_s - stretch] * states) if states else jnp.zeros(0)
        return Seen(
            model.residual(p, motion, s, jnp.zeros(states), inputs),
            model.loads(p, motion, s, jnp.zeros_like(s), inputs),
            linkage(p, motion.q.theta_LW),
            strut_length(p, motion.q.theta_LW, inputs.link.angle),
        )

    return lambda numbers, instant, stretch: look(as_values(numbers), instant, np.float64(stretch))


FRICTIONLESS = {"mu_r": 0.0, "mu_t": 0.0}
"""With these SimTR is SimQC, to the last digit: the contract of the effects says so."""


@pytest.fixture(scope="module")
def look_simtr(simtr: QuarterCar) -> Look:
    """A view of SimTR, compiled once."""
    return _look(simtr)


@pytest.fixture(scope="module")
def look_simqc(look_simtr: Look) -> Look:
    """A view of SimQC."""
    return lambda numbers, instant, stretch: look_simtr(numbers | FRICTIONLESS, instant, stretch)


@pytest.fixture(scope="module")
def seen_simqc(look_simqc: Look, cases: list[Case]) -> list[Seen]:
    """What SimQC says of every case."""
    return [look_simqc(case.numbers, case.instant, case.stretch) for case in cases]


@pytest.fixture(scope="module")
def seen_simtr(look_simtr: Look, cases: list[Case]) -> list[Seen]:
    """What SimTR says of every case."""
    return [look_simtr(case.numbers, case.instant, case.stretch) for case in cases]


def test_the_cases_lift_off_and_press_stick_and_slide(cases: list[Case], seen_simtr: list[Seen]) -> None:
    loads = [seen.loads for seen in seen_simtr]
    pressed = [float(load.vertical) > 0.0 for load in loads]
    limits = [case.numbers["mu_r"] * float(load.carriage) for case, load in zip(cases, loads, strict=True)]
    slides = [abs(float(load.rail)) > (1 - 1e-9) * limit for load, limit in zip(loads, limits, strict=True)]
    scrubs = [abs(float(seen.loads.touch.lateral_velocity)) for seen in seen_simtr]
    assert 5 <= sum(slides) <= 55
    assert 30 <= sum(pressed) <= 55
    assert any(scrub > case.numbers["ydot_Hth"] for scrub, case in zip(scrubs, cases, strict=True))


def _pose_after(case: Case, seconds: float) -> NDArray[np.float64]:
    """The pose of the separate bodies a moment after the instant."""
    place, rate, acceleration = case.instant[:6].reshape(3, 2)
    return case.bodies.state(*(place + seconds * rate + seconds**2 / 2.0 * acceleration), 0.0, 0.0).pose


def test_the_separate_bodies_move_as_their_velocities_and_accelerations_say(cases: list[Case]) -> None:
    step = 1e-4
    for case in cases[:10]:
        before, now, after = (_pose_after(case, seconds) for seconds in (-step, 0.0, step))
        velocity, acceleration = (after - before) / (2.0 * step), (after - 2.0 * now + before) / step**2
        state = case.state
        assert np.max(np.abs(velocity - state.velocity)) < 1e-5
        assert np.max(np.abs(acceleration - case.bodies.acceleration(state, *case.instant[4:6]))) < 1e-4


def test_the_linkage_is_where_the_pins_put_it(cases: list[Case], seen_simqc: list[Seen]) -> None:
    for case, seen in zip(cases, seen_simqc, strict=True):
        bodies, state = case.bodies, case.state
        origin = np.array([0.0, case.instant[0]])
        for name, body in (("W", "K"), ("E", "L"), ("cg_L", "L"), ("cg_U", "U"), ("cg_K", "K")):
            drawn = np.array([case.numbers[f"{name}_y"], case.numbers[f"{name}_z"]])
            found = np.asarray(getattr(seen.pose, name)) + origin
            assert found == pytest.approx(bodies.place(state.pose, body, drawn), abs=1e-13)
        rolls = [float(seen.pose.roll_L), float(seen.pose.roll_U), float(seen.pose.roll_K)]
        assert rolls == pytest.approx(state.pose[[5, 8, 11]], abs=1e-13)


def test_strut_and_contact_are_those_of_the_separate_bodies(
    cases: list[Case], seen_simqc: list[Seen]
) -> None:
    for case, seen in zip(cases, seen_simqc, strict=True):
        state = case.state
        length, rate, _ = case.bodies.strut(state, case.drive)
        place, compression, compression_rate, tilt = case.bodies.contact(state, case.drive)
        scrub = case.bodies.velocity_of(state, "K", place)[0]
        assert float(seen.length) == pytest.approx(length, abs=1e-13)
        assert float(seen.loads.strut_rate) == pytest.approx(rate, abs=1e-12)
        touch = seen.loads.touch
        origin = np.array([0.0, case.instant[0]])
        assert np.asarray(touch.place) + origin == pytest.approx(place, abs=1e-12)
        found = [touch.compression, touch.compression_rate, touch.lateral_velocity]
        assert [float(x) for x in found] == pytest.approx([compression, compression_rate, scrub], abs=1e-12)
        assert float(touch.cos_tilt) == pytest.approx(np.cos(tilt), abs=1e-13)


def test_the_motion_needs_what_the_separate_bodies_need(cases: list[Case], seen_simqc: list[Seen]) -> None:
    """At any accelerations: what is out of balance in the model is what drives would have to add."""
    for case, seen in zip(cases, seen_simqc, strict=True):
        answer = case.bodies.inverse(case.state, case.drive, *case.instant[4:6], mu_t=0.0)
        assert np.asarray(seen.residual[:2]) == pytest.approx([-answer.lift, -answer.swing], abs=1e-9 * FORCE)


@pytest.mark.parametrize("friction", [False, True], ids=["simqc", "simtr"])
def test_the_rail_holds_what_it_holds_of_the_separate_bodies(
    cases: list[Case], seen_simqc: list[Seen], seen_simtr: list[Seen], friction: bool
) -> None:
    """F_Ny, M_Nx and the carriages' loads, friction of the tyre included, at any accelerations."""
    for case, seen in zip(cases, seen_simtr if friction else seen_simqc, strict=True):
        mu_t = case.numbers["mu_t"] if friction else 0.0
        answer = case.bodies.inverse(case.state, case.drive, *case.instant[4:6], mu_t=mu_t)
        assert np.asarray(seen.loads.reaction) == pytest.approx(
            [answer.lateral, answer.roll], abs=1e-9 * FORCE
        )
        load = case.bodies.carriage_load(answer.lateral, answer.roll)
        assert float(seen.loads.carriage) == pytest.approx(load, abs=1e-9 * FORCE)


def test_the_frictions_are_those_of_the_separate_bodies(cases: list[Case], seen_simtr: list[Seen]) -> None:
    for case, seen in zip(cases, seen_simtr, strict=True):
        state, bodies = case.state, case.bodies
        load, lateral, _ = bodies.tyre(state, case.drive, case.numbers["mu_t"])
        answer = bodies.inverse(state, case.drive, *case.instant[4:6], mu_t=case.numbers["mu_t"])
        carriage = bodies.carriage_load(answer.lateral, answer.roll)
        rail = bodies.rail_friction(case.stretch, case.instant[2], carriage)
        found = [float(x) for x in (seen.loads.vertical, seen.loads.lateral, seen.loads.rail)]
        assert found == pytest.approx([load, lateral, rail], abs=1e-9 * FORCE)
        assert np.asarray(seen.residual[:2]) == pytest.approx(
            [rail - answer.lift, -answer.swing], abs=1e-9 * FORCE
        )


@pytest.mark.parametrize("friction", [False, True], ids=["simqc", "simtr"])
def test_the_rig_accelerates_as_the_separate_bodies_do(
    cases: list[Case], look_simqc: Look, look_simtr: Look, friction: bool
) -> None:
    """The free accelerations of pins and rail by Lagrange multipliers leave nothing out of balance."""
    for case in cases:
        mu_t, stretch = (case.numbers["mu_t"], case.stretch) if friction else (0.0, None)
        accelerations = case.bodies.forward(case.state, case.drive, mu_t, stretch)
        free = np.concatenate([case.instant[:4], accelerations, case.instant[6:]])
        seen = (look_simtr if friction else look_simqc)(case.numbers, free, case.stretch)
        assert np.max(np.abs(seen.residual[:2])) < 1e-9 * FORCE
