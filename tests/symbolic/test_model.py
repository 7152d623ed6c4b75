"""The rig's equations in CasADi against the same in JAX."""

from collections.abc import Callable
from typing import Any, NamedTuple

import casadi as ca
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import read_sensors
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.symbolic.translate import to_casadi

from ..plants.quarter_car.instants import draw_instants, inputs_of, motion_of, shifted

COUNT = 200


class Translation(NamedTuple):
    """A model's residual in both languages, and arguments to try: instants, states, their rates, parameters.

    ``jax`` takes all of them at once, ``casadi`` as columns.
    """

    casadi: ca.Function
    jax: Callable[..., Array]
    tried: tuple[NDArray[np.float64], ...]


TRIED = {frozenset(effects): name for name, effects in {"catalogue": CATALOGUE, **MODELS}.items()}
"""The models of the paper, and the rig with every effect there is where that is not one of them."""


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(effects, id=name, marks=() if name == "catalogue" else pytest.mark.slow)
        for effects, name in TRIED.items()
    ],
)
def translated(rig: Rig, request: pytest.FixtureRequest) -> Translation:
    """A model in both languages."""
    effects = tuple(name for name in CATALOGUE if name in request.param)
    model, table = build_model(rig, effects), model_parameters(rig, effects)
    names, states = list(table), len(model.states)

    def residual(instant: Array, s: Array, sd: Array, values: Array) -> Array:
        p = dict(zip(names, jnp.unstack(values), strict=True))
        return model.residual(p, motion_of(instant), s, sd, inputs_of(instant))

    rng = np.random.default_rng(3)
    instants = draw_instants(4, COUNT)
    scale = np.array([state.scale for state in model.states])
    # Anchors about where the sprung mass is: sticking and sliding.
    s = instants[:, :1] + rng.standard_normal((COUNT, states)) * scale * 10.0 ** rng.uniform(
        -4, 0, (COUNT, 1)
    )
    sd = 10.0 * scale * rng.standard_normal((COUNT, states))
    parameters = np.array([list(shifted(table.as_dict(), seed).values()) for seed in range(COUNT)])
    examples = dict(zip(("instant", "s", "sd", "p"), (instants[0], s[0], sd[0], parameters[0]), strict=True))
    casadi = to_casadi("residual", residual, examples, ["residual"])
    return Translation(casadi, jax.jit(jax.vmap(residual)), (instants, s, sd, parameters))


def test_the_residual_is_the_same(translated: Translation) -> None:
    expected = np.asarray(translated.jax(*translated.tried))
    found = np.array(translated.casadi.map(COUNT)(*(each.T for each in translated.tried))).T
    assert np.isfinite(expected).all()
    largest = np.max(np.abs(expected), axis=0)
    assert np.max(np.abs(found - expected) / (np.abs(expected) + largest)) < 1e-12


@pytest.mark.slow
def test_its_slopes_are_the_same(translated: Translation) -> None:
    """Along one direction a place, in the motion, the states and all parameters at once."""
    rng = np.random.default_rng(6)
    along = tuple(rng.standard_normal(each.shape) * np.abs(each) for each in translated.tried)
    expected = np.asarray(jax.jvp(translated.jax, translated.tried, along)[1])
    rows = translated.casadi.size1_out(0)
    jacobian = translated.casadi.jacobian().map(COUNT)(
        *(each.T for each in translated.tried), np.zeros((rows, COUNT))
    )
    found, sizes = np.zeros_like(expected), np.zeros_like(expected)
    for slopes, direction in zip(jacobian, along, strict=True):
        matrices = np.array(slopes).reshape(rows, COUNT, direction.shape[1]).swapaxes(0, 1)
        found += np.einsum("kij,kj->ki", matrices, direction)
        sizes += np.einsum("kij,kj->ki", np.abs(matrices), np.abs(direction))
    assert np.max(np.abs(found - expected) / (sizes + np.max(sizes, axis=0))) < 1e-12


def test_what_lies_beyond_the_linkage_is_not_a_number(translated: Translation) -> None:
    """Where JAX says so, and only there."""
    instants = translated.tried[0].copy()
    instants[:, 1] = np.linspace(-3.0, 3.0, COUNT)
    expected = np.isnan(np.asarray(translated.jax(instants, *translated.tried[1:])))
    found = np.isnan(
        np.array(translated.casadi.map(COUNT)(*(each.T for each in (instants, *translated.tried[1:])))).T
    )
    assert np.array_equal(found, expected)
    assert 0 < np.sum(expected) < expected.size


def test_the_sensors_read_the_same(rig: Rig) -> None:
    table = model_parameters(rig, ())
    names = list(table)

    def readings(theta: Array, acceleration: Array, values: Array) -> Any:
        return tuple(read_sensors(dict(zip(names, jnp.unstack(values), strict=True)), theta, acceleration))

    values = np.array(list(table.as_dict().values()))
    one = np.zeros(())
    casadi = to_casadi("seen", readings, {"theta": one, "acceleration": one, "p": values}, ["a", "l"])
    for theta in np.linspace(-0.3, 0.3, 7):
        expected = jax.jit(readings)(np.float64(theta), np.float64(2.0), values)
        found = [float(each) for each in casadi(theta, 2.0, values)]
        assert found == pytest.approx([float(each) for each in expected], rel=1e-13, abs=1e-15)
