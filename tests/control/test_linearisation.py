"""The exact linearisation: against differences of the nonlinear rig's own rates, at rest and in motion."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.control.linearisation import RIG_OUTPUTS, linearise, resting
from savgs_ident.core.errors import InputError
from savgs_ident.core.values import Values
from savgs_ident.effects.base import InputSignal
from savgs_ident.plants.base import Motion
from savgs_ident.plants.quarter_car.dynamics import Coordinates
from savgs_ident.plants.quarter_car.forces import Inputs, Link, Road
from savgs_ident.plants.quarter_car.kinematics import strut_length, suspension_travel
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.linearisation import OperatingPoint
from savgs_ident.simulate.transient import solve_rates

STEPS = (1e-7, 3e-7, 1e-5, 3e-5, 1e-6, 1e-5, 1e-4, 1e-3)
"""Of coordinates, their rates, road height, link angle and the velocities of these two; the anchor's is 1e-8 m."""


class Place(NamedTuple):
    """A state of the rig: a name, link angle [rad], and coordinates' and inputs' rates [m/s, rad/s]."""

    name: str
    link: float
    velocity: tuple[float, float]
    driven: tuple[float, float]


PLACES = (
    Place("at rest, nominal", np.pi / 2.0, (0.0, 0.0), (0.0, 0.0)),
    Place("at rest, link low", np.radians(35.0), (0.0, 0.0), (0.0, 0.0)),
    Place("in motion", np.radians(110.0), (0.21, -0.6), (0.13, 2.1)),
)


def _point(model: QuarterCar, p: Values, place: Place) -> OperatingPoint:
    at = resting(model, p, place.link)
    zd_s, omega, road, link = (jnp.asarray(each) for each in (*place.velocity, *place.driven))
    s = at.s
    if model.states and place.velocity[0]:
        # The anchor of the bristle a micrometre away: it neither sticks at its centre nor slides fully.
        s = s.at[0].set(at.q.z_s - 1e-6)
    signals = tuple(
        InputSignal(each.value, rate) for each, rate in zip(at.signals, (road, link), strict=True)
    )
    return at._replace(qd=Coordinates(zd_s, omega), s=s, signals=signals)


@eqx.filter_jit
def _rates_and_outputs(model: QuarterCar, p: Values, v: Array) -> Array:
    """What a simulation computes, along states, road height, link angle and the velocities of these two."""
    q, qd, s = Coordinates(v[0], v[1]), Coordinates(v[2], v[3]), v[4:-4]
    inputs = Inputs(Road(v[-4], v[-2]), Link(v[-3], v[-1]))
    rates = solve_rates(model, p, q, qd, s, inputs)
    loads = model.loads(p, Motion(q, qd, rates.qdd), s, rates.sd, inputs)
    travel = suspension_travel(p, q.theta_LW)
    torque = loads.strut * jax.grad(strut_length, argnums=2)(p, q.theta_LW, inputs.link.angle)
    rated = [*qd, *rates.qdd, *jnp.unstack(rates.sd), v[-2], v[-1]]
    outputs = [rates.qdd.z_s, travel, v[-4] - q.z_s - travel, loads.vertical, torque, v[-3]]
    return jnp.stack([*rated, *outputs])


def _differences(model: QuarterCar, p: Values, at: OperatingPoint) -> NDArray[np.float64]:
    """Slopes of all these by differences at two steps.

    The damper's curvature jumps where it stands still, which central differences feel to first order in the step:
    that is extrapolated away.
    """
    values, rates = zip(*at.signals, strict=True)
    centre = np.array([*at.q, *at.qd, *np.asarray(at.s), *values, *rates], dtype=float)
    columns = []
    for place, step in enumerate((*STEPS[:4], *[1e-8] * len(model.states), *STEPS[4:])):
        direction = step * np.eye(centre.size)[place]
        far, near, after, beyond = (
            np.asarray(_rates_and_outputs(model, p, centre + k * direction)) for k in (-2, -1, 1, 2)
        )
        columns.append((4.0 * (after - near) - (beyond - far)) / (4.0 * step))
    return np.column_stack(columns)


def _largest_error(model: QuarterCar, p: Values, place: Place) -> NDArray[np.float64]:
    """Of every row of [A B; C D], relative to the largest of the row's slopes (columns in their own sizes)."""
    at = _point(model, p, place)
    found = linearise(model, p, at)
    wanted = _differences(model, p, at)
    got = np.block([[found.A, found.B], [found.C, found.D]])
    typical = np.array([1e-2, 3e-2, 0.1, 0.3, *[1e-5] * len(model.states), 1e-2, 0.5, 0.1, 3.0])
    size = np.max(np.abs(wanted * typical), axis=1)
    return np.max(np.abs(got - wanted) * typical, axis=1) / np.where(size > 0.0, size, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("place", PLACES, ids=lambda place: place.name)
def test_without_friction_it_has_the_slopes_of_the_rates(
    frictionless: QuarterCar, numbers: Values, place: Place
) -> None:
    assert np.max(_largest_error(frictionless, numbers, place)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("place", [PLACES[0], PLACES[2]], ids=lambda place: place.name)
def test_with_friction_it_has_the_slopes_of_the_rates(
    friction: QuarterCar, numbers: Values, place: Place
) -> None:
    assert np.max(_largest_error(friction, numbers, place)) < 1e-5


@pytest.mark.slow
def test_its_signals_have_names(frictionless: QuarterCar, numbers: Values) -> None:
    space = linearise(frictionless, numbers, resting(frictionless, numbers, np.pi / 2.0))
    assert space.input_labels == ["road_velocity", "link_velocity"]
    assert space.output_labels == [each.name for each in RIG_OUTPUTS]
    assert space.state_labels[-2:] == ["road_height", "link_angle"]
    turned = space["link_angle", "link_velocity"](2j * np.pi)
    assert complex(turned) == pytest.approx(1.0 / (2j * np.pi))


@pytest.mark.slow
def test_a_state_that_the_linkage_cannot_take_is_refused(frictionless: QuarterCar, numbers: Values) -> None:
    at = resting(frictionless, numbers, np.pi / 2.0)
    beyond = at._replace(q=Coordinates(at.q.z_s, jnp.asarray(-1.6)))
    with pytest.raises(InputError, match="cannot be linearised"):
        linearise(frictionless, numbers, beyond)
