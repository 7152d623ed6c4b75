"""Every primitive against JAX itself."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import casadi as ca
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from jax import lax
from jaxtyping import Array

from savgs_ident.symbolic.operations import BY_EQUATION, ELEMENTWISE
from savgs_ident.symbolic.translate import NESTING, RULES, to_casadi

from ..in_one_test import over
from ..plants.primitives import primitives_of

SHAPE = (2, 3)
TABLE = np.array([[3.0, -1.0, 4.0, 1.0, -5.0], [9.0, 2.0, -6.0, 5.0, 3.5]])


class Case(NamedTuple):
    """A function of as many arrays of ``SHAPE`` as there are ranges, each array drawn from its range."""

    function: Callable[..., Array]
    ranges: tuple[tuple[float, float], ...] = ((-3.0, 3.0),)


TWO = ((-3.0, 3.0), (-3.0, 3.0))
POSITIVE = ((0.1, 5.0),)


@jax.custom_jvp
def _with_own_slope(x: Array) -> Array:
    return jnp.sin(x)


_with_own_slope.defjvp(lambda primals, tangents: (jnp.sin(primals[0]), tangents[0]))


@jax.custom_vjp
def _with_own_pullback(x: Array) -> Array:
    return jnp.cos(x)


_with_own_pullback.defvjp(lambda x: (jnp.cos(x), x), lambda x, seed: (seed,))


def _index(x: Array, count: int) -> Array:
    """A whole number about 0..``count`` - 1, and beyond either end."""
    return jnp.floor(x[0, 0] * count / 2.0).astype(jnp.int64)


CASES: dict[str, Case] = {
    "abs": Case(jnp.abs),
    "acos": Case(jnp.arccos, ((-0.99, 0.99),)),
    "acosh": Case(jnp.arccosh, ((1.01, 5.0),)),
    "add": Case(lax.add, TWO),
    "add_any": Case(jax.grad(lambda x: jnp.sum(x * x))),
    "and": Case(lambda x, y: (x > 0.0) & (y > 1.0), TWO),
    "asin": Case(jnp.arcsin, ((-0.99, 0.99),)),
    "asinh": Case(jnp.arcsinh),
    "atan": Case(jnp.arctan),
    "atan2": Case(jnp.arctan2, TWO),
    "atanh": Case(jnp.arctanh, ((-0.99, 0.99),)),
    "broadcast_in_dim": Case(lambda x: lax.broadcast_in_dim(x, (2, 4, 3), (0, 2))),
    "cbrt": Case(jnp.cbrt),
    "ceil": Case(jnp.ceil),
    "checkpoint": Case(jax.checkpoint(lambda x: jnp.sin(x) * x)),
    "clamp": Case(lambda x, y: lax.clamp(-1.0, x, jnp.abs(y)), TWO),
    "concatenate": Case(lambda x, y: lax.concatenate([x, y, x], 1), TWO),
    "cond": Case(lambda x: lax.cond(x[0, 0] > 0.0, lambda a: a * 2.0, jnp.sin, x)),
    "convert_element_type": Case(lambda x: x.astype(jnp.int64).astype(jnp.float64) + (x > 0.0).astype(float)),
    "copy": Case(jnp.copy),
    "cos": Case(jnp.cos),
    "cosh": Case(jnp.cosh),
    "cummax": Case(lambda x: lax.cummax(x, 1)),
    "cummin": Case(lambda x: lax.cummin(x, 0, reverse=True)),
    "cumprod": Case(lambda x: lax.cumprod(x, 1)),
    "cumsum": Case(lambda x: lax.cumsum(x, 1, reverse=True)),
    "custom_jvp_call": Case(_with_own_slope),
    "custom_vjp_call": Case(_with_own_pullback),
    "div": Case(lambda x, y: x / y + (x.astype(jnp.int64) // 2).astype(float), (TWO[0], POSITIVE[0])),
    "dot_general": Case(
        lambda x, y: jnp.einsum("bi,bj->ij", jnp.einsum("bi,bj->bi", x, y), x @ y.T @ y), TWO
    ),
    "dynamic_slice": Case(lambda x: lax.dynamic_slice(jnp.asarray(TABLE), (0, _index(x, 5)), (2, 2))),
    "dynamic_update_slice": Case(lambda x: lax.dynamic_update_slice(jnp.asarray(TABLE), x, (0, 1))),
    "eq": Case(lambda x, y: jnp.floor(x) == jnp.floor(y), TWO),
    "erf": Case(jax.scipy.special.erf),
    "exp": Case(jnp.exp),
    "exp2": Case(jnp.exp2),
    "expm1": Case(jnp.expm1),
    "floor": Case(jnp.floor),
    "gather": Case(
        lambda x: jnp.asarray(TABLE)[:, jnp.floor(2.0 * x).astype(jnp.int64)][1] + x[:, [2, 0, 1]]
    ),
    "ge": Case(lambda x, y: jnp.floor(x) >= jnp.floor(y), TWO),
    "gt": Case(lambda x, y: jnp.floor(x) > jnp.floor(y), TWO),
    "integer_pow": Case(lambda x: x**5 + (3.0 + jnp.abs(x)) ** -3),
    "is_finite": Case(lambda x: jnp.isfinite(1.0 / jnp.floor(x))),
    "jit": Case(jax.jit(lambda x: jnp.sin(x) + x)),
    "le": Case(lambda x, y: jnp.floor(x) <= jnp.floor(y), TWO),
    "log": Case(jnp.log, POSITIVE),
    "log1p": Case(jnp.log1p, ((-0.9, 3.0),)),
    "logistic": Case(jax.nn.sigmoid, ((-40.0, 40.0),)),
    "lt": Case(lambda x, y: jnp.floor(x) < jnp.floor(y), TWO),
    "max": Case(jnp.maximum, TWO),
    "min": Case(jnp.minimum, TWO),
    "mul": Case(lambda x, y: x * y * 2.0, TWO),
    "ne": Case(lambda x, y: jnp.floor(x) != jnp.floor(y), TWO),
    "neg": Case(jnp.negative),
    "not": Case(lambda x: ~(x > 0.0)),
    "optimization_barrier": Case(lambda x: lax.optimization_barrier(x) * 2.0),
    "or": Case(lambda x, y: (x > 0.0) | (y > 1.0), TWO),
    "pad": Case(lambda x: jnp.pad(x, ((1, 0), (0, 2)), constant_values=7.0)),
    "pow": Case(jnp.power, (POSITIVE[0], TWO[0])),
    "reduce_and": Case(lambda x: jnp.all(x > -1.0, axis=1)),
    "reduce_max": Case(lambda x: jnp.max(x, axis=0)),
    "reduce_min": Case(lambda x: jnp.min(x, axis=1)),
    "reduce_or": Case(lambda x: jnp.any(x > 1.0, axis=0)),
    "reduce_prod": Case(jnp.prod),
    "reduce_sum": Case(lambda x: jnp.sum(x, axis=1)[:, None] + jnp.sum(x > 0.0).astype(float)[None, None]),
    "rem": Case(lax.rem, (TWO[0], POSITIVE[0])),
    "reshape": Case(lambda x: jnp.reshape(x, (3, 2))),
    "rev": Case(lambda x: x[::-1, ::-1]),
    "rsqrt": Case(lax.rsqrt, POSITIVE),
    "scatter": Case(lambda x, y: jnp.asarray(x).at[:, np.array([2, 0])].set(y[:, :2]), TWO),
    "select_n": Case(lambda x, y: jnp.where(x > y, x, y * 2.0), TWO),
    "sign": Case(jnp.sign),
    "sin": Case(jnp.sin),
    "sinh": Case(jnp.sinh),
    "slice": Case(lambda x: x[:, 0:3:2]),
    "split": Case(lambda x: jnp.multiply(*jnp.split(x, [1], axis=0))),
    "sqrt": Case(jnp.sqrt, POSITIVE),
    "square": Case(jnp.square),
    "squeeze": Case(lambda x: jnp.squeeze(x[:, 1:2], 1)),
    "stack": Case(lambda x, y: jnp.stack([x, y, x], axis=1), TWO),
    "stop_gradient": Case(lambda x: lax.stop_gradient(x) * x),
    "sub": Case(jnp.subtract, TWO),
    "tan": Case(jnp.tan, ((-1.5, 1.5),)),
    "tanh": Case(jnp.tanh),
    "transpose": Case(jnp.transpose),
    "unstack": Case(lambda x: jnp.unstack(x)[1]),
    "xor": Case(lambda x, y: (x > 0.0) ^ (y > 0.0), TWO),
}

ALIASES = {"checkpoint": "remat2", "jit": "pjit"}
"""Names of the same thing in other versions of JAX."""


@cache
def _both(name: str) -> tuple[ca.Function, Callable[..., Array]]:
    case = CASES[name]
    inputs = {f"x{place}": np.zeros(SHAPE) for place in range(len(case.ranges))}
    return to_casadi("translated", case.function, inputs, ["y"]), jax.jit(case.function)


def _assert_same(name: str, values: tuple[np.ndarray, ...]) -> None:
    translated, function = _both(name)
    expected = np.asarray(function(*values), np.float64).ravel()
    found = np.array(translated(*(value.ravel() for value in values))).ravel()
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.slow
@over("name", CASES)
def test_it_says_what_jax_says(name: str) -> None:
    """At random values, and where functions change: ends, whole and half numbers, zeros of either sign, ties."""
    rng = np.random.default_rng(3)
    for draw in range(16):
        values = []
        for low, high in CASES[name].ranges:
            edges = np.array([low, high, 0.0, -0.0, *np.arange(-40.0, 41.0) / 2.0])
            chosen = rng.choice(edges[(edges >= low) & (edges <= high)], SHAPE)
            values.append(chosen if draw % 2 else rng.uniform(low, high, SHAPE))
        _assert_same(name, tuple(values))


@pytest.mark.slow
@over("name", CASES)
def test_it_says_what_jax_says_at_any_values(name: str) -> None:
    drawn = [
        arrays(np.float64, SHAPE, elements=st.floats(*limits, allow_subnormal=False))
        for limits in CASES[name].ranges
    ]

    @given(st.tuples(*drawn))
    def check(values: tuple[np.ndarray, ...]) -> None:
        _assert_same(name, values)

    check()


@over("name", CASES)
def test_the_case_uses_its_primitive(name: str) -> None:
    case = CASES[name]
    used = primitives_of(case.function, *[np.zeros(SHAPE)] * len(case.ranges))
    assert {name, ALIASES.get(name, name)} & set(used)


def test_every_rule_has_a_case() -> None:
    assert set(RULES) | set(NESTING) == set(CASES) | set(ALIASES.values())


JUMPING = {"ceil", "clamp", "convert_element_type", "div", "floor", "is_finite", "rem", "select_n", "sign"}
OF_THEIR_OWN = {"stop_gradient", "optimization_barrier", "copy"}
TRUTHS = {"and", "eq", "ge", "gt", "le", "lt", "ne", "not", "or", "xor"}
SMOOTH = sorted({*ELEMENTWISE, *BY_EQUATION, "dot_general", "reduce_prod"} - JUMPING - OF_THEIR_OWN - TRUTHS)
"""What computes without jumps; what moves elements about has the slopes of what it moves."""


@pytest.mark.slow
@over("name", SMOOTH)
def test_its_slopes_are_those_of_jax(name: str) -> None:
    """At one place, off all kinks, along one direction."""
    case = CASES[name]
    translated, function = _both(name)
    rng = np.random.default_rng(5)
    values = tuple(rng.uniform(low, high, SHAPE) for low, high in case.ranges)
    along = tuple(rng.standard_normal(SHAPE) for _ in values)
    slopes = translated.jacobian()(*(value.ravel() for value in values), np.zeros(translated.size1_out(0)))
    matrix = np.hstack([np.array(each) for each in (slopes if isinstance(slopes, tuple) else (slopes,))])
    expected = np.asarray(jax.jvp(function, values, along)[1]).ravel()
    found = matrix @ np.concatenate([direction.ravel() for direction in along])
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)


def test_a_place_that_an_input_decides_is_held_in_the_table_as_jax_holds_it() -> None:
    def look_up(table: Array, at: Array) -> Array:
        return table[jnp.floor(at).astype(jnp.int64)]

    translated = to_casadi("translated", look_up, {"table": np.zeros(6), "at": np.zeros(())}, ["found"])
    by_jax, table = jax.jit(look_up), np.random.default_rng(0).standard_normal(6)
    for place in range(-9, 12):
        assert float(translated(table, place)) == float(by_jax(table, np.float64(place)))


@pytest.mark.parametrize("filling", [None, 7.0])
def test_out_of_place_stands_what_jax_puts_there(filling: float | None) -> None:
    def look_up(at: Array) -> Array:
        return jnp.asarray(TABLE[0]).at[jnp.floor(at).astype(jnp.int64)].get(mode="fill", fill_value=filling)

    translated = to_casadi("translated", look_up, {"at": np.zeros(17)}, ["found"])
    at = np.arange(-8.0, 9.0)
    np.testing.assert_array_equal(np.array(translated(at)).ravel(), np.asarray(jax.jit(look_up)(at)))


@given(st.integers(0, 3))
def test_one_case_of_many(which: int) -> None:
    cases: list[Any] = [jnp.sin, jnp.cos, jnp.exp, jnp.tanh]

    def switched(which: Array, x: Array) -> Array:
        return lax.switch(jnp.floor(which).astype(jnp.int32), cases, x)

    translated = to_casadi("translated", switched, {"which": np.zeros(()), "x": np.zeros(2)}, ["y"])
    x = np.array([0.3, -0.7])
    np.testing.assert_allclose(
        np.array(translated(which, x)).ravel(), np.asarray(cases[which](x)), rtol=1e-14
    )
