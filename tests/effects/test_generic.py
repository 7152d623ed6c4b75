"""Generic laws at the ports of a plant that has no catalogue: named, sized and nothing at their null."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import Fundamental, InputSignal, Load, Number, Port, PortKind, PortSignals
from savgs_ident.effects.composition import EffectsAtInstant, changed_numbers, sensor_transfer, states_of
from savgs_ident.effects.effect import LAWS, Effect, effect_at, generic_effects
from savgs_ident.effects.laws.gain import Gain
from savgs_ident.effects.laws.viscous import Viscous

from ..in_one_test import over

SLIDE = Port("slide", PortKind.FORCE, "slide", loaded=True, contact=("k_stick", "c_stick"))
BUSH = Port("bush", PortKind.FORCE, "bush", contact=("k_stick", "c_stick"))
SPINDLE = Port(
    "spindle",
    PortKind.FORCE,
    "spindle",
    displacement_unit="rad",
    force_unit="N m",
    displacement=0.1,
    velocity=5.0,
    force=0.2,
    loaded=True,
    damped_at=0.1,
)
BELT = Port("belt", PortKind.FORCE, "belt", sense=-1.0, loaded=True)
NUT = Port("nut", PortKind.SERIES, "spindle", displacement=1e-5, velocity=1e-3, force=100.0)
MASS = Port("mass", PortKind.NUMBER, "mass", numbers=(Number("m", "kg", 2.0), Number("J", "kg m^2", 0.1)))
DRIVE = Port("drive", PortKind.INPUT, "drive", displacement_unit="N", force_unit="N m")
ENCODER = Port("encoder", PortKind.SENSOR, "sensor.position")
EFFECTS = generic_effects((SLIDE, BUSH, SPINDLE, BELT, NUT, MASS, DRIVE, ENCODER))
PLANT = {"m": 30.0, "J": 0.5, "k_stick": 1e7, "c_stick": 1e3}

each_effect = over("effect", EFFECTS.values())


def _values(effect: Effect, *, null: bool) -> dict[str, Array]:
    own = ParameterTable(effect.parameters).as_dict()
    return as_values(PLANT | own | (dict(effect.null) if null else {}))


def _outcome(effect: Effect, p: dict[str, Array]) -> Array:
    """What it does to a lively instant of its port, less what is there without it."""
    size = len(states_of((effect,)))
    s, still = -0.3 * jnp.ones(size), jnp.zeros(size)
    at = EffectsAtInstant((effect,), p, s, still)
    port = effect.port
    match port.kind:
        case PortKind.FORCE:
            moved, fast = 3.0 * port.displacement, 0.7 * port.velocity
            signals = PortSignals(
                *map(jnp.asarray, (moved, fast, -40.0 if port.damped_at is not None else 40.0, 0.0))
            )
            there = at.force(port, signals)
            other = signals._replace(displacement=-signals.displacement)
            return jnp.stack([there, at.force(port, other)])
        case PortKind.SERIES:
            return effect.balance(p, Load(jnp.asarray(port.force), jnp.zeros(())), jnp.zeros(size), still)
        case PortKind.NUMBER:
            return jnp.stack([changed_numbers((effect,), p)[name] - p[name] for name in ("m", "J")])
        case PortKind.INPUT:
            recorded = InputSignal(jnp.asarray(0.3), jnp.asarray(2.0))
            moved = at.input(port, recorded, Fundamental(jnp.asarray(0.4), jnp.asarray(9.0)))
            return jnp.stack([moved.value - recorded.value, moved.rate - recorded.rate])
        case PortKind.SENSOR:
            transfer = sensor_transfer((effect,), port.location, p, jnp.asarray(7.0)) - 1.0
            return jnp.stack([transfer.real, transfer.imag])


def test_names_are_those_of_ports_numbers_and_laws() -> None:
    assert all(name == effect.name for name, effect in EFFECTS.items())
    assert {"spindle_viscous", "slide_coulomb", "nut_backlash", "mass_m_offset", "mass_J_scale"} <= set(
        EFFECTS
    )
    assert {"drive_harmonics", "encoder_lag", "spindle_one_sided", "belt_saturating_friction"} <= set(EFFECTS)
    parameters = [each.name for effect in EFFECTS.values() for each in effect.parameters]
    assert len(set(parameters)) == len(parameters)


def test_every_law_that_needs_no_more_than_a_port_is_there() -> None:
    assert {type(law) for law in LAWS} - {type(effect.law) for effect in EFFECTS.values()} == {
        type(law) for law in LAWS if law.name == "tilt"
    }


def test_a_contact_that_sticks_has_limits_and_a_port_that_does_not_a_bristle_of_its_own() -> None:
    at_the_slide = {effect.law.name for effect in EFFECTS.values() if effect.port == SLIDE}
    assert {"coulomb", "preload", "stribeck", "asymmetry"} <= at_the_slide
    assert not {"friction", "breakaway"} & at_the_slide
    at_the_bush = {effect.law.name for effect in EFFECTS.values() if effect.port == BUSH}
    assert {"preload", "breakaway"} <= at_the_bush
    assert not {"coulomb", "stribeck", "asymmetry", "friction"} & at_the_bush
    assert "spindle_friction" in EFFECTS


@pytest.mark.slow
@each_effect
def test_it_is_nothing_at_its_null_and_shows_itself_there(effect: Effect) -> None:
    null = _values(effect, null=True)
    assert effect.null
    assert not np.any(np.asarray(_outcome(effect, null)))
    slopes = jax.jacfwd(lambda p: _outcome(effect, p))(null)
    for name in effect.null:
        assert np.all(np.isfinite(slopes[name]))
        if effect.law.name not in ("upper_stop", "lower_stop"):
            assert np.any(np.asarray(slopes[name]) != 0.0), name


@each_effect
def test_it_is_something_at_its_typical_size(effect: Effect) -> None:
    assert np.any(np.asarray(_outcome(effect, _values(effect, null=False))))


@each_effect
def test_its_sizes_are_within_its_bounds_and_its_units_those_of_the_port(effect: Effect) -> None:
    for each in effect.parameters:
        assert each.lower <= each.value <= each.upper
        assert each.unit
    for state in effect.states:
        assert state.name.startswith(effect.name)
        assert state.unit.startswith(effect.port.displacement_unit)


def test_a_law_is_the_same_at_a_port_that_counts_its_force_the_other_way() -> None:
    """The force is the other one, the power is not."""
    found = []
    for port in (SLIDE, BELT):
        effect = generic_effects((port,))[f"{port.name}_viscous"]
        signals = PortSignals(*map(jnp.asarray, (0.0, 0.2, 0.0, 0.0)))
        found.append(float(effect.force(_values(effect, null=False), signals, jnp.zeros(0))) * port.sense)
    assert found[0] == found[1] < 0.0


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="no law of a force port"):
        effect_at("wrong", SLIDE, Gain(), {"error": 0.1})
    with pytest.raises(ValueError, match="the numbers that it takes"):
        effect_at("wrong", SLIDE, Viscous(), {})
