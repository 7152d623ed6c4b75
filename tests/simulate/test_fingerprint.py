"""A fingerprint tells apart whatever shapes a program, and nothing that does not."""

from dataclasses import dataclass, replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.rig import Rig
from savgs_ident.effects.rail_coulomb import RailCoulomb
from savgs_ident.effects.registry import MODELS, build_model
from savgs_ident.effects.tyre_friction import TyreFriction
from savgs_ident.model.damper import damper_curve
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.simulate.fingerprint import fingerprint
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.layout import Layout
from savgs_ident.simulate.mesh import uniform_mesh
from savgs_ident.simulate.periodic import simulate_periodic


def _of(*args: object) -> str:
    found = fingerprint(harmonics.__wrapped__, args)
    assert found is not None
    return found


def test_numbers_in_jax_arrays_do_not_count_but_shapes_and_types_do() -> None:
    assert _of(jnp.zeros(3)) == _of(jnp.ones(3))
    different = [jnp.zeros(3), jnp.zeros(4), jnp.zeros((3, 1)), jnp.zeros(3, jnp.int64), jnp.zeros(())]
    assert len({_of(each) for each in different}) == len(different)


def test_numbers_that_are_built_in_count() -> None:
    different = [
        1,
        1.0,
        True,
        "1",
        None,
        (1,),
        (1, 1),
        ((1,), 1),
        {"a": 1},
        {"b": 1},
        np.ones(1),
        np.zeros(1),
    ]
    assert len({_of(each) for each in different}) == len(different)


def test_models_differ_by_their_effects_their_order_and_their_damper(rig: Rig) -> None:
    plain = QuarterCar(damper_curve(rig))
    rail, tyre = RailCoulomb(), TyreFriction()
    harder = replace(
        rig, damper_force=tuple(np.asarray(rig.damper_force) * np.linspace(1.0, 2.0, len(rig.damper_force)))
    )
    models = [
        plain,
        plain + rail,
        plain + tyre,
        plain + rail + tyre,
        plain + tyre + rail,
        QuarterCar(damper_curve(harder)),
    ]
    assert len({_of(model) for model in models}) == len(models)
    assert _of(build_model(rig, MODELS["simtr"])) == _of(build_model(rig, MODELS["simtr"]))


def test_layouts_differ() -> None:
    assert _of(uniform_mesh(Layout((32, 64)))) != _of(uniform_mesh(Layout((64, 32))))
    assert _of(uniform_mesh(Layout((32, 64)))) == _of(uniform_mesh(Layout((32, 64))))


def test_functions_differ() -> None:
    assert fingerprint(simulate_periodic, ()) != fingerprint(harmonics.__wrapped__, ())


@dataclass(frozen=True)
class _Foreign:
    value: float


class _ForeignEffect(RailCoulomb):
    """Its source is not part of the package: a change of it would go unnoticed."""


@pytest.mark.parametrize(
    "unknown",
    [_Foreign(1.0), _ForeignEffect(), object(), {1, 2}, eqx.nn.Identity(), abs, Rig],
    ids=["dataclass", "effect", "object", "set", "module", "function", "class"],
)
def test_what_cannot_be_described_has_no_fingerprint(unknown: object) -> None:
    assert fingerprint(simulate_periodic, (1, (unknown,))) is None


def test_functions_from_elsewhere_and_inner_ones_have_none() -> None:
    assert fingerprint(np.sum, ()) is None
    assert fingerprint(lambda: None, ()) is None
