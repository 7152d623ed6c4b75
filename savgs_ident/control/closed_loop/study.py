"""A test of the closed loop as a whole: passive and active, failures, other rigs, causes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from savgs_ident.control.closed_loop.causes import Cause, measure_causes
from savgs_ident.control.closed_loop.failure import KINDS, NOTHING, failing
from savgs_ident.control.closed_loop.instruments import sheet_instruments
from savgs_ident.control.closed_loop.laws import hinf_law, hold_law
from savgs_ident.control.closed_loop.metrics import (
    DriveUse,
    Gain,
    Ride,
    doubted_from,
    drive_use,
    gain_of,
    ride_after,
    ride_of,
)
from savgs_ident.control.closed_loop.programme import LoopTest
from savgs_ident.control.closed_loop.run import ClosedLoopRun, Loop, run_loop
from savgs_ident.control.controller_file import DigitalController
from savgs_ident.control.rigs import Rigs
from savgs_ident.core.errors import InputError
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values

SAME_ANGLE = 0.01
"""Within this two nominal link angles are the same [deg]."""


@dataclass(frozen=True)
class Failed:
    """A run in which something failed, and how the rig rode from then on."""

    kind: str
    run: ClosedLoopRun
    ride: Ride


@dataclass(frozen=True)
class OnRig:
    """What the loop gains on one rig of a set, and whether it is stable there, passive and active."""

    gain: Gain
    stable: bool


@dataclass(frozen=True)
class LoopStudy:
    """A test with all that was found.

    Attributes:
        test: the test.
        passive, active: the runs.
        passive_ride, active_ride: how the rig rode in them.
        passive_after, active_after: how it rode from the time on at which something fails in other runs.
        gain: the active rig against the passive one.
        drive: what the drive did.
        failures: one run for each kind of failure.
        rigs: the set of rigs that the loop was tried on; None if on no other.
        on_rigs: how it did there.
        causes: what stands between prediction and rig; empty if that was not asked for.
    """

    test: LoopTest
    passive: ClosedLoopRun
    active: ClosedLoopRun
    passive_ride: Ride
    active_ride: Ride
    passive_after: Ride
    active_after: Ride
    gain: Gain
    drive: DriveUse
    failures: tuple[Failed, ...]
    rigs: Rigs | None
    on_rigs: tuple[OnRig, ...]
    causes: tuple[Cause, ...]

    @property
    def stable(self) -> bool:
        """Whether the loop is stable on the rig and on all others that it was tried on, passive and active."""
        both = self.passive_ride.stable and self.active_ride.stable
        return both and all(each.stable for each in self.on_rigs)

    @property
    def trusted(self) -> bool:
        """Whether it is stable, and the law was at work all of the time."""
        return self.stable and self.doubted_from is None

    @property
    def doubted_from(self) -> float | None:
        """When the law ceased to believe the link angle although nothing failed [s]; None if it never did."""
        return doubted_from(self.active)


def loop_around(p: Values, controller: DigitalController) -> Loop:
    """A controller with the instruments of the sheet, nothing failing."""
    instruments = sheet_instruments(float(p["motor_gear_ratio"]))
    return Loop(hinf_law(controller), instruments, failing(NOTHING, 0.0), controller.rate)


def study_loop(
    model: QuarterCar,
    p: Values,
    controller: DigitalController,
    test: LoopTest,
    progress: Callable[[str], None],
    rigs: Rigs | None = None,
    causes: bool = False,
) -> LoopStudy:
    """Run a test of a controller on a rig, with each failure, and on ``rigs``.

    Raises :class:`InputError` if the controller was designed for another link angle than the rig stands at, and as
    :func:`savgs_ident.control.closed_loop.run.loop_case` does.
    """
    stands, designed = (float(np.degrees(each)) for each in (p["psi_nominal"], controller.alpha.nominal))
    if abs(stands - designed) > SAME_ANGLE:
        raise InputError(
            f"the controller was designed for a link at {designed:g} deg, and the rig's stands at {stands:g} deg",
            remedy="design a controller for this rig",
        )
    loop = loop_around(p, controller)
    hold = loop._replace(law=hold_law(p["psi_nominal"], loop.rate))

    def ran(values: Values, around: Loop) -> ClosedLoopRun:
        return run_loop(model, values, test.road, around, test.duration)

    progress(f"passive: {test.title}")
    passive = ran(p, hold)
    progress(f"active: {test.title}")
    active = ran(p, loop)
    before, after = ride_of(passive, test), ride_of(active, test)
    failures = []
    for kind in (kind for kind in KINDS if kind != NOTHING):
        progress(f"failure: {KINDS[kind].about}")
        run = ran(p, loop._replace(failure=failing(kind, test.fails_at)))
        failures.append(Failed(kind, run, ride_after(run, test)))
    others = []
    for number, values in enumerate(rigs.values if rigs else ()):
        progress(f"rig {number + 1} of {len(rigs.values) if rigs else 0}")
        others.append(_on_rig(as_values(values), ran, hold, loop, test))
    found: list[Cause] = []
    if causes:
        for cause in measure_causes(model, p, hinf_law(controller), loop, test):
            progress(f"cause: {cause.variant}")
            found.append(cause)
    return LoopStudy(
        test,
        passive,
        active,
        before,
        after,
        ride_after(passive, test),
        ride_after(active, test),
        gain_of(before, after),
        drive_use(active, test, p),
        tuple(failures),
        rigs,
        tuple(others),
        tuple(found),
    )


def _on_rig(
    values: Values, ran: Callable[[Values, Loop], ClosedLoopRun], hold: Loop, loop: Loop, test: LoopTest
) -> OnRig:
    passive, active = (ride_of(ran(values, around), test) for around in (hold, loop))
    return OnRig(gain_of(passive, active), passive.stable and active.stable)
