"""What is imposed on the model of what was recorded of road and link."""

from dataclasses import replace

import numpy as np
import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.plant import INPUTS, QuarterCar
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import SIGNIFICANT, inputs_at, measured_excitation
from savgs_ident.simulate.mesh import Layout, uniform_mesh

CHANNELS = ("road_height", "sprung_accel", "susp_deflection", "link_angle")
LINK = np.pi / 2.0
LINK_ORDERS = INPUTS[1].orders or 0
SD = 1e-6
"""Standard deviation of each harmonic's modulus: the trace of its covariance is SD^2."""


def _response(channels: tuple[str, ...] = CHANNELS, orders: int = 12) -> HarmonicResponse:
    """Two dwells whose every harmonic is just noise, but for a road and a link with a few that stand out."""
    shape = (2, len(channels), orders + 1)
    harmonics = np.full(shape, 3.0 * SD * np.exp(0.3j))
    if "road_height" in channels:
        road = harmonics[:, channels.index("road_height")]
        road[:, 0], road[:, 1], road[1, 3] = 0.02, 0.01375, 2e-4 * np.exp(1.1j)
    if "link_angle" in channels:
        link = harmonics[:, channels.index("link_angle")]
        link[:, 0], link[:, 2], link[:, LINK_ORDERS + 1 :] = 1.57, 1e-3j, 1e-3
    covariance = np.broadcast_to(SD**2 / 2.0 * np.eye(2), (*shape, 2, 2)).copy()
    some = np.ones(shape[:2])
    return HarmonicResponse(
        tests=("slow", "fast"),
        channels=channels,
        frequency=np.array([1.0, 2.0]),
        frequency_sd=np.zeros(2),
        harmonics=harmonics,
        covariance=covariance,
        valid=np.ones(shape, bool),
        peak_to_peak=some,
        peak_to_peak_sd=some,
        noise_sd=some,
        periods=np.array([8, 8]),
    )


def _imposed(response: HarmonicResponse, link: float) -> Excitation:
    return measured_excitation(QuarterCar, response, ParameterTable((Parameter("psi_nominal", link, "rad"),)))


def test_noise_is_not_imposed_and_what_stands_out_is() -> None:
    response = _response()
    found = _imposed(response, LINK)
    road, link = np.asarray(found.harmonics["road_height"]), np.asarray(found.harmonics["link_angle"])
    wanted = np.zeros_like(road)
    wanted[:, 1] = 0.01375
    wanted[1, 3] = 2e-4 * np.exp(1.1j)
    assert np.array_equal(road, wanted)
    assert np.array_equal(np.flatnonzero(link[0]), [0, 2])
    assert np.all(link[:, 0] == 1.57)
    assert np.all(link[:, 2] == 1e-3j)
    assert np.array_equal(np.asarray(found.frequency), response.frequency)


def test_link_orders_above_the_resolution_of_the_encoder_are_left_out() -> None:
    assert np.asarray(_imposed(_response(), LINK).harmonics["link_angle"]).shape == (2, LINK_ORDERS + 1)
    assert np.asarray(_imposed(_response(orders=5), LINK).harmonics["link_angle"]).shape == (2, 6)


@pytest.mark.parametrize(("size", "imposed"), [(0.99 * SIGNIFICANT, False), (1.01 * SIGNIFICANT, True)])
def test_the_limit_is_in_standard_deviations(size: float, imposed: bool) -> None:
    response = _response()
    harmonics = response.harmonics.copy()
    harmonics[0, 0, 2] = size * SD * np.exp(-2.0j)
    road = np.asarray(_imposed(replace(response, harmonics=harmonics), LINK).harmonics["road_height"])
    assert bool(road[0, 2] != 0.0) is imposed


def test_what_the_sampling_does_not_support_is_not_imposed() -> None:
    response = _response()
    valid = response.valid.copy()
    valid[1, 0, 3] = False
    road = np.asarray(_imposed(replace(response, valid=valid), LINK).harmonics["road_height"])
    assert road[1, 3] == 0.0
    assert road[1, 1] == 0.01375


def test_a_link_that_was_not_recorded_is_rigid(frictionless: QuarterCar) -> None:
    found = _imposed(_response(CHANNELS[:3]), 1.2)
    inputs = inputs_at(frictionless, found, uniform_mesh(Layout((16, 32))))
    assert np.all(np.asarray(inputs.link.angle) == 1.2)
    assert np.all(np.asarray(inputs.link.velocity) == 0.0)


def test_a_link_whose_mean_is_not_given_rests_where_it_is_said_to() -> None:
    response = _response()
    valid = response.valid.copy()
    valid[0, 3] = False
    link = np.asarray(_imposed(replace(response, valid=valid), 1.2).harmonics["link_angle"])
    assert link[0, 0] == 1.2
    assert np.all(link[0, 1:] == 0.0)
    assert link[1, 0] == 1.57


def test_without_a_road_there_is_nothing_to_drive_the_rig() -> None:
    with pytest.raises(InputError, match="the road was not recorded") as caught:
        _imposed(_response(CHANNELS[1:]), LINK)
    assert caught.value.channel == "road_height"
    assert "channels.toml" in caught.value.remedy


def test_the_nodes_see_the_waveform_and_its_rate(frictionless: QuarterCar) -> None:
    """Road and link at the nodes are the Fourier series and their time derivatives, worked out here by hand."""
    found = _imposed(_response(), LINK)
    mesh = uniform_mesh(Layout((32, 64)))
    inputs = inputs_at(frictionless, found, mesh)
    fast = mesh.layout.dwell == 1
    phase, omega = np.asarray(mesh.phase)[fast], 2.0 * np.pi * 2.0
    height = 0.01375 * np.cos(phase) + 2e-4 * np.cos(3.0 * phase + 1.1)
    velocity = -omega * (0.01375 * np.sin(phase) + 6e-4 * np.sin(3.0 * phase + 1.1))
    assert np.asarray(inputs.road.height)[fast] == pytest.approx(height, abs=1e-16)
    assert np.asarray(inputs.road.velocity)[fast] == pytest.approx(velocity, abs=1e-14)
    angle = 1.57 - 1e-3 * np.sin(2.0 * phase)
    assert np.asarray(inputs.link.angle)[fast] == pytest.approx(angle, abs=1e-14)
    rate = -2e-3 * omega * np.cos(2.0 * phase)
    assert np.asarray(inputs.link.velocity)[fast] == pytest.approx(rate, abs=1e-14)
