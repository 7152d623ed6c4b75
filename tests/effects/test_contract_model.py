"""The catalogue in the whole rig: with everything at its null it is SimTR, and every effect at its value moves it."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractSensorLaw, AbstractSeriesLaw, Fundamental
from savgs_ident.effects.effect import Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model
from savgs_ident.plants.quarter_car.plant import CHANNELS, QuarterCar
from savgs_ident.plants.quarter_car.rig import Rig

from ..in_one_test import over
from ..plants.quarter_car.instants import as_values, draw_instants, inputs_of, motion_of
from .kinds import effects_of

COUNT = 40
FREQUENCY = np.array([0.5, 2.35, 21.0])


class Shown(NamedTuple):
    """What a model makes of instants.

    The residual of the motion (n, 2), the balance of each state (n,) by its name, what the sensors would show
    without dynamics (n, 2), and their transfers (2, f).
    """

    motion: NDArray[np.float64]
    states: Mapping[str, NDArray[np.float64]]
    readings: NDArray[np.float64]
    transfers: NDArray[np.complex128]


Look = Callable[..., Shown]


def _look(model: QuarterCar, anchors: NDArray[np.float64]) -> Look:
    """A model as a function of its numbers, and of the name of a state that is not at rest, if there is one.

    Anchors of frictions are at ``anchors`` [m], (n,).
    """
    instants, rng = draw_instants(12, COUNT), np.random.default_rng(13)
    cam = np.column_stack([rng.uniform(-np.pi, np.pi, COUNT), rng.uniform(3.0, 30.0, COUNT)])

    @jax.jit
    def evaluate(p: Values, s: Array, sd: Array, instants: Array, cam: Array) -> tuple[Array, Array, Array]:
        curves = model.prepare(p)

        def one(s: Array, instant: Array, turned: Array) -> tuple[Array, Array]:
            motion, inputs = (
                motion_of(instant),
                inputs_of(instant)._replace(cam=Fundamental(turned[0], turned[1])),
            )
            residual = model.residual(p, motion, s, sd, inputs, curves)
            return residual, jnp.stack(model.read(p, motion, s, sd, inputs))

        residuals, readings = jax.vmap(one)(s, instants, cam)
        return residuals, readings, model.transfers(p, jnp.asarray(FREQUENCY))

    def look(numbers: Mapping[str, float], moving: str = "") -> Shown:
        away = np.array([0.1 * state.scale * (state.name == moving) for state in model.states])
        s = away + np.where([state.slips for state in model.states], anchors[:, None], 0.0)
        found = evaluate(as_values(numbers), s, 10.0 * away, instants, cam)
        residuals, readings, transfers = (np.asarray(each) for each in found)
        states = [state.name for state in model.states]
        return Shown(
            residuals[:, :2], dict(zip(states, residuals[:, 2:].T, strict=True)), readings, transfers
        )

    return look


@pytest.fixture(scope="module")
def anchors() -> NDArray[np.float64]:
    """About where the sprung mass is [m]: within the stretch of a bristle that sticks."""
    return draw_instants(12, COUNT)[:, 0] - np.random.default_rng(5).uniform(-4e-5, 4e-5, COUNT)


@pytest.fixture(scope="module")
def everything(rig: Rig, anchors: NDArray[np.float64]) -> Look:
    """The rig with the whole catalogue."""
    return _look(build_model(rig, CATALOGUE), anchors)


@pytest.fixture(scope="module")
def at_null(numbers: dict[str, float]) -> dict[str, float]:
    """All numbers, with every effect at its null but the frictions of SimTR."""
    others = (effect.null for name, effect in CATALOGUE.items() if name not in MODELS["simtr"])
    return numbers | {name: value for null in others for name, value in null.items()}


def test_with_everything_at_its_null_it_is_simtr(
    rig: Rig, everything: Look, at_null: dict[str, float], anchors: NDArray[np.float64]
) -> None:
    simtr = _look(build_model(rig, MODELS["simtr"]), anchors)
    found, expected = everything(at_null), simtr(at_null)
    size = np.max(np.abs(expected.motion), axis=0)
    assert np.max(np.abs(found.motion - expected.motion) / size) < 1e-14
    anchor = expected.states["anchor"]
    assert np.max(np.abs(found.states["anchor"] - anchor)) < 1e-14 * np.max(np.abs(anchor))
    assert np.array_equal(found.readings, expected.readings)
    assert np.array_equal(found.transfers, expected.transfers)
    given = [effect for effect in CATALOGUE.values() if isinstance(effect.law, AbstractSeriesLaw)]
    for state in (state for effect in given for state in effect.states):
        assert not np.any(found.states[state.name]), state.name


@over("effect", effects_of())
def test_at_its_value_it_moves_the_rig_or_what_is_seen_of_it(
    effect: Effect, everything: Look, at_null: dict[str, float], numbers: dict[str, float]
) -> None:
    value = at_null | {name: numbers[name] for name in effect.null}
    here, there = everything(at_null | dict(effect.null)), everything(value)
    moves = not np.array_equal(here.motion, there.motion)
    shown = [not np.array_equal(*each) for each in zip(here.transfers, there.transfers, strict=True)]
    if isinstance(effect.law, AbstractSensorLaw):
        assert not moves
        assert shown == [effect.port.location == f"sensor.{each.name}" for each in CHANNELS]
    elif isinstance(effect.law, AbstractSeriesLaw):
        assert not moves
        assert np.any([there.states[state.name] for state in effect.states])
        given = everything(value, effect.states[0].name)
        assert not np.array_equal(here.motion, given.motion)
    else:
        assert moves
        assert not any(shown)
