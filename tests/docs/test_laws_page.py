"""docs/laws.md: every law is there with its numbers, and its formulas, evaluated, are what the code does."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    AbstractLaw,
    AbstractNumberLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Fundamental,
    InputSignal,
    Load,
    Number,
    Port,
    PortKind,
    PortSignals,
)
from savgs_ident.effects.effect import LAWS
from savgs_ident.effects.laws.asymmetry import Asymmetry
from savgs_ident.effects.laws.backlash import Backlash
from savgs_ident.effects.laws.compliance import Compliance
from savgs_ident.effects.laws.massive_compliance import MassiveCompliance
from savgs_ident.effects.laws.resonance import Resonance
from savgs_ident.effects.laws.tilt import Tilt

PAGE = (Path(__file__).resolve().parents[2] / "docs/laws.md").read_text("utf-8")
KINDS = {"number": AbstractNumberLaw, "input": AbstractInputLaw, "sensor": AbstractSensorLaw}
MATHS = {"exp": np.exp, "abs": abs, "max": max, "min": min, "clip": np.clip, "pi": np.pi}
ROWS = re.findall(r"^\| `(\w+)`([^|]*) \| ([^|]*) \| ([^|]*) \|$", PAGE, re.M)
PORT = Port(
    "p", PortKind.FORCE, "p", force=30.0, displacement=0.1, velocity=0.5, numbers=(Number("n", "1", 0.1),)
)


def _laws(name: str, of: str) -> list[AbstractLaw]:
    kind = next((each for word, each in KINDS.items() if f"of a {word}" in of or f"of an {word}" in of), None)
    others = tuple(KINDS.values())
    return [
        law
        for law in LAWS
        if law.name == name and (isinstance(law, kind) if kind else not isinstance(law, others))
    ]


def test_every_law_that_is_offered_is_on_the_page() -> None:
    offered = {law.name for law in LAWS if not isinstance(law, Tilt)}
    listed = {law.name for name, of, *_ in ROWS for law in _laws(name, of)}
    assert listed | {"oscillator", "friction", "harmonics"} == offered
    for name in offered:
        assert f"`{name}`" in PAGE


@pytest.mark.parametrize(("name", "of", "formula", "numbers"), ROWS, ids=[f"{a}{b}" for a, b, *_ in ROWS])
def test_its_numbers_are_those_of_the_law_with_the_one_in_bold_that_makes_it_vanish(
    name: str, of: str, formula: str, numbers: str
) -> None:
    (law,) = _laws(name, of)
    for role in law.roles:
        assert role.name in formula + numbers
    assert re.findall(r"\*\*(\w+)\*\*", numbers) == [each.name for each in law.roles if each.null is not None]


def _said(formula: str, known: Mapping[str, Any]) -> Any:
    expression = re.findall(r"`([^`]+)`", formula)[0]
    return eval(expression, {"__builtins__": {}}, {**MATHS, **known})


@pytest.mark.parametrize(
    ("name", "of", "formula"),
    [row[:3] for row in ROWS if {"d", "tanh"}.isdisjoint(re.findall(r"\w+", row[2]))],
)
def test_its_formulas_are_what_the_code_does(name: str, of: str, formula: str) -> None:
    (law,) = _laws(name, of)
    rng = np.random.default_rng(7)
    for _ in range(50):
        numbers = {each.name: float(rng.uniform(0.05, 0.9)) for each in law.roles}
        x, v, load, f = (float(each) for each in rng.normal(size=4))
        if isinstance(law, AbstractFrictionLimitLaw):
            load = abs(load)
        known = {**numbers, "x": x, "v": v, "N": load, "f": abs(f), "u": x}
        held = {key: jnp.asarray(value) for key, value in numbers.items()}
        at = PortSignals(*(jnp.asarray(each) for each in (x + 0.2, v, load, 0.2)))
        expected = _said(formula, known)
        if isinstance(law, AbstractForceLaw):
            assert float(law.force(held, at, jnp.zeros(0))) == pytest.approx(expected)
        elif isinstance(law, AbstractFrictionLimitLaw):
            up, down = law.limit(held, at)
            assert float(up) == pytest.approx(expected)
            assert float(down) == pytest.approx(-expected if isinstance(law, Asymmetry) else expected)
        elif isinstance(law, AbstractNumberLaw):
            assert float(law.changed(held)) == pytest.approx(expected)
        elif isinstance(law, AbstractInputLaw):
            signal = InputSignal(jnp.asarray(x), jnp.asarray(v))
            still = Fundamental(jnp.asarray(0.0), jnp.asarray(0.0))
            assert x + float(law.shift(held, signal, still).value) == pytest.approx(expected)
        else:
            assert isinstance(law, AbstractSensorLaw)
            assert complex(law.transfer(held, jnp.asarray(abs(f)))) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("law", "deflection"),
    [
        (Compliance(), "compliance * F"),
        (MassiveCompliance(), "compliance * F"),
        (Resonance(), "mobility * F / (2 * pi * frequency)**2"),
        (Backlash(), "backlash / 2 * (tanh((F + R) / change_over) - tanh(R / change_over))"),
    ],
    ids=lambda each: getattr(each, "name", ""),
)
def test_what_gives_way_does_so_under_a_load_at_rest(law: AbstractSeriesLaw, deflection: str) -> None:
    rng = np.random.default_rng(8)
    for _ in range(50):
        numbers = {each.name: float(rng.uniform(0.05, 0.9)) for each in law.roles}
        load, rest = (float(each) for each in rng.normal(size=2))
        known = {**numbers, **MATHS, "F": load, "R": rest, "tanh": np.tanh}
        still = np.zeros(len(law.states(PORT)))
        there = np.concatenate([[eval(deflection, {"__builtins__": {}}, known)], still[1:]])
        held = {key: jnp.asarray(value) for key, value in numbers.items()}
        at = Load(jnp.asarray(load + rest), jnp.asarray(rest))
        left = law.balance(held, at, jnp.asarray(there), jnp.asarray(still))
        np.testing.assert_allclose(np.asarray(left), 0.0, atol=1e-9)
