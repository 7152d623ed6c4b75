"""Small motions: the linear models against the nonlinear rig, one simplification undone after another."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.control.linear_study import FREQUENCY, SMALL, SmallMotions
from savgs_ident.control.linearisation import linearise, resting
from savgs_ident.control.quarter_car_space import quarter_car_space
from savgs_ident.control.two_masses import nominal_equivalent
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values
from savgs_ident.simulate.excitation import cam_excitation
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import simulate_periodic, solve_on_mesh

from .by_hand import slope, travel


def test_the_exact_linearisation_is_the_nonlinear_rig(small: SmallMotions) -> None:
    """From 0.5 to 10 Hz, both channels, amplitude and phase."""
    assert (small.frequency.min(), small.frequency.max()) == pytest.approx((0.5, 10.0))
    assert small.error("exact linearisation") < 0.002


def test_every_simplification_that_is_undone_brings_the_model_nearer(small: SmallMotions) -> None:
    errors = [small.error(name) for name in small.models]
    assert next(iter(small.models)) == "equation (8)"
    assert list(small.models)[-1] == "exact linearisation"
    assert np.all(np.diff(errors) < 0.0)


def test_at_another_link_angle_the_exact_linearisation_is_the_nonlinear_rig(
    frictionless: QuarterCar, numbers: Values
) -> None:
    link = np.radians(60.0)
    nominal_motion = simulate_periodic(frictionless, numbers, cam_excitation(FREQUENCY, SMALL, np.pi / 2.0))
    # From there, carried to where the rig rests: the way is a thousand times the motion.
    rest, mesh = resting(frictionless, numbers, link), nominal_motion.mesh
    x = nominal_motion.trajectory.x + jnp.array([*rest.q, 0.0, 0.0])[:, None]
    start = nominal_motion.trajectory._replace(x=x)
    solution = solve_on_mesh(frictionless, numbers, cam_excitation(FREQUENCY, SMALL, link), mesh, start, 60)
    assert all(status.ok for status in solution.status())
    nonlinear = np.asarray(harmonics(frictionless, numbers, solution, 1))[:, :, 1] / (SMALL / 2.0)
    iw = 2j * np.pi * FREQUENCY
    nominal = linearise(frictionless, numbers, resting(frictionless, numbers, np.pi / 2.0))
    turned = linearise(frictionless, numbers, resting(frictionless, numbers, link))
    away, near = (np.moveaxis(each(iw)[:2, 0] * iw, 0, -1) / nonlinear - 1.0 for each in (nominal, turned))
    assert np.max(np.abs(near)) < 0.002
    assert np.max(np.abs(away)) > 0.01


def test_a_slow_link_lifts_the_exact_rig_as_its_rests_say(
    small: SmallMotions, frictionless: QuarterCar, numbers: Values
) -> None:
    """Per z_lin a little less than one: with the link the ratio under the static load turns, too."""
    nominal = float(numbers["psi_nominal"])

    def deflection(link: float) -> float:
        return travel(numbers, float(resting(frictionless, numbers, link).q.theta_LW))

    alpha = float(nominal_equivalent(frictionless, numbers).alpha)
    wanted = slope(deflection, nominal, 5e-3) / alpha
    assert small.slow_link == pytest.approx(wanted, rel=1e-6)
    assert 0.9 < small.slow_link < 1.0


def test_the_linear_models_have_the_numbers_that_they_are_named_for(small: SmallMotions) -> None:
    iw = 2j * np.pi * small.frequency
    for name, numbers in small.masses.items():
        response = quarter_car_space(numbers)(iw)[:2, 0] * iw
        assert small.models[name] == pytest.approx(response.T, rel=1e-12)
