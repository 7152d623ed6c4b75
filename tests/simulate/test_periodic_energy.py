"""Energy over a cycle: what the road brings is what dampers and frictions take."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs
from savgs_ident.plants.quarter_car.kinematics import strut_length
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.excitation import inputs_at
from savgs_ident.simulate.periodic import PeriodicSolution

from .programme import finer

pytestmark = pytest.mark.slow


class Works(NamedTuple):
    """Work over one cycle into the rig [J], each (D,)."""

    road: NDArray[np.float64]
    damper: NDArray[np.float64]
    tyre_damper: NDArray[np.float64]
    tyre_friction: NDArray[np.float64]
    rail_friction: NDArray[np.float64]


def _powers(model: QuarterCar, p: Values, x: Array, y: Array, inputs: Inputs) -> Array:
    """Powers [W] at one node, in the order of :class:`Works`; springs and weight are not among them."""
    motion = Motion(Coordinates(*x[:2]), Coordinates(*x[2:4]), Coordinates(*y[:2]))
    loads = model.loads(p, motion, x[4:], jnp.zeros_like(x[4:]), inputs)
    spring = p["k_sd"] * (p["l_free"] - strut_length(p, x[1], inputs.link.angle))
    elastic = p["k_t"] * jnp.maximum(loads.touch.compression, 0.0)
    return jnp.stack(
        [
            loads.vertical * inputs.road.velocity,
            (loads.strut - spring) * loads.strut_rate,
            -(loads.vertical * loads.touch.cos_tilt - elastic) * loads.touch.compression_rate,
            loads.lateral * loads.touch.lateral_velocity,
            loads.rail * x[2],
        ]
    )


def _works(model: QuarterCar, p: Values, solution: PeriodicSolution) -> Works:
    mesh = solution.mesh
    inputs = inputs_at(model, solution.excitation, mesh)
    along = jax.jit(jax.vmap(lambda *at: _powers(model, p, *at), in_axes=(1, 1, 0), out_axes=1))
    powers = np.asarray(along(solution.trajectory.x, solution.trajectory.y, inputs))
    period = 1.0 / np.asarray(solution.excitation.frequency)
    means = np.add.reduceat(powers * np.asarray(mesh.weight), mesh.layout.starts, axis=1)
    return Works(*(means * period))


def _open(works: Works) -> NDArray[np.float64]:
    """By how much the balance does not close, relative to what the road brings, (D,)."""
    return np.abs(np.sum(np.stack(works), axis=0)) / works.road


@pytest.fixture(scope="module")
def fine(friction: QuarterCar, numbers: Values, few: PeriodicSolution) -> Works:
    """Works on eight times the default number of nodes."""
    solution = finer(friction, numbers, few, 8)
    assert all(status.ok for status in solution.status())
    return _works(friction, numbers, solution)


def test_it_closes_to_one_in_a_million_on_fine_nodes(fine: Works) -> None:
    assert np.max(_open(fine)) < 1e-6


def test_on_default_nodes_it_is_open_by_what_second_order_says(
    friction: QuarterCar, numbers: Values, few: PeriodicSolution, fine: Works
) -> None:
    coarse = _open(_works(friction, numbers, few))
    assert np.max(coarse) < 1e-4
    assert coarse / _open(fine) == pytest.approx(np.full(coarse.size, 64.0), rel=0.03)


def test_every_loss_takes_energy_and_matters(fine: Works) -> None:
    """Without any one of them the balance would be open by far more than the limit."""
    assert np.min(fine.road) > 1.0
    for name, work in fine._asdict().items():
        if name != "road":
            assert np.all(work < -1e-4 * fine.road), name
