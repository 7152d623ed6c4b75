"""A law the other way round, as it acts at a port that counts its displacement to the other side."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.core.values import as_values
from savgs_ident.effects.base import AbstractForceLaw, PortSignals
from savgs_ident.effects.effect import typical_effect
from savgs_ident.effects.laws.presliding_friction import PreslidingFriction
from savgs_ident.effects.laws.stop import LowerStop, UpperStop
from savgs_ident.effects.laws.viscous import Viscous
from savgs_ident.plants.quarter_car.ports import STRUT
from savgs_ident.validation.foreign_forces import ExponentialStop, HardeningOscillator
from savgs_ident.validation.other_port import estimated, turned

NOTHING = jnp.zeros(0)
SIZES = st.floats(-0.05, 0.05)


def _seen(displacement: float, velocity: float, rest: float) -> PortSignals:
    return PortSignals(*(jnp.asarray(each) for each in (displacement, velocity, 0.0, rest)))


@given(x=SIZES, v=SIZES, rest=SIZES)
def test_a_stop_at_the_lower_end_is_one_at_the_upper_end(x: float, v: float, rest: float) -> None:
    numbers, seen = as_values({"stiffness": 1e5, "gap": 0.01}), _seen(x, v, rest)
    other = turned(LowerStop()).force(numbers, seen, NOTHING)
    assert float(other) == pytest.approx(float(UpperStop().force(numbers, seen, NOTHING)), abs=1e-9)


@pytest.mark.parametrize(
    ("law", "numbers"),
    [
        (ExponentialStop(), {"force": 20.0, "growth": 5e-3}),
        (LowerStop(), {"stiffness": 1e5, "gap": 0.01}),
    ],
)
@given(x=SIZES, rest=SIZES)
def test_turned_twice_it_is_itself(
    law: AbstractForceLaw, numbers: dict[str, float], x: float, rest: float
) -> None:
    seen = _seen(x, 0.1, rest)
    again = turned(turned(law)).force(as_values(numbers), seen, NOTHING)
    assert float(again) == pytest.approx(float(law.force(as_values(numbers), seen, NOTHING)))


def test_what_knows_no_direction_stays_as_it_is() -> None:
    numbers, seen = as_values({"coefficient": 50.0}), _seen(0.01, 0.2, 0.0)
    damper = Viscous()
    numbers = as_values(dict.fromkeys((role.name for role in damper.roles), 50.0))
    assert float(turned(damper).force(numbers, seen, NOTHING)) == float(damper.force(numbers, seen, NOTHING))


def test_what_swings_swings_the_other_way() -> None:
    """All of its motion has the other sign: so has its force."""
    law, seen = HardeningOscillator(), _seen(0.01, 0.2, 0.0)
    numbers = as_values(dict.fromkeys((role.name for role in law.roles), 2.0))
    state = jnp.array([1e-3, 0.05])
    behind = PortSignals(-seen.displacement, -seen.velocity, seen.load, -seen.rest)
    np.testing.assert_allclose(turned(law).rate(numbers, seen, state), law.rate(numbers, behind, state))
    assert float(turned(law).force(numbers, seen, state)) == -float(law.force(numbers, behind, state))


def test_numbers_that_are_known_at_one_port_are_estimated_at_another() -> None:
    known = typical_effect("seal", STRUT, PreslidingFriction())
    other = estimated(known)
    assert [each.name for each in known.parameters] == ["seal_force"]
    assert [each.name for each in other.parameters] == ["seal_force", "seal_stretch", "seal_lag"]
    assert other.state_names == known.state_names
    signals, state = _seen(0.01, 0.2, 0.0), jnp.zeros(1)
    p = as_values({each.name: each.value for each in other.parameters})
    assert float(other.force(p, signals, state)) == float(known.force(p, signals, state))
    softer = p | as_values({"seal_stretch": 10.0})
    assert abs(float(other.force(softer, signals, state))) < 0.1 * abs(float(known.force(p, signals, state)))
