"""Learned forces: sums of known functions, nothing without coefficients, held at the edge of what was seen."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array

from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import PortSignals
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import coefficients_at, frictions_at
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, EFFECTS, LEARNED
from savgs_ident.plants.quarter_car.ports import FORCE_PORTS
from savgs_ident.plants.quarter_car.rig_toml import KNOWN_UNITS
from savgs_ident.symbolic.translate import to_casadi

LAWS: dict[str, Callable[[float, float, float], float]] = {
    "tanh(v/0.01)": lambda x, v, n: np.tanh(v / 0.01),
    "tanh(v/0.1)": lambda x, v, n: np.tanh(v / 0.1),
    "v": lambda x, v, n: v,
    "v|v|": lambda x, v, n: v * abs(v),
    "v^2": lambda x, v, n: v * v,
    "x": lambda x, v, n: x,
    "x^2": lambda x, v, n: x * x,
    "x^3": lambda x, v, n: x * x * x,
    "x tanh(v/0.01)": lambda x, v, n: x * np.tanh(v / 0.01),
    "x v": lambda x, v, n: x * v,
    "x^2 v": lambda x, v, n: x * x * v,
    "tanh(v/0.01) exp(-(v/0.05)^2)": lambda x, v, n: np.tanh(v / 0.01) * np.exp(-v * v / 0.0025),
    "tanh(v/0.01) exp(-(v/0.2)^2)": lambda x, v, n: np.tanh(v / 0.01) * np.exp(-v * v / 0.04),
    "n tanh(v/0.01)": lambda x, v, n: n * np.tanh(v / 0.01),
    "n v": lambda x, v, n: n * v,
    "n": lambda x, v, n: n,
}
"""What the words for the functions say."""

SPANS = {"middle": 0.4, "stroke": 0.03, "speed": 0.5, "carried": 8e3}

each_learned = pytest.mark.parametrize("effect", LEARNED.values(), ids=LEARNED)


def _given(effect: Effect, coefficient: float) -> dict[str, float]:
    """Numbers of a learned force, all coefficients different."""
    port = effect.port
    spans = {f"learned_{port.name}_{name}": value for name, value in SPANS.items()}
    names = coefficients_at(port)
    return spans | {name: coefficient * (1.0 + place) for place, name in enumerate(names)}


def _words(effect: Effect) -> dict[str, str]:
    """What is told of each coefficient, after the words that all have in common."""
    told = {each.name: each.about for each in effect.parameters if each.name in effect.null}
    return {name: about.removeprefix("learned force in proportion to ") for name, about in told.items()}


def _force(effect: Effect, p: Values, displacement: float, velocity: float, load: float) -> float:
    signals = PortSignals(*(jnp.asarray(each) for each in (displacement, velocity, load, 0.0)))
    return float(effect.force(p, signals, jnp.zeros(0)))


def test_there_is_one_for_every_port_of_a_force_and_none_is_looked_for() -> None:
    assert {effect.port for effect in LEARNED.values()} == set(FORCE_PORTS.values())
    assert not set(LEARNED) & set(CATALOGUE)
    assert set(EFFECTS) == {*LEARNED, *CATALOGUE}
    names = [each.name for effect in LEARNED.values() for each in effect.parameters]
    assert len(set(names)) == len(names)
    assert all(each.unit in KNOWN_UNITS for effect in LEARNED.values() for each in effect.parameters)


@each_learned
def test_it_is_nothing_at_its_null(effect: Effect) -> None:
    p = as_values(_given(effect, 7.0) | dict(effect.null))
    assert set(effect.null) == set(coefficients_at(effect.port))
    assert _force(effect, p, 0.41, 0.2, 3e3) == 0.0


@each_learned
def test_each_of_its_numbers_weighs_the_function_that_its_words_say(effect: Effect) -> None:
    own = f"learned_{effect.port.name}_"
    loaded = {"rail", "strut", "tyre_lateral"}
    known = [words for words in LAWS if words[0] != "n" or effect.port.name in loaded]
    assert sorted(_words(effect).values()) == sorted(known)
    x, v, n = 0.7, -0.013, 0.6
    at = (SPANS["middle"] + SPANS["stroke"] * x, SPANS["speed"] * v, SPANS["carried"] * n)
    for name, words in _words(effect).items():
        alone = {f"{own}{span}": value for span, value in SPANS.items()} | dict(effect.null) | {name: 1.0}
        assert _force(effect, as_values(alone), *at) == pytest.approx(LAWS[words](x, v, n), rel=1e-9), words


@each_learned
def test_its_frictions_are_those_that_are_steeper_at_rest_than_any_damping(effect: Effect) -> None:
    steep = [
        name
        for name, words in _words(effect).items()
        if (LAWS[words](0.7, 1e-4, 0.6) - LAWS[words](0.7, -1e-4, 0.6)) / 2e-4 > 2.0
    ]
    assert list(frictions_at(effect.port)) == steep
    assert len(steep) in (5, 6)


@each_learned
@given(
    x=st.floats(-0.99, 0.99), v=st.floats(-0.99, 0.99), n=st.floats(0.0, 0.99), beyond=st.floats(1.0, 50.0)
)
def test_within_what_was_seen_it_is_the_sum_and_beyond_it_is_held(
    effect: Effect, x: float, v: float, n: float, beyond: float
) -> None:
    given_, p = _given(effect, 7.0), as_values(_given(effect, 7.0))
    expected = sum(given_[name] * LAWS[words](x, v, n) for name, words in _words(effect).items())
    at = (SPANS["middle"] + SPANS["stroke"] * x, SPANS["speed"] * v, SPANS["carried"] * n)
    assert _force(effect, p, *at) == pytest.approx(expected, rel=1e-7, abs=1e-7)
    edge = _force(effect, p, SPANS["middle"] + SPANS["stroke"], SPANS["speed"], SPANS["carried"])
    outside = (SPANS["middle"] + SPANS["stroke"] * beyond, SPANS["speed"] * beyond, SPANS["carried"] * beyond)
    assert _force(effect, p, *outside) == pytest.approx(edge, rel=1e-12)


@each_learned
def test_its_derivatives_are_those_of_differences(effect: Effect) -> None:
    numbers = _given(effect, 7.0)
    names = [each.name for each in effect.parameters]

    def at(values: Array) -> Array:
        p = dict(zip(names, jnp.unstack(values), strict=True))
        signals = PortSignals(jnp.asarray(0.413), jnp.asarray(-0.021), jnp.asarray(2.5e3), jnp.zeros(()))
        return effect.force(p, signals, jnp.zeros(0))

    start = jnp.asarray([numbers[name] for name in names])
    slopes = np.asarray(jax.grad(at)(start))
    for place, value in enumerate(start.tolist()):
        step = 1e-5 * max(abs(value), 1e-3)
        moved = [float(at(start.at[place].add(sign * step))) for sign in (1.0, -1.0)]
        assert slopes[place] == pytest.approx((moved[0] - moved[1]) / (2.0 * step), rel=1e-5, abs=1e-6)


@each_learned
def test_casadi_computes_the_same(effect: Effect) -> None:
    numbers = _given(effect, 7.0)
    names, values = list(numbers), np.array(list(numbers.values()))

    def force(signals: Array, p: Array) -> Array:
        seen = PortSignals(*jnp.unstack(signals), jnp.zeros(()))
        return effect.force(dict(zip(names, jnp.unstack(p), strict=True)), seen, jnp.zeros(0))[None]

    told = to_casadi("force", force, {"signals": np.zeros(3), "p": values}, ["force"])
    for signals in np.random.default_rng(3).uniform([0.36, -0.6, 0.0], [0.44, 0.6, 9e3], (40, 3)):
        expected = float(force(jnp.asarray(signals), jnp.asarray(values))[0])
        assert float(told(signals, values)) == pytest.approx(expected, rel=1e-10, abs=1e-9)
