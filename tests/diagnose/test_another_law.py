"""Rigs whose effects are those of the catalogue by another law: they are named, and said to be of another law.

And one whose effect is at the port of one of the catalogue but nothing like it: that is unknown, and at that port.

The recordings are periodic motions of the rig with the other law, and noise of the laboratory's campaign.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Complex, Float

from savgs_ident.core.parameter import Parameter
from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.diagnose import diagnose_response
from savgs_ident.effects.registry import MODELS, build_model, model_parameters
from savgs_ident.model.effect import (
    AbstractEffect,
    AbstractGrip,
    AbstractRoadFault,
    AbstractSensorFault,
    Cam,
    Grip,
    InternalState,
    Port,
    PortSignals,
)
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values, as_values
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.measured import measured_excitation
from savgs_ident.simulate.periodic import simulate_periodic

from .conftest import Measure


class Unlisted(AbstractEffect):
    """An effect that no catalogue has, without parameters or states."""

    parameters: ClassVar[tuple[Parameter, ...]] = ()
    null: ClassVar[Mapping[str, float]] = {}
    states: ClassVar[tuple[InternalState, ...]] = ()
    symptom: ClassVar[str] = ""
    reference: ClassVar[str] = ""


class ExponentialStribeck(Unlisted, AbstractGrip):
    """The rise falls off exponentially, not as a bell."""

    name: ClassVar[str] = "exponential_stribeck"
    port: ClassVar[Port] = Port.RAIL

    def grip(self, p: Values, signals: PortSignals) -> Grip:
        share = 0.25 * p["mu_r"] * jnp.exp(-jnp.abs(signals.velocity) / 0.08) * signals.load
        return Grip(share, share)


class SecondOrderLag(Unlisted, AbstractSensorFault):
    """The accelerometer lags by a filter of second order, not of first."""

    name: ClassVar[str] = "second_order_lag"
    port: ClassVar[Port] = Port.SENSOR_SPRUNG_ACCEL

    def transfer(self, p: Values, frequency: Float[Array, " f"]) -> Complex[Array, " f"]:
        s = 2j * jnp.pi * frequency * 0.008
        return 1.0 / (1.0 + 1.4 * s + s**2)


class WavyCam(Unlisted, AbstractRoadFault):
    """A wave of fourth order on the cam, where the catalogue has a second and a third."""

    name: ClassVar[str] = "wavy_cam"
    port: ClassVar[Port] = Port.ROAD

    def shift(self, p: Values, road: Road, cam: Cam) -> Road:
        return Road(1e-4 * jnp.cos(4.0 * cam.angle), -4e-4 * jnp.sin(4.0 * cam.angle) * cam.speed)


def _recorded(response: HarmonicResponse, rig: Rig, effect: AbstractEffect) -> HarmonicResponse:
    """A response of the rig with one more effect: the periodic motion, and noise as in ``response``."""
    baseline = MODELS["simtr"]
    model = build_model(rig, baseline) + effect
    p = as_values(model_parameters(rig, baseline).as_dict())
    solution = simulate_periodic(model, p, measured_excitation(response, float(p["psi_nominal"])))
    assert all(status.ok for status in solution.status())
    clean = np.asarray(harmonics(model, p, solution, response.orders))
    shown = response.harmonics.copy()
    random = np.random.default_rng(7)
    for place, name in enumerate(RESPONSE_CHANNELS):
        c = response.channel(name)
        root = np.linalg.cholesky(response.covariance[:, c, 1:])
        noise = np.einsum("dkij,dkj->dki", root, random.standard_normal(root.shape[:-1]))
        shown[:, c, 1:] = clean[:, place, 1:] + noise[..., 0] + 1j * noise[..., 1]
    return replace(response, harmonics=shown)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "name", "port"),
    [
        (ExponentialStribeck, "rail_stribeck", "rail"),
        (SecondOrderLag, "accel_lag", "sensor.sprung_accel"),
    ],
)
def test_an_effect_by_another_law_is_named(
    measure: Measure, rig: Rig, effect: Callable[[], AbstractEffect], name: str, port: str
) -> None:
    diagnosis = diagnose_response(_recorded(measure("nominal"), rig, effect()), rig)
    assert diagnosis.verdict.kind == "effect"
    assert diagnosis.verdict.effects == (name,)
    assert diagnosis.verdict.ports == (port,)
    assert diagnosis.verdict.another_law
    assert "another law than the catalogue's" in diagnosis.verdict.sentence
    assert diagnosis.candidates[0].effects == (name,)
    assert diagnosis.shrink.share_closed > 0.9


@pytest.mark.slow
def test_a_wave_that_no_cam_of_the_catalogue_has_is_unknown_at_the_road(measure: Measure, rig: Rig) -> None:
    diagnosis = diagnose_response(_recorded(measure("nominal"), rig, WavyCam()), rig)
    assert diagnosis.verdict.kind == "unknown"
    assert diagnosis.verdict.ports == ("road",)
    assert not diagnosis.verdict.another_law
    assert diagnosis.shrink.share_closed > 0.9
