"""What the closed loop does where it cannot be followed or believed: it says so, and shows no number for it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.control.closed_loop.laws import make_failure
from savgs_ident.control.closed_loop.programme import RideGain, compare_rides, doubted_from, measure_ride
from savgs_ident.control.closed_loop.run import Loop, loop_case, run_loop, steps_within
from savgs_ident.control.closed_loop.study import RigOutcome, loop_around, study_loop
from savgs_ident.control.design import DigitalController, controller_for
from savgs_ident.control.generalised_plant import DEFAULT_WEIGHTS
from savgs_ident.control.linear_equivalent import AlphaMap
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import NO_ORIGIN, no_progress
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.report.control.loop_text import alarm, rigs_words, saturation_words

from ..in_one_test import over
from .loops import cam, ideal, passive, ran, with_changed

TEST = cam(2.0)


def _nominal(alpha: AlphaMap) -> Array:
    return alpha.nominal


@over(
    ("period", "effect", "steps"),
    [(1e-3, None, 1), (1e-4, None, 1), (2e-3, None, 2), (5e-2, None, 50), (1e-3, "plate_compliance", 6)],
)
def test_a_step_follows_the_fastest_decay(rig: Rig, period: float, effect: str | None, steps: int) -> None:
    """At most 1 ms, and 0.2 ms where something gives way within 0.02 ms."""
    names = MODELS["simtr"] if effect is None else (*MODELS["simtr"], effect)
    assert steps_within(build_model(rig, names), period) == steps


@pytest.mark.slow
def test_a_slow_controller_is_followed_as_closely(friction: QuarterCar, numbers: Values, loop: Loop) -> None:
    """At 100 Hz, ten steps from sample to sample; in one step a sliding bristle would grow without bound."""
    slow = loop_around(numbers, controller_for(friction, numbers, DEFAULT_WEIGHTS, 100.0))
    # That holds the link, at whatever rate.
    held, active = (
        measure_ride(ran(friction, numbers, TEST, each), TEST) for each in (passive(loop, numbers), slow)
    )
    assert held.stable
    assert active.stable
    gain = compare_rides(held, active)
    assert gain.sprung_accel > 35.0
    assert gain.susp_deflection > 15.0


@pytest.mark.parametrize("name", ["accel_lag", "deflection_gain", "cam_harmonic"])
def test_errors_of_the_test_bench_are_refused(rig: Rig, loop: Loop, name: str) -> None:
    names = (*MODELS["simtr"], name)
    p = as_values(model_parameters(rig, names).as_dict())
    with pytest.raises(InputError, match=f"test bench cannot be part of a closed loop: {name}"):
        loop_case(build_model(rig, names), p, TEST.road, loop, TEST.duration)


@pytest.mark.slow
def test_the_law_sees_what_the_sensors_show(friction: QuarterCar, numbers: Values, loop: Loop) -> None:
    """An accelerometer without gain is one that shows zero."""
    quiet = ideal(loop)
    deaf = ran(friction, with_changed(numbers, accel_gain=0.0), TEST, quiet)
    lost = ran(friction, numbers, TEST, quiet._replace(failure=make_failure("accelerometer", 0.0)))
    assert np.asarray(deaf.signals.asked) == pytest.approx(np.asarray(lost.signals.asked), abs=1e-9)
    assert np.std(deaf.signals.sprung_accel) > 0.1


@pytest.mark.slow
def test_a_motion_beyond_the_linkage_is_none(friction: QuarterCar, numbers: Values, loop: Loop) -> None:
    run = run_loop(friction, numbers, cam(2.0, 0.4).road, passive(loop, numbers), TEST.duration)
    assert run.status is Status.NOT_FINITE
    assert not measure_ride(run, TEST).stable


@pytest.mark.slow
def test_a_law_that_begins_at_another_angle_says_that_it_doubts(
    friction: QuarterCar, numbers: Values, loop: Loop
) -> None:
    moved = eqx.tree_at(lambda law: _nominal(law.alpha), loop.law, jnp.asarray(np.pi / 2.0 + 0.1))
    run = ran(friction, numbers, TEST, loop._replace(law=moved))
    assert doubted_from(run) == 0.0
    assert np.max(np.abs(np.asarray(run.signals.asked))) == 0.0
    assert doubted_from(ran(friction, numbers, TEST, loop)) is None
    lost = ran(friction, numbers, TEST, loop._replace(failure=make_failure("encoder", 6.0)))
    assert doubted_from(lost) == pytest.approx(6.0, abs=2e-3)


def test_a_controller_of_another_link_angle_is_refused(rig: Rig, controller: DigitalController) -> None:
    moved = replace(controller, alpha=eqx.tree_at(_nominal, controller.alpha, jnp.asarray(np.radians(80.0))))
    with pytest.raises(InputError, match="designed for a link at 80 deg, and the rig's stands at 90 deg"):
        study_loop(RigModel(rig, MODELS["simtr"]), moved, "moved", TEST, NO_ORIGIN, no_progress)


def _study(**given: Any) -> Any:
    ended, at_rest = SimpleNamespace(status=Status.CONVERGED), SimpleNamespace(stable=True)
    usual = {"passive": ended, "active": ended, "passive_ride": at_rest, "active_ride": at_rest}
    return SimpleNamespace(**usual | {"doubted_from": None, "on_rigs": ()} | given)


def test_what_is_wrong_is_reported_in_its_own_words() -> None:
    lost, moving = SimpleNamespace(status=Status.NOT_FINITE), SimpleNamespace(stable=False)
    assert alarm(_study()) == ""
    assert alarm(_study(passive=lost, passive_ride=moving)).startswith("The passive rig leaves the travel")
    assert alarm(_study(active=lost, active_ride=moving)).startswith("The loop leaves the travel")
    assert alarm(_study(active_ride=moving)).startswith("The loop is not stable on this rig")
    assert alarm(_study(doubted_from=1.5)).startswith("From 1.5 s on the control law rejected")
    assert alarm(_study(on_rigs=(moving, SimpleNamespace(stable=True)))).endswith(
        "1 of 2 rigs that the data allow."
    )
    assert saturation_words(_study(active=lost, drive=None)).startswith("What the drive did is not known")


def test_the_gain_on_other_rigs_is_that_of_the_runs_that_ended() -> None:
    ended = RigOutcome(RideGain(40.0, 30.0, 5.0), True, Status.CONVERGED)
    lost = RigOutcome(RideGain(np.nan, np.nan, np.nan), False, Status.NOT_FINITE)
    words = rigs_words(_study(rigs=SimpleNamespace(source="as drawn"), on_rigs=(ended, lost)))
    assert words.startswith("Stable on 1 of 2 (as drawn); the acceleration falls by 40.0 to 40.0 %")
    assert rigs_words(_study(rigs=SimpleNamespace(source="as drawn"), on_rigs=(lost,))).endswith(
        "(as drawn)."
    )
