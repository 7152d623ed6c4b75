"""Why a loop does what it does: the same test with one imperfection taken away at a time.

Friction, the drive's limits, the instruments and the changing alpha stand between a linear prediction and the rig.
Each variant runs without one of them, passive and active, with the same controller; the differences are measured
causes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp

from savgs_ident.control.closed_loop.instruments import ideal_instruments
from savgs_ident.control.closed_loop.laws import HinfLaw, hold_law
from savgs_ident.control.closed_loop.metrics import Gain, gain_of, ride_of
from savgs_ident.control.closed_loop.programme import LoopTest
from savgs_ident.control.closed_loop.run import Loop, run_loop
from savgs_ident.effects.registry import EFFECTS
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values

UNLIMITED = 10.0
"""By how much the drive's limits are raised where it is to have none."""

_LIMITS = ("motor_speed_limit", "motor_peak_torque", "motor_peak_power", "motor_dc_bus")


@dataclass(frozen=True)
class Cause:
    """A variant in words, and what the loop gains there."""

    variant: str
    gain: Gain


def measure_causes(model: QuarterCar, p: Values, law: HinfLaw, loop: Loop, test: LoopTest) -> Iterator[Cause]:
    """The variants one after the other; ``loop`` is that of the rig as it is, ``law`` its law."""
    for variant, values, changed in _variants(model, p, law, loop):
        hold = changed._replace(law=hold_law(p["psi_nominal"], loop.rate))
        passive, active = (
            ride_of(run_loop(model, values, test.road, each, test.duration), test) for each in (hold, changed)
        )
        yield Cause(variant, gain_of(passive, active))


def _variants(model: QuarterCar, p: Values, law: HinfLaw, loop: Loop) -> Iterator[tuple[str, Values, Loop]]:
    # Parameters at their null and limits out of reach, not other models: the same compiled program serves all.
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
