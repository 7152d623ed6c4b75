"""The cam behind the road of a dwell: where it stands at every node."""

import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from savgs_ident.plants.base import Excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.mesh import layout_for, uniform_mesh


def _driven(frequency: ArrayLike, road: ArrayLike, link: ArrayLike) -> Excitation:
    harmonics = {"road_height": jnp.asarray(road), "link_angle": jnp.asarray(link)}
    return Excitation(jnp.asarray(frequency), harmonics)


def test_the_cam_is_at_nought_where_its_first_order_is_highest(frictionless: QuarterCar) -> None:
    """Whatever phase the dwell was recorded with; and it turns at the dwell's frequency."""
    rng = np.random.default_rng(2)
    frequency = np.array([0.8, 2.35, 5.0])
    road = rng.standard_normal((3, 4)) + 1j * rng.standard_normal((3, 4))
    link = np.full((3, 1), np.pi / 2.0, dtype=np.complex128)
    first = np.where(np.arange(4) == 1, road, 0.0)
    mesh = uniform_mesh(layout_for(frequency, 64, 1.0))
    dwell = mesh.layout.dwell
    excitation, of_first = (_driven(frequency, each, link) for each in (road, first))
    cam = inputs_at(frictionless, excitation, mesh).cam
    assert cam is not None
    lift, speed = np.abs(road[dwell, 1]), 2.0 * np.pi * frequency[dwell]
    height, velocity = inputs_at(frictionless, of_first, mesh).road
    np.testing.assert_allclose(lift * np.cos(cam.angle), height, atol=1e-13)
    np.testing.assert_allclose(-lift * np.sin(cam.angle) * speed, velocity, atol=1e-11)
    np.testing.assert_allclose(cam.speed, speed, rtol=1e-15)


def test_a_plate_that_stands_still_has_a_cam_too(frictionless: QuarterCar) -> None:
    """Of no lift: its angle is the phase of the dwell."""
    frequency = jnp.asarray([1.5])
    still, link = jnp.zeros((1, 1), jnp.complex128), jnp.ones((1, 1), jnp.complex128)
    mesh = uniform_mesh(layout_for(np.asarray(frequency), 64, 1.0))
    cam = inputs_at(frictionless, _driven(frequency, still, link), mesh).cam
    assert cam is not None
    np.testing.assert_allclose(cam.angle, mesh.phase, atol=1e-15)
