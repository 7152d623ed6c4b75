"""A fingerprint distinguishes whatever shapes a program, and nothing that does not."""

import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

import savgs_ident
from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values
from savgs_ident.effects.base import AbstractNumberLaw, Port, Role
from savgs_ident.effects.effect import effect_at
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model
from savgs_ident.plants.quarter_car.forces import damper_curve
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.ports import INERTIA
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.simulate.mesh import Layout, uniform_mesh
from savgs_ident.simulate.periodic import simulate_periodic
from savgs_ident.simulate.program_cache import TRACED, digest_of_sources, fingerprint
from savgs_ident.simulate.readings import harmonics

from ..in_one_test import over

PACKAGE = Path(savgs_ident.__file__).parent


def _of(*args: object) -> str:
    found = fingerprint(harmonics, args)
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
    rail, tyre = CATALOGUE["rail_coulomb"], CATALOGUE["tyre_friction"]
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
    assert fingerprint(simulate_periodic, ()) != fingerprint(harmonics, ())


def test_a_change_counts_where_programs_are_traced_and_nowhere_else(tmp_path: Path) -> None:
    """A comment counts too: what is hashed is the text."""
    package = shutil.copytree(PACKAGE, tmp_path / "package", ignore=shutil.ignore_patterns("__pycache__"))
    before = digest_of_sources(package)
    for folder, counts in (("report", False), ("cli", False), ("plants", True), ("core", True)):
        with next((package / folder).glob("*.py")).open("a") as file:
            file.write("# another comment\n")
        after = digest_of_sources(package)
        assert (after != before) == counts, folder
        before = after


def test_no_program_is_defined_elsewhere() -> None:
    defining = re.compile(r"@eqx\.|@(jax|partial\(jax)\.|filter_jit|jax\.jit|run_cached\(")
    elsewhere = [path for path in PACKAGE.rglob("*.py") if path.relative_to(PACKAGE).parts[0] not in TRACED]
    assert elsewhere
    assert [path for path in elsewhere if defining.search(path.read_text(encoding="utf-8"))] == []


@dataclass(frozen=True)
class _Foreign:
    value: float


class _ForeignLaw(AbstractNumberLaw):
    """Its source is not part of the package: a change of it would go unnoticed."""

    name: ClassVar[str] = "foreign"
    roles: ClassVar[tuple[Role, ...]] = (Role("number"),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def changed(self, v: Values) -> Array:
        return v["number"]


_FOREIGN = effect_at("foreign", INERTIA, _ForeignLaw(), {"number": "m_s"})


@over(
    "unknown",
    [_Foreign(1.0), _FOREIGN, object(), {1, 2}, eqx.nn.Identity(), abs, Rig],
    ids=["dataclass", "effect", "object", "set", "module", "function", "class"],
)
def test_what_cannot_be_described_has_no_fingerprint(unknown: object) -> None:
    assert fingerprint(simulate_periodic, (1, (unknown,))) is None


def test_functions_from_elsewhere_and_inner_ones_have_none() -> None:
    assert fingerprint(np.sum, ()) is None
    assert fingerprint(lambda: None, ()) is None
