"""Learned forces: sums of known functions, nothing without coefficients, held at the edge of what was seen."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import Array
from scipy.optimize import brentq

from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import Family, Fundamental, InputSignal, Load, PortKind, PortSignals
from savgs_ident.effects.composition import contact_bristle
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce
from savgs_ident.effects.learned_functions import (
    blocking_at,
    coefficients_at,
    coefficients_of,
    frictions_at,
    functions_at,
)
from savgs_ident.plants.parameter_toml import KNOWN_UNITS
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, EFFECTS, LEARNED
from savgs_ident.plants.quarter_car.ports import PORTS
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
    "|v|": lambda x, v, n: abs(v),
    "max(x - 0.3, 0)": lambda x, v, n: max(x - 0.3, 0.0),
    "max(-x - 0.3, 0)": lambda x, v, n: max(-x - 0.3, 0.0),
    "max(x - 0.55, 0)": lambda x, v, n: max(x - 0.55, 0.0),
    "max(-x - 0.55, 0)": lambda x, v, n: max(-x - 0.55, 0.0),
    "x^4": lambda x, v, n: x**4,
    "max(x - 0, 0)^2": lambda x, v, n: max(x, 0.0) ** 2,
    "max(-x - 0, 0)^2": lambda x, v, n: max(-x, 0.0) ** 2,
    "max(x - 0.4, 0)^2": lambda x, v, n: max(x - 0.4, 0.0) ** 2,
    "max(-x - 0.4, 0)^2": lambda x, v, n: max(-x - 0.4, 0.0) ** 2,
    "x^5": lambda x, v, n: x**5,
    "x^9": lambda x, v, n: x**9,
    "v/(v^2 + 0.01)^(1/4)": lambda x, v, n: v / (v * v + 0.01) ** 0.25,
    "tanh(v/w)": lambda x, v, n: np.tanh(v / TURN),
    "tanh(v/0.01)^2": lambda x, v, n: np.tanh(v / 0.01) ** 2,
    "tanh(v/w)^2": lambda x, v, n: np.tanh(v / TURN) ** 2,
    "d^2": lambda x, v, n: _whole(x) ** 2,
    "d^3": lambda x, v, n: _whole(x) ** 3,
    "d^5": lambda x, v, n: _whole(x) ** 5,
    "v/(v^2 + 0.0001)^(1/4)": lambda x, v, n: v / (v * v + 0.0001) ** 0.25,
    "n tanh(v/0.01)": lambda x, v, n: n * np.tanh(v / 0.01),
    "n tanh(v/0.01) exp(-|v|/0.05)": lambda x, v, n: n * np.tanh(v / 0.01) * np.exp(-abs(v) / 0.05),
    "n tanh(v/0.01) exp(-|v|/0.2)": lambda x, v, n: n * np.tanh(v / 0.01) * np.exp(-abs(v) / 0.2),
    "n v": lambda x, v, n: n * v,
    "n": lambda x, v, n: n,
    "max(x - g, 0) v": lambda x, v, n: max(x - GAP, 0.0) * v,
    "max(-x - g, 0) v": lambda x, v, n: max(-x - GAP, 0.0) * v,
    "max(x - g, 0)": lambda x, v, n: max(x - GAP, 0.0),
    "max(-x - g, 0)": lambda x, v, n: max(-x - GAP, 0.0),
}
"""What the words for the functions say."""

CONTACT = "friction of the contact, of any load"
"""What is no force of the law itself: the contact holds more."""

FACTORS: dict[str, Callable[[float, float], float]] = {
    "": lambda v, n: 1.0,
    "exp(-|v|/f) of ": lambda v, n: np.exp(-abs(v) / FALL),
    "n exp(-|v|/f) of ": lambda v, n: n * np.exp(-abs(v) / FALL),
}
"""What the words say that stand before those for a spring-slider."""

TURN = 0.02

GIVE = 1.4

GAP = 0.25

FALL = 0.15

LAG = 2e-3

SPANS = {
    "middle": 0.4,
    "stroke": 0.03,
    "speed": 0.5,
    "carried": 8e3,
    "turn": TURN,
    "give": GIVE,
    "gap": GAP,
    "fall": FALL,
    "lag": LAG,
}


def _whole(x: float) -> float:
    """The displacement d over the largest, from the displacement x from the middle over the stroke."""
    return (SPANS["middle"] + SPANS["stroke"] * x) / (SPANS["middle"] + SPANS["stroke"])


FORCES = {name: effect for name, effect in LEARNED.items() if isinstance(effect.law, LearnedForce)}

each_learned = pytest.mark.parametrize("effect", LEARNED.values(), ids=LEARNED)
each_force = pytest.mark.parametrize("effect", FORCES.values(), ids=FORCES)


def _given(effect: Effect, coefficient: float) -> dict[str, float]:
    """Numbers of a learned force, all coefficients different."""
    port = effect.port
    spans = {f"learned_{port.name}_{name}": value for name, value in SPANS.items()}
    names = coefficients_at(port)
    return spans | {name: coefficient * (1.0 + place) for place, name in enumerate(names)}


def _words(effect: Effect) -> dict[str, str]:
    """What is said of each coefficient, after the words that all have in common."""
    reported = {each.name: each.about for each in effect.parameters if each.name in effect.null}
    return {name: about.removeprefix("learned in proportion to ") for name, about in reported.items()}


def _force(effect: Effect, p: Values, displacement: float, velocity: float, load: float) -> float:
    """With the spring-sliders anchored in the nominal state."""
    signals = PortSignals(*(jnp.asarray(each) for each in (displacement, velocity, load, 0.0)))
    return float(effect.force(p, signals, jnp.zeros(2)))


def _carried(effect: Effect, words: str, displacement: float, velocity: float) -> float:
    """What a spring-slider of these words carries, anchored in the nominal state."""
    width = GIVE * float(words.split()[-3]) * effect.port.displacement
    return float(np.clip((displacement + LAG * velocity) / width, -1.0, 1.0))


def _said(effect: Effect, words: str, x: float, v: float, n: float) -> float:
    """The function of these words at a state relative to :data:`SPANS`."""
    if words == CONTACT:
        return 0.0
    factor, slider, _ = words.partition("a spring-slider")
    if not slider:
        return LAWS[words](x, v, n)
    at = SPANS["middle"] + SPANS["stroke"] * x, SPANS["speed"] * v
    return FACTORS[factor](v, n) * _carried(effect, words, *at)


def test_there_is_one_for_every_port_that_can_have_one_and_none_is_looked_for() -> None:
    assert {port for port in PORTS if port.kind is PortKind.FORCE} < {
        effect.port for effect in LEARNED.values()
    }
    assert all(functions_at(effect.port) for effect in LEARNED.values())
    assert not set(LEARNED) & set(CATALOGUE)
    assert set(EFFECTS) == {*LEARNED, *CATALOGUE}
    names = [each.name for effect in LEARNED.values() for each in effect.parameters]
    assert len(set(names)) == len(names)
    assert all(each.unit in KNOWN_UNITS for effect in LEARNED.values() for each in effect.parameters)


@each_learned
def test_every_function_is_of_a_family(effect: Effect) -> None:
    port = effect.port
    families = dict.fromkeys(each.family for each in functions_at(port))
    of_families = [name for family in families for name in coefficients_of(port, family)]
    assert set(of_families) == set(coefficients_at(port))
    gains = set(coefficients_of(port, Family.GAIN))
    assert gains <= set(coefficients_of(port, Family.DYNAMICS))
    blocking = {blocking_at(port)} - {None}
    assert set(effect.null) == {*coefficients_at(port), *blocking}


@each_force
def test_it_is_nothing_at_its_null(effect: Effect) -> None:
    p = as_values(_given(effect, 7.0) | dict(effect.null))
    assert _force(effect, p, 0.41, 0.2, 3e3) == 0.0


def test_what_gives_way_returns_to_rest_and_follows_the_load() -> None:
    effect = LEARNED["learned_mount"]
    spans = {"learned_mount_carried": 1e3, "learned_mount_lag": 1e-3}
    p = as_values(dict(effect.null) | spans | {"learned_mount_1": 2e-3, "learned_mount_3": 1e-3})
    load = Load(jnp.asarray(3500.0), jnp.asarray(3000.0))
    given = 2e-3 * 0.5 + 1e-3 * 0.5**2
    still, zero = jnp.asarray([given]), jnp.zeros(1)
    assert float(effect.balance(p, load, still, zero)[0]) == pytest.approx(0.0, abs=1e-12)
    at_rest = Load(load.rest, load.rest)
    every = as_values(dict.fromkeys(effect.null, 1e-3) | spans)
    assert float(effect.balance(every, at_rest, zero, zero)[0]) == pytest.approx(0.0, abs=1e-15)


def test_what_gives_way_is_blocked_in_the_end() -> None:
    """Below the deflection at which it is blocked it follows the load, above it hardly does."""
    effect = LEARNED["learned_damper"]
    gap = 0.2 * effect.port.displacement
    spans = {"learned_damper_carried": 1e3, "learned_damper_lag": 1e-3, "learned_damper_blocking": 5.0}
    p = as_values(dict(effect.null) | {"learned_damper_1": 10.0 * gap} | spans)

    def deflection(load: float) -> float:
        def missing(x: float) -> float:
            pushed = Load(jnp.asarray(load), jnp.zeros(()))
            return float(effect.balance(p, pushed, jnp.asarray([x]), jnp.zeros(1))[0])

        return float(brentq(missing, -10.0 * gap, 10.0 * gap, xtol=1e-12))

    assert deflection(30.0) == pytest.approx(0.3 * gap, rel=1e-3)
    assert gap < deflection(1000.0) < 1.35 * gap
    assert deflection(-1000.0) == pytest.approx(-deflection(1000.0), rel=1e-9)


def test_a_learned_input_moves_as_its_rate_says() -> None:
    effect = LEARNED["learned_road"]
    random = np.random.default_rng(2)
    p = as_values(
        {name: float(random.uniform(-1e-4, 1e-4)) for name in effect.null} | {"learned_road_fastest": 40.0}
    )
    nothing = InputSignal(jnp.zeros(()), jnp.zeros(()))

    def value(time: Array) -> Array:
        return effect.shift(p, nothing, Fundamental(0.3 + 25.0 * time, jnp.asarray(25.0))).value

    rate = effect.shift(p, nothing, Fundamental(jnp.asarray(0.3), jnp.asarray(25.0))).rate
    assert float(rate) == pytest.approx(float(jax.grad(value)(jnp.zeros(()))), rel=1e-12)


def test_a_learned_transfer_function_has_a_gain_at_rest_and_what_it_is_made_of() -> None:
    effect = LEARNED["learned_accel"]
    p = as_values(
        dict(effect.null) | {"learned_accel_1": 0.05, "learned_accel_2": -0.02, "learned_accel_6": 0.3}
    )
    frequency = jnp.asarray([0.0, 3.0])
    s = 2j * np.pi * 3.0
    expected = [1.05, 1.05 - 0.02 * s / 20.0 + 0.3 * (1.0 / (1.0 + s / 20.0) - 1.0)]
    np.testing.assert_allclose(np.asarray(effect.transfer(p, frequency)), expected, rtol=1e-12)


@each_force
def test_each_of_its_numbers_weighs_the_function_that_its_words_say(effect: Effect) -> None:
    own = f"learned_{effect.port.name}_"
    loaded = {"rail", "strut", "tyre_lateral"}
    known = [words for words in LAWS if words[0] != "n" or effect.port.name in loaded]
    sliders = [words for words in _words(effect).values() if "slider" in words]
    assert len(sliders) == 4 + (2 if effect.port.name in loaded else 1)
    held = [CONTACT] if effect.port.contact else []
    assert sorted(_words(effect).values()) == sorted([*known, *sliders, *held])
    x, v, n = 0.7, -0.013, 0.6
    at = (SPANS["middle"] + SPANS["stroke"] * x, SPANS["speed"] * v, SPANS["carried"] * n)
    for name, words in _words(effect).items():
        alone = {f"{own}{span}": value for span, value in SPANS.items()} | dict(effect.null) | {name: 1.0}
        expected = _said(effect, words, x, v, n)
        assert _force(effect, as_values(alone), *at) == pytest.approx(expected, rel=1e-9), words


@each_force
def test_its_frictions_are_those_that_do_not_grow_once_it_moves(effect: Effect) -> None:
    def rubs(words: str) -> bool:
        at_rest, slow, fast = (abs(LAWS[words](0.7, v, 0.6)) for v in (0.0, 0.45, 0.9))
        return at_rest == 0.0 < fast <= 1.001 * slow

    found = [
        name for name, words in _words(effect).items() if "slider" in words or words == CONTACT or rubs(words)
    ]
    assert list(frictions_at(effect.port)) == found
    assert len(found) in (13, 17, 18)


@given(force=st.floats(-50.0, 3000.0), load=st.floats(0.0, 1e4), velocity=st.floats(-1.0, 1.0))
def test_a_contact_holds_more_by_what_is_learned_as_by_a_preload(
    force: float, load: float, velocity: float
) -> None:
    """Both load the bristle of the contact; nothing is held below zero."""
    learned, preload = LEARNED["learned_rail"], CATALOGUE["rail_preload"]
    coulomb = CATALOGUE["rail_coulomb"]
    name = next(name for name, words in _words(learned).items() if words == CONTACT)
    given_ = {each.name: each.value for each in (*coulomb.parameters, *learned.parameters)}
    p = as_values({**given_, **learned.null, name: force, "rail_preload_force": force})
    seen = PortSignals(*(jnp.asarray(each) for each in (0.0, velocity, load, 0.0)))
    both = (
        contact_bristle((coulomb, each), learned.port, p, seen, jnp.asarray(-1e-5))
        for each in (learned, preload)
    )
    (mine, my_rate), (its, its_rate) = both
    assert float(mine) == pytest.approx(float(its), rel=1e-12)
    assert float(my_rate) == pytest.approx(float(its_rate), rel=1e-12)
    assert abs(float(mine)) <= max(0.03 * load + force, 0.0) * (1.0 + 1e-12)


@each_force
@given(
    x=st.floats(-0.99, 0.99), v=st.floats(-0.99, 0.99), n=st.floats(0.0, 0.99), beyond=st.floats(1.0, 50.0)
)
def test_within_what_was_seen_it_is_the_sum_and_beyond_it_is_held(
    effect: Effect, x: float, v: float, n: float, beyond: float
) -> None:
    given_, p = _given(effect, 7.0), as_values(_given(effect, 7.0))
    at = (SPANS["middle"] + SPANS["stroke"] * x, SPANS["speed"] * v, SPANS["carried"] * n)
    expected = sum(given_[name] * _said(effect, words, x, v, n) for name, words in _words(effect).items())
    assert _force(effect, p, *at) == pytest.approx(expected, rel=1e-7, abs=1e-7)
    edge = _force(effect, p, SPANS["middle"] + SPANS["stroke"], SPANS["speed"], SPANS["carried"])
    outside = (SPANS["middle"] + SPANS["stroke"] * beyond, SPANS["speed"] * beyond, SPANS["carried"] * beyond)
    assert _force(effect, p, *outside) == pytest.approx(edge, rel=1e-12)


@pytest.mark.slow
@each_force
def test_its_derivatives_are_those_of_differences(effect: Effect) -> None:
    numbers = _given(effect, 7.0)
    names = [each.name for each in effect.parameters]

    def at(values: Array) -> Array:
        p = dict(zip(names, jnp.unstack(values), strict=True))
        signals = PortSignals(jnp.asarray(0.413), jnp.asarray(-0.021), jnp.asarray(2.5e3), jnp.zeros(()))
        return effect.force(p, signals, jnp.zeros(2))

    start = jnp.asarray([numbers[name] for name in names])
    slopes = np.asarray(jax.grad(at)(start))
    for place, value in enumerate(start.tolist()):
        step = 1e-5 * max(abs(value), 1e-3)
        moved = [float(at(start.at[place].add(sign * step))) for sign in (1.0, -1.0)]
        assert slopes[place] == pytest.approx((moved[0] - moved[1]) / (2.0 * step), rel=1e-5, abs=1e-6)


@pytest.mark.slow
@each_force
def test_casadi_computes_the_same(effect: Effect) -> None:
    numbers = _given(effect, 7.0)
    names, values = list(numbers), np.array(list(numbers.values()))

    def force(signals: Array, p: Array) -> Array:
        seen = PortSignals(*jnp.unstack(signals), jnp.zeros(()))
        return effect.force(dict(zip(names, jnp.unstack(p), strict=True)), seen, jnp.zeros(2))[None]

    reported = to_casadi("force", force, {"signals": np.zeros(3), "p": values}, ["force"])
    for signals in np.random.default_rng(3).uniform([0.36, -0.6, 0.0], [0.44, 0.6, 9e3], (40, 3)):
        expected = float(force(jnp.asarray(signals), jnp.asarray(values))[0])
        assert float(reported(signals, values)) == pytest.approx(expected, rel=1e-10, abs=1e-9)
