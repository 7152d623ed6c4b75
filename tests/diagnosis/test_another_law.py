"""A rig whose effect is one of the catalogue by another law: it is named, and said to be of another law.

And one whose effect is at the port of one of the catalogue but nothing like it: that is unknown, and at that port.

The recordings are periodic motions of the rig with the other law, and noise of the laboratory's campaign.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.values import Values, as_values
from savgs_ident.diagnosis.learning import LearnedLaw, learn
from savgs_ident.diagnosis.public import diagnose_response
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.base import (
    AbstractFrictionLimitLaw,
    AbstractInputLaw,
    Family,
    FrictionLimit,
    Fundamental,
    InputSignal,
    Port,
    PortSignals,
    Role,
)
from savgs_ident.effects.effect import Effect, effect_at
from savgs_ident.inference.find_map import find_map
from savgs_ident.inference.laplace_fit import search_of
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model, model_parameters
from savgs_ident.plants.quarter_car.plant import CHANNELS, QuarterCar
from savgs_ident.plants.quarter_car.ports import DAMPER, RAIL, ROAD, SUSPENSION
from savgs_ident.plants.quarter_car.rig import Rig
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import measured_excitation
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic
from savgs_ident.simulate.readings import harmonics
from savgs_ident.validation.foreign_laws import FOREIGN
from savgs_ident.validation.other_port import log_odds_of_port, log_odds_of_stand_in

from .conftest import COARSE, Measure, rig_problem


class ExponentialStribeck(AbstractFrictionLimitLaw):
    """The rise falls off exponentially, not as a bell."""

    name: ClassVar[str] = "exponential_stribeck"
    roles: ClassVar[tuple[Role, ...]] = (Role("coefficient"),)

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def limit(self, v: Values, signals: PortSignals) -> FrictionLimit:
        share = 0.25 * v["coefficient"] * jnp.exp(-jnp.abs(signals.velocity) / 0.08) * signals.load
        return FrictionLimit(share, share)


class WavyCam(AbstractInputLaw):
    """A wave of fourth order on the cam, where the catalogue has a second and a third."""

    name: ClassVar[str] = "wavy_cam"
    family: ClassVar[Family] = Family.SHAPE
    roles: ClassVar[tuple[Role, ...]] = ()

    def typical(self, port: Port) -> Mapping[str, Parameter | float]:
        return {}

    def shift(self, v: Values, signal: InputSignal, fundamental: Fundamental) -> InputSignal:
        turned = 4.0 * fundamental.angle
        return InputSignal(1e-4 * jnp.cos(turned), -4e-4 * jnp.sin(turned) * fundamental.speed)


STRIBECK = effect_at("exponential_stribeck", RAIL, ExponentialStribeck(), {"coefficient": "mu_r"})
WAVY = effect_at("wavy_cam", ROAD, WavyCam(), {})


def _recorded(response: HarmonicResponse, rig: Rig, effect: Effect, **values: float) -> HarmonicResponse:
    """A response of the rig with one more effect: periodic, with the noise of ``response``.

    The effect is of typical size where no ``values`` [SI] are given.
    """
    baseline = MODELS["simtr"]
    model = build_model(rig, baseline) + effect
    typical = {each.name: each.value for each in effect.parameters} | values
    p = as_values(typical | model_parameters(rig, baseline).as_dict())
    excitation = measured_excitation(QuarterCar, response, rig.parameters)
    solution = simulate_periodic(model, p, excitation, PeriodicSettings(iterations=300))
    assert all(status.ok for status in solution.status())
    clean = np.asarray(harmonics(model, p, solution, response.orders))
    shown = response.harmonics.copy()
    random = np.random.default_rng(7)
    for place, name in enumerate(each.name for each in CHANNELS):
        c = response.channel(name)
        root = np.linalg.cholesky(response.covariance[:, c, 1:])
        noise = np.einsum("dkij,dkj->dki", root, random.standard_normal(root.shape[:-1]))
        shown[:, c, 1:] = clean[:, place, 1:] + noise[..., 0] + 1j * noise[..., 1]
    return replace(response, harmonics=shown)


def _learned(response: HarmonicResponse, rig: Rig, port: Port) -> tuple[LearnedLaw, float]:
    """The law that is learned at a port beside the baseline, and the log evidence that it gains [nat]."""
    catalogue = {name: CATALOGUE[name] for name in MODELS["simtr"]}
    plant, data = rig_problem(response, rig, catalogue, COARSE.periodic)
    base = find_map(search_of(plant, data), (), {}, plant.start({}))
    (law,) = learn(plant, data, base, [port])
    return law, law.mode.evidence - base.evidence


@pytest.mark.slow
def test_an_effect_by_another_law_is_named(measure_few: Measure, rig: Rig) -> None:
    diagnosis = diagnose_response(_recorded(measure_few("nominal"), rig, STRIBECK), rig, COARSE)
    assert diagnosis.verdict.kind == "effect"
    assert diagnosis.verdict.effects == ("rail_stribeck",)
    assert diagnosis.verdict.ports == ("rail",)
    assert not diagnosis.verdict.law_known
    assert tuple(map(str, diagnosis.verdict.families)) == ("rail/friction",)
    assert "by a law that the catalogue does not have" in diagnosis.verdict.sentence
    assert diagnosis.shrink.closed_by_effect > 0.9
    assert diagnosis.learned is not None
    assert diagnosis.learned.effect == "learned_rail"
    assert diagnosis.shrink.after < 2.0 * diagnosis.shrink.floor


@pytest.mark.slow
def test_a_wave_that_no_cam_of_the_catalogue_has_is_a_shape_of_the_road(
    measure_few: Measure, rig: Rig
) -> None:
    diagnosis = diagnose_response(_recorded(measure_few("nominal"), rig, WAVY), rig, COARSE)
    assert diagnosis.verdict.kind == "effect"
    assert diagnosis.verdict.ports == ("road",)
    assert tuple(map(str, diagnosis.verdict.families)) == ("road/shape",)
    assert not diagnosis.verdict.law_known
    assert diagnosis.shrink.closed_by_effect > 0.9


@pytest.mark.slow
def test_a_friction_of_the_joints_would_do_the_same_in_the_strut_and_not_at_the_rail(
    measure_few: Measure, rig: Rig
) -> None:
    joints = FOREIGN["joint_smooth"].effect
    response = _recorded(measure_few("nominal"), rig, joints)
    strut, rail, road = (
        log_odds_of_port(response, rig, joints, each, COARSE) for each in ("strut", "rail", "road")
    )
    assert strut is not None
    assert abs(strut) < DEFAULTS.indistinguishable_log_odds
    assert rail is not None
    assert rail > 50.0
    assert road is None
    instead = log_odds_of_stand_in(response, rig, joints, "rail_viscous", COARSE)
    assert instead is not None
    assert instead > 50.0


@pytest.mark.slow
def test_a_friction_is_learned_with_the_velocity_over_which_it_turns_round(
    measure_few: Measure, rig: Rig
) -> None:
    """That of the joints does so over ten times the velocity of that of a seal."""
    there, force = CATALOGUE["joint_friction"], 12.0
    law, gain = _learned(
        _recorded(measure_few("nominal"), rig, there, joint_friction_force=force), rig, SUSPENSION
    )
    assert law.mode.status.ok
    assert law.only is Family.FRICTION
    assert gain > 100.0
    (slider,) = law.term.amplitudes
    assert law.values[slider.name] == pytest.approx(-force, rel=0.1)
    numbers = {role: number for role, number in there.numbers if isinstance(number, float)}
    assert law.values["learned_suspension_lag"] == pytest.approx(numbers["lag"], rel=0.4)


@pytest.mark.slow
def test_a_friction_that_calibration_nearly_takes_up_is_learned_as_large_as_it_is(
    measure_few: Measure, rig: Rig
) -> None:
    """A preload of the rail does nearly what a greater friction coefficient does."""
    there, force = CATALOGUE["rail_preload"], 25.0
    law, gain = _learned(_recorded(measure_few("nominal"), rig, there, rail_preload_force=force), rig, RAIL)
    assert law.mode.status.ok
    assert law.only is Family.FRICTION
    assert gain > 20.0
    (held,) = law.term.amplitudes
    assert law.values[held.name] == pytest.approx(force, rel=0.25)


@pytest.mark.slow
def test_a_play_with_a_film_is_learned_as_one_that_is_blocked_at_its_ends(
    measure_few: Measure, rig: Rig
) -> None:
    """The film gives way as a damper does, which no law of the load alone can do."""
    play, there = 3e-4, FOREIGN["damper_end_play"].effect
    law, gain = _learned(
        _recorded(measure_few("nominal"), rig, there, damper_end_play_play=play), rig, DAMPER
    )
    assert law.mode.status.ok
    assert law.family is Family.PLAY
    assert gain > 100.0
    blocked_at = DAMPER.displacement / law.values["learned_damper_blocking"]
    assert blocked_at == pytest.approx(play / 2.0, rel=0.2)


@pytest.mark.slow
def test_a_clearance_is_learned_as_a_stop_with_its_gap(measure_few: Measure, rig: Rig) -> None:
    """Its contact begins where no function of a fixed place does."""
    gap, there = 3.1e-3, FOREIGN["joint_clearance"].effect
    law, gain = _learned(
        _recorded(measure_few("nominal"), rig, there, joint_clearance_gap=gap), rig, SUSPENSION
    )
    assert law.mode.status.ok
    assert law.only is Family.STOP
    assert gain > 100.0
    stroke = law.values["learned_suspension_stroke"]
    assert law.values["learned_suspension_gap"] * stroke == pytest.approx(gap, rel=0.2)
