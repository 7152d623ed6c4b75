"""The law of every effect: nothing at its null, derivatives that are those of differences, translatable."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Fundamental,
    InputSignal,
)
from savgs_ident.effects.effect import Effect

from ..in_one_test import over
from ..plants.primitives import MAPPABLE, primitives_of
from ..plants.quarter_car.instants import as_values
from .kinds import MECHANISMS, effects_of, outcome, outcomes, seen_by, slopes


def _nothing(effect: Effect, numbers: dict[str, float], found: NDArray[np.float64]) -> bool:
    """Whether an outcome (n, m) is that of an effect that is not there."""
    match effect.law:
        case AbstractForceLaw():
            return not np.any(found[:, 0])
        case AbstractNumberLaw():
            return bool(np.all(found == [numbers[name] for name in sorted(effect.changes(numbers))]))
        case AbstractSensorLaw():
            return bool(np.all(found == [1.0, 0.0]))
    return not np.any(found)


@over("effect", effects_of())
def test_it_is_nothing_at_its_null_and_something_at_its_value(
    effect: Effect, numbers: dict[str, float]
) -> None:
    """Exactly; what gives way stays where it is under any load."""
    p = as_values(numbers)
    seen = seen_by(effect, p, seed=4)
    if isinstance(effect.law, AbstractSeriesLaw):
        seen[:, 2:] = 0.0
    assert not _nothing(effect, numbers, outcomes(effect, p, seen))
    null = numbers | dict(effect.null)
    assert _nothing(effect, null, outcomes(effect, as_values(null), seen))
    others = [parameter for parameter in effect.parameters if parameter.name not in effect.null]
    elsewhere = null | {each.name: _moved(each) for each in others}
    assert _nothing(effect, elsewhere, outcomes(effect, as_values(elsewhere), seen))


def _moved(parameter: Parameter) -> float:
    """Another value within the bounds."""
    ends = (parameter.value * factor for factor in (1.3, 0.8, 0.5))
    return next(each for each in ends if parameter.lower < each < parameter.upper)


@over("effect", effects_of(AbstractForceLaw, AbstractFrictionLimitLaw, AbstractSeriesLaw))
def test_it_gives_one_number_per_force_and_state(effect: Effect, numbers: dict[str, float]) -> None:
    seen = jnp.asarray(seen_by(effect, as_values(numbers), seed=4)[0])
    found = outcome(effect, as_values(numbers), seen)
    assert found.dtype == jnp.float64
    assert found.shape == (
        {AbstractForceLaw: 1, AbstractFrictionLimitLaw: 2, AbstractSeriesLaw: 0}[
            type(effect.law).__bases__[0]
        ]
        + len(effect.states),
    )


@over("effect", effects_of(AbstractSeriesLaw))
def test_its_balance_grows_with_the_rates(effect: Effect, numbers: dict[str, float]) -> None:
    """At its value and at its null alike, so that there is one rate to every load."""
    seen, size = seen_by(effect, as_values(numbers), seed=4), len(effect.states)
    for p in (numbers, numbers | dict(effect.null)):
        for place in range(size):
            faster = seen.copy()
            faster[:, 2 + size + place] += 1e-3
            grown = outcomes(effect, as_values(p), faster) - outcomes(effect, as_values(p), seen)
            assert np.all(grown[:, place] > 0.0)


@over("effect", effects_of(AbstractInputLaw))
def test_its_velocity_is_the_rate_of_its_height(effect: Effect, numbers: dict[str, float]) -> None:
    p, still = as_values(numbers), jnp.zeros(())
    for seen in seen_by(effect, p, seed=4)[:16]:
        height, velocity, angle, speed = jnp.unstack(jnp.asarray(seen))
        (shift, _), (rate, _) = jax.jvp(
            lambda height, angle: effect.shift(p, InputSignal(height, still), Fundamental(angle, still)),
            (height, angle),
            (velocity, speed),
        )
        moving = effect.shift(p, InputSignal(height, velocity), Fundamental(angle, speed))
        assert float(moving.value) == float(shift)
        assert float(moving.rate) == pytest.approx(float(rate), rel=1e-12, abs=1e-15)


Difference = Callable[[float], NDArray[np.float64]]


def _central(at: Difference, step: float) -> NDArray[np.float64]:
    return (at(step) - at(-step)) / (2.0 * step)


def _into_the_bounds(at: Difference, step: float) -> NDArray[np.float64]:
    return (4.0 * at(step) - at(2.0 * step) - 3.0 * at(0.0)) / (2.0 * step)


@pytest.mark.slow
@over("place", ["value", "null"])
@over("effect", effects_of())
def test_derivatives_in_its_parameters_are_those_of_differences(
    effect: Effect, numbers: dict[str, float], place: str
) -> None:
    """Off the few points at which a law changes within the difference. On a bound the difference goes inwards."""
    here = numbers | (dict(effect.null) if place == "null" else {})
    seen = seen_by(effect, as_values(numbers), seed=5)
    still = as_values(dict.fromkeys(numbers, 0.0))
    for parameter in effect.parameters:
        value = here[parameter.name]
        room = (abs(parameter.value) or parameter.tolerance or parameter.upper - parameter.lower) * 1e-5
        inwards = 1.0 if value - room < parameter.lower else -1.0
        off_bounds = parameter.lower <= value - room and value + room <= parameter.upper

        def at(offset: float, name: str = parameter.name, value: float = value) -> NDArray[np.float64]:
            return outcomes(effect, as_values(here | {name: value + offset}), seen)

        difference = _central if off_bounds else _into_the_bounds
        expected, nearer = (difference(at, inwards * step) for step in (room, room / 2.0))
        direction = still | {parameter.name: np.asarray(1.0)}
        found = slopes(effect, as_values(here), direction, seen)
        size = np.max(np.abs(expected), axis=0) + 1e-9 * np.max(np.abs(at(0.0)), axis=0) / room
        smooth = np.abs(expected - nearer) <= 1e-6 * size
        assert np.mean(smooth) > 0.98, parameter.name
        wrong = np.abs(found - expected) > np.broadcast_to(1e-5 * size, found.shape)
        assert not np.any(wrong & smooth), parameter.name


@over("effect", effects_of())
def test_at_its_null_something_shows_it(effect: Effect, numbers: dict[str, float]) -> None:
    """Its outcome has a slope there in what makes it vanish: it can be tested for."""
    p: Values = as_values(numbers | dict(effect.null))
    seen = seen_by(effect, as_values(numbers), seed=6)
    still = as_values(dict.fromkeys(numbers, 0.0))
    for name in effect.null:
        found = slopes(effect, p, still | {name: np.asarray(1.0)}, seen)
        assert np.isfinite(found).all(), name
        assert np.any(found != 0.0), name


@over("effect", effects_of(*MECHANISMS, AbstractNumberLaw, AbstractInputLaw))
def test_it_is_made_of_what_can_be_translated(effect: Effect, numbers: dict[str, float]) -> None:
    """All that the rig's residual holds; what sensors do is not part of it."""
    seen = seen_by(effect, as_values(numbers), seed=4)[0]
    law = primitives_of(lambda p, one: outcome(effect, p, one), as_values(numbers), seen)
    assert set(law) <= MAPPABLE
