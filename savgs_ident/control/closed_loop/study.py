"""A test of the closed loop as a whole: passive and active, failures, other rigs, causes.

Friction, the limits of the drive, the instruments and the changing alpha separate a linear prediction from the
rig. To measure how much each matters, :func:`measure_causes` repeats the test without one of them at a time,
passive and active, with the same controller.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from savgs_ident.control.closed_loop.laws import (
    KINDS,
    NOTHING,
    HinfLaw,
    hinf_law,
    hold_law,
    ideal_instruments,
    make_failure,
    sheet_instruments,
)
from savgs_ident.control.closed_loop.programme import (
    DriveUse,
    LoopTest,
    Ride,
    RideGain,
    compare_rides,
    doubted_from,
    drive_use,
    measure_ride,
    ride_after,
)
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Loop, run_loop
from savgs_ident.control.design import DigitalController, Rigs
from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import Origin, Progress, Result
from savgs_ident.core.status import Status, joint_status
from savgs_ident.core.values import Values, as_values
from savgs_ident.plants.quarter_car.catalogue import EFFECTS
from savgs_ident.plants.quarter_car.model import RigModel
from savgs_ident.plants.quarter_car.plant import QuarterCar

SAME_ANGLE = 0.01
"""Tolerance between the nominal link angles of rig and controller [deg]."""


@dataclass(frozen=True)
class FailedRun:
    """A run with a failure, and the ride from the failure on."""

    kind: str
    run: ClosedLoopRun
    ride: Ride


@dataclass(frozen=True)
class RigOutcome:
    """The gain of the loop on one rig of a set, whether both runs are stable, and how their integration ended."""

    gain: RideGain
    stable: bool
    status: Status


@dataclass(frozen=True)
class Cause:
    """A variant and the gain of the loop in it."""

    variant: str
    gain: RideGain


@dataclass(frozen=True)
class LoopStudy(Result):
    """The results of a test.

    Attributes:
        model: what it was run on.
        controller: which controller it was, in words.
        test: the test.
        passive, active: the runs.
        passive_ride, active_ride: the ride in them.
        passive_after, active_after: the ride after the instant at which something fails in other runs.
        gain: the active rig against the passive one.
        drive: the use of the drive.
        failures: one run for each kind of failure.
        rigs: the other rigs on which the loop was run; None for none.
        on_rigs: the results there.
        causes: the gains without one imperfection at a time; empty if not requested.
    """

    presenter: ClassVar[str] = "LOOP_STUDY"

    model: RigModel
    controller: str
    test: LoopTest
    passive: ClosedLoopRun
    active: ClosedLoopRun
    passive_ride: Ride
    active_ride: Ride
    passive_after: Ride
    active_after: Ride
    gain: RideGain
    drive: DriveUse
    failures: tuple[FailedRun, ...]
    rigs: Rigs | None
    on_rigs: tuple[RigOutcome, ...]
    causes: tuple[Cause, ...]

    @property
    def stable(self) -> bool:
        """Whether the loop is stable on the rig and on all other rigs, passive and active."""
        both = self.passive_ride.stable and self.active_ride.stable
        return both and all(each.stable for each in self.on_rigs)

    @property
    def trusted(self) -> bool:
        """Whether it is stable, and the law was active all the time."""
        return self.stable and self.doubted_from is None

    @property
    def doubted_from(self) -> float | None:
        """When the law rejected the link angle although nothing failed [s]; None if it never did."""
        return doubted_from(self.active)


def study_loop(
    model: RigModel,
    controller: DigitalController,
    called: str,
    test: LoopTest,
    origin: Origin,
    progress: Progress,
    rigs: Rigs | None = None,
    causes: bool = False,
) -> LoopStudy:
    """Run a test of a controller, which is ``called`` so in words, on a rig, with each failure, and on ``rigs``.

    Raises :class:`InputError` if the controller was designed for another nominal link angle, and as
    :func:`savgs_ident.control.closed_loop.run.loop_case` does.
    """
    plant, p = model.build(), as_values(model.table.as_dict())
    _check_angle(p, controller)
    loop = loop_around(p, controller)
    hold = loop._replace(law=hold_law(p["psi_nominal"], loop.rate))

    def simulate(values: Values, around: Loop) -> ClosedLoopRun:
        return run_loop(plant, values, test.road, around, test.duration)

    progress(f"passive: {test.title}")
    passive = simulate(p, hold)
    progress(f"active: {test.title}")
    active = simulate(p, loop)
    before, after = measure_ride(passive, test), measure_ride(active, test)
    failures = []
    for kind in (kind for kind in KINDS if kind != NOTHING):
        progress(f"failure: {KINDS[kind].about}")
        run = simulate(p, loop._replace(failure=make_failure(kind, test.fails_at)))
        failures.append(FailedRun(kind, run, ride_after(run, test)))
    others = []
    for number, values in enumerate(rigs.values if rigs else ()):
        progress(f"rig {number + 1} of {len(rigs.values) if rigs else 0}")
        others.append(_on_rig(as_values(values), simulate, hold, loop, test))
    found: list[Cause] = []
    if causes:
        for cause in measure_causes(plant, p, hinf_law(controller), loop, test):
            progress(f"cause: {cause.variant}")
            found.append(cause)
    return LoopStudy(
        model=model,
        controller=called,
        test=test,
        passive=passive,
        active=active,
        passive_ride=before,
        active_ride=after,
        passive_after=ride_after(passive, test),
        active_after=ride_after(active, test),
        gain=compare_rides(before, after),
        drive=drive_use(active, test, p),
        failures=tuple(failures),
        rigs=rigs,
        on_rigs=tuple(others),
        causes=tuple(found),
        origin=origin,
    )


def _check_angle(p: Values, controller: DigitalController) -> None:
    nominal, designed = (float(np.degrees(each)) for each in (p["psi_nominal"], controller.alpha.nominal))
    if abs(nominal - designed) > SAME_ANGLE:
        raise InputError(
            f"the controller was designed for a link at {designed:g} deg, and the rig's stands at {nominal:g} deg",
            remedy="design a controller for this rig",
        )


def _on_rig(
    values: Values, simulate: Callable[[Values, Loop], ClosedLoopRun], hold: Loop, loop: Loop, test: LoopTest
) -> RigOutcome:
    runs = [simulate(values, around) for around in (hold, loop)]
    passive, active = (measure_ride(run, test) for run in runs)
    return RigOutcome(
        compare_rides(passive, active),
        passive.stable and active.stable,
        joint_status(run.status for run in runs),
    )


def loop_around(p: Values, controller: DigitalController) -> Loop:
    """A controller with the instruments of the data sheet, without failures."""
    instruments = sheet_instruments(float(p["motor_gear_ratio"]))
    return Loop(hinf_law(controller), instruments, make_failure(NOTHING, 0.0), controller.rate)


UNLIMITED = 10.0
"""Factor on the limits of the drive in the variant without limits [1]."""
_LIMITS = ("motor_speed_limit", "motor_peak_torque", "motor_peak_power", "motor_dc_bus")


def measure_causes(model: QuarterCar, p: Values, law: HinfLaw, loop: Loop, test: LoopTest) -> Iterator[Cause]:
    """Run the variants one after the other; ``loop`` is that of the rig as it is, ``law`` its law."""
    for variant, values, changed in _variants(model, p, law, loop):
        hold = changed._replace(law=hold_law(p["psi_nominal"], loop.rate))
        passive, active = (
            measure_ride(run_loop(model, values, test.road, each, test.duration), test)
            for each in (hold, changed)
        )
        yield Cause(variant, compare_rides(passive, active))


def _variants(model: QuarterCar, p: Values, law: HinfLaw, loop: Loop) -> Iterator[tuple[str, Values, Loop]]:
    # Effects at their null and limits out of reach rather than other models: one compiled program serves all
    # variants.
    nulls = {effect.name: EFFECTS[effect.name].null for effect in model.effects}
    every = {name: jnp.asarray(value, jnp.float64) for null in nulls.values() for name, value in null.items()}
    unlimited = {name: UNLIMITED * p[name] for name in _LIMITS}
    nominal = law.alpha.alpha(law.alpha.nominal)
    constant = jnp.zeros_like(law.alpha.coefficients).at[0].set(nominal)
    with_constant = eqx.tree_at(lambda each: each.alpha.coefficients, law, constant)
    ideal = loop._replace(instruments=ideal_instruments())
    yield "the rig as it is", p, loop
    for name, null in nulls.items():
        without = {key: jnp.asarray(value, jnp.float64) for key, value in null.items()}
        yield f"without {name}", {**p, **without}, loop
    if len(nulls) > 1:
        yield "without all of these", {**p, **every}, loop
    yield "a drive without limits", {**p, **unlimited}, loop
    yield "ideal instruments", p, ideal
    yield "alpha taken as constant by the law", p, loop._replace(law=with_constant)
    yield "without effects, limits and noise", {**p, **every, **unlimited}, ideal
