"""Foreign laws: nothing at their null, exact derivatives, no energy from nothing, and no law of a catalogue."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractSensorLaw,
    AbstractSeriesLaw,
    Family,
    PortSignals,
)
from savgs_ident.effects.effect import LAWS, Effect
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE
from savgs_ident.plants.quarter_car.ports import LOCATION_WORDS
from savgs_ident.validation.foreign_laws import FOREIGN, HighPass, SecondOrderFilter, foreign_laws

from ..effects.cycles import along_a_cycle
from ..effects.kinds import FOREIGN_EFFECTS, MECHANISMS, outcomes, seen_by, slopes
from ..in_one_test import over
from ..plants.quarter_car.instants import as_values

EFFECTS = tuple(FOREIGN_EFFECTS.values())
ONE_OF_EACH = tuple(FOREIGN_EFFECTS[names[0]] for names in foreign_laws().values())


def test_no_law_and_no_name_is_the_catalogues() -> None:
    own = {type(law) for law in LAWS} | {type(each.law) for each in CATALOGUE.values()}
    assert not own & {type(each.law) for each in EFFECTS}
    assert not {law.name for law in LAWS} & set(foreign_laws())
    assert not set(CATALOGUE) & set(FOREIGN)
    parameters = [p.name for each in EFFECTS for p in each.parameters]
    assert len(parameters) == len(set(parameters))


@over("name", FOREIGN)
def test_what_is_right_is_a_location_and_a_family_its_own_among_them(name: str) -> None:
    each = FOREIGN[name]
    assert set(each.ports) <= set(LOCATION_WORDS)
    assert each.effect.port.location in each.ports
    assert set(each.families) <= {family.value for family in Family}
    assert each.effect.law.family.value in each.families
    assert len(each.effect.states) <= 2
    assert "Source:" in (type(each.effect.law).__doc__ or "")


@over("effect", EFFECTS)
def test_a_typical_size_is_within_bounds_and_off_the_null(effect: Effect) -> None:
    for each in effect.parameters:
        assert each.lower <= each.value <= each.upper
        assert each.about
    assert effect.null
    for name, null in effect.null.items():
        (parameter,) = (each for each in effect.parameters if each.name == name)
        assert parameter.lower <= null <= parameter.upper
        assert parameter.value != null


@pytest.mark.slow
@over("effect", ONE_OF_EACH)
def test_at_its_null_it_is_nothing_and_has_a_slope(effect: Effect, numbers: dict[str, float]) -> None:
    seen = seen_by(effect, as_values(numbers), seed=4)
    if isinstance(effect.law, AbstractSeriesLaw):
        seen[:, 2:] = 0.0
    null = numbers | dict(effect.null)
    gone, there = (outcomes(effect, as_values(given), seen) for given in (null, numbers))
    force = slice(0, 1) if isinstance(effect.law, AbstractForceLaw) else slice(None)
    nothing = [1.0, 0.0] if isinstance(effect.law, AbstractSensorLaw) else 0.0
    assert np.all(gone[:, force] == nothing)
    assert np.any(there[:, force] != nothing)
    still = as_values(dict.fromkeys(numbers, 0.0))
    for name in effect.null:
        found = slopes(effect, as_values(null), still | {name: np.asarray(1.0)}, seen)
        assert np.isfinite(found).all()
        assert np.any(found != 0.0)


@pytest.mark.slow
@over("effect", ONE_OF_EACH)
def test_derivatives_are_those_of_differences(effect: Effect, numbers: dict[str, float]) -> None:
    seen = seen_by(effect, as_values(numbers), seed=5)
    still = as_values(dict.fromkeys(numbers, 0.0))
    for each in effect.parameters:
        step = 1e-5 * each.value

        def at(offset: float, name: str = each.name, value: float = each.value) -> np.ndarray:
            return outcomes(effect, as_values(numbers | {name: value + offset}), seen)

        expected, nearer = ((at(d) - at(-d)) / (2.0 * d) for d in (step, step / 2.0))
        found = slopes(effect, as_values(numbers), still | {each.name: np.asarray(1.0)}, seen)
        size = np.max(np.abs(expected), axis=0) + 1e-9 * np.max(np.abs(at(0.0)), axis=0) / step
        smooth = np.abs(expected - nearer) <= 1e-6 * size
        assert np.mean(smooth) > 0.97, each.name
        wrong = np.abs(found - expected) > np.broadcast_to(1e-5 * size, found.shape)
        assert not np.any(wrong & smooth), each.name


@pytest.mark.slow
@over("effect", [each for each in ONE_OF_EACH if isinstance(each.law, MECHANISMS)])
def test_it_adds_no_energy_over_a_cycle(effect: Effect, numbers: dict[str, float]) -> None:
    cycle = along_a_cycle(effect, as_values(numbers), 1)
    # What is lightly damped, and what creeps, repeats to what eight periods leave of its beginning.
    settled = effect.law.family is not Family.OSCILLATOR
    assert cycle.open < (2e-2 if settled else 0.5)
    assert np.max(np.abs(cycle.power)) > 0.0
    if settled:
        assert np.mean(cycle.power) >= -1e-3 * np.mean(np.abs(cycle.power))


def test_filters_are_those_of_the_books() -> None:
    """At its corner a second order passes 1 / (2 zeta), a quarter turn late; a high-pass half the power, ahead."""
    corner = jnp.asarray([50.0])
    given = {"time": jnp.asarray(1.0 / (2.0 * np.pi * 50.0)), "damping_ratio": jnp.asarray(0.5)}
    np.testing.assert_allclose(SecondOrderFilter().transfer(given, corner), [-1.0j], atol=1e-12)
    passed = HighPass().transfer({"corner": jnp.asarray(50.0)}, jnp.asarray([0.0, 50.0]))
    np.testing.assert_allclose(passed, [0.0, (1.0 + 1.0j) / 2.0], atol=1e-12)


def test_an_attached_mass_pulls_by_its_mount() -> None:
    """In small motions as a spring does, and by twice that where the mount is deflected so far."""
    effect = FOREIGN_EFFECTS["body_hardening_oscillator"]
    p = as_values({each.name: each.value for each in effect.parameters})
    still, mass, frequency = (
        jnp.zeros(()), p["body_hardening_oscillator_mass"], p["body_hardening_oscillator_frequency"],
    )  # fmt: skip
    large = 1.5 * effect.port.displacement
    for deflection, harder in ((1e-6, 1.0), (large, 2.0)):
        force = effect.force(p, PortSignals(jnp.asarray(deflection), still, still, still), jnp.zeros(2))
        assert float(force) == pytest.approx(
            float(-harder * mass * (2.0 * np.pi * frequency) ** 2 * deflection), rel=1e-6
        )
