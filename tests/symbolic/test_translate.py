"""What a translation takes and gives, and what it refuses."""

from typing import Any

import casadi as ca
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.symbolic.operations import TranslationError
from savgs_ident.symbolic.translate import to_casadi, translate


def test_inputs_and_outputs_have_the_names_given() -> None:
    translated = to_casadi(
        "translated",
        lambda mass, place: (mass * place, jnp.sum(place)),
        {"mass": np.zeros(()), "place": np.zeros((2, 2))},
        ["momentum", "sum"],
    )
    assert translated.name() == "translated"
    assert [translated.name_in(i) for i in range(translated.n_in())] == ["mass", "place"]
    assert [translated.name_out(i) for i in range(translated.n_out())] == ["momentum", "sum"]
    assert [translated.numel_in(i) for i in range(translated.n_in())] == [1, 4]
    found = translated(mass=2.0, place=[1.0, 2.0, 3.0, 4.0])
    assert np.array(found["momentum"]).ravel().tolist() == [2.0, 4.0, 6.0, 8.0]
    assert float(found["sum"]) == 10.0


def test_arrays_become_columns_with_their_last_index_fastest() -> None:
    translated = to_casadi("translated", jnp.transpose, {"x": np.zeros((2, 3))}, ["y"])
    assert np.array(translated(np.arange(6.0))).ravel().tolist() == [0.0, 3.0, 1.0, 4.0, 2.0, 5.0]


def test_trees_are_taken_leaf_by_leaf() -> None:
    def function(p: dict[str, Array], x: tuple[Array, Array]) -> dict[str, Array]:
        return {"later": p["b"] * x[1], "first": p["a"] + x[0]}

    zero = np.zeros(())
    translated = translate(function, {"b": zero, "a": zero}, (zero, np.zeros(2)))
    a, b, x = ca.SX.sym("a"), ca.SX.sym("b"), ca.SX.sym("x")
    y = ca.SX.sym("y", 2)
    first, later = translated(a, b, x, y)
    values = ca.Function("values", [a, b, x, y], [first, later])(1.0, 2.0, 3.0, [4.0, 5.0])
    assert float(values[0]) == 4.0
    assert np.array(values[1]).ravel().tolist() == [8.0, 10.0]


def test_empty_arrays_and_results_that_depend_on_nothing() -> None:
    translated = to_casadi(
        "translated",
        lambda x, y: (jnp.concatenate([x, y]), jnp.ones(2)),
        {"x": np.zeros(0), "y": np.zeros(1)},
        ["both", "ones"],
    )
    both, ones = translated(np.zeros(0), 3.0)
    assert float(both) == 3.0
    assert np.array(ones).ravel().tolist() == [1.0, 1.0]


def test_a_result_that_vanishes_is_there_all_the_same() -> None:
    translated = to_casadi("translated", lambda x: jnp.stack([x, 0.0 * x]), {"x": np.zeros(())}, ["y"])
    assert translated.sparsity_out(0).is_dense()


def test_what_is_known_beforehand_may_be_computed_by_anything() -> None:
    def function(x: Array) -> Array:
        return x * jnp.sort(jnp.asarray([3.0, 1.0, 2.0])) + jnp.linalg.inv(2.0 * jnp.eye(3))[0]

    translated = to_casadi("translated", function, {"x": np.zeros(())}, ["y"])
    assert np.array(translated(2.0)).ravel() == pytest.approx([2.5, 4.0, 6.0])


def test_an_unknown_primitive_is_named_with_its_place() -> None:
    def sorted_doubly(x: Array) -> Array:
        return 2.0 * jnp.sort(x)

    with pytest.raises(
        TranslationError, match=r"'sort' has no translation.*test_translate\.py:\d+.*sorted_doubly"
    ):
        to_casadi("translated", jax.jit(sorted_doubly), {"x": np.zeros(3)}, ["y"])


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: x.astype(jnp.float32), "float32"),
        (lambda x: (x.astype(jnp.int64) & 3).astype(jnp.float64), "'and' works on the bits"),
        (lambda x: jnp.zeros(3).at[x[0].astype(jnp.int64)].set(1.0), "places that depend on the inputs"),
    ],
)
def test_what_casadi_cannot_do_is_refused(function: Any, message: str) -> None:
    with pytest.raises(TranslationError, match=message + r".*test_translate\.py:\d+"):
        to_casadi("translated", function, {"x": np.zeros(3)}, ["y"])


def test_columns_of_another_length_are_refused() -> None:
    with pytest.raises(TranslationError, match=r"\[2\] entries .* \[\(3,\)\]"):
        translate(jnp.sin, np.zeros(3))(ca.SX.sym("x", 2))


def test_a_branch_not_taken_spoils_no_slope() -> None:
    """Even where its own slope is infinite, in either direction and twice."""

    def function(x: Array) -> Array:
        return jnp.where(x[1] > 0.0, jnp.sqrt(x[0] * x[2]) + 1.0 / x[0] + jnp.log(x[2]), x[1] ** 2)

    translated = to_casadi("translated", function, {"x": np.zeros(3)}, ["y"])
    x = ca.SX.sym("x", 3)
    y = translated(x)
    nowhere = np.array([0.0, -1.0, 0.0])
    forward = ca.Function("forward", [x], [ca.jtimes(y, x, ca.SX([1.0, 1.0, 1.0]))])
    reverse = ca.Function("reverse", [x], [ca.jtimes(y, x, ca.SX(1.0), True)])
    twice = ca.Function("twice", [x], [ca.hessian(y, x)[0]])
    assert float(forward(nowhere)) == -2.0
    assert np.array(reverse(nowhere)).ravel().tolist() == [0.0, -2.0, 0.0]
    assert np.array(twice(nowhere)).tolist() == [[0.0] * 3, [0.0, 2.0, 0.0], [0.0] * 3]
