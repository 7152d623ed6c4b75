"""The linear models against the nonlinear rig, and approximations over the link angle.

Of the exact linearisation the fast tests of the exports see that a mount softens it as in series.
"""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from savgs_ident.control.linear_equivalent import nominal_equivalent, quarter_car_space
from savgs_ident.control.linear_study import FREQUENCY, SMALL, SmallMotions, approximate
from savgs_ident.control.linearisation import linearise, resting
from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.inputs import cam_excitation
from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.simulate.periodic import simulate_periodic, solve_on_mesh
from savgs_ident.simulate.readings import harmonics

from .by_hand import slope, travel


@pytest.mark.slow
def test_the_exact_linearisation_is_the_nonlinear_rig(small: SmallMotions) -> None:
    """From 0.5 to 10 Hz, both channels, amplitude and phase."""
    assert (small.frequency.min(), small.frequency.max()) == pytest.approx((0.5, 10.0))
    assert small.error("exact linearisation") < 0.002


@pytest.mark.slow
def test_every_simplification_that_is_undone_brings_the_model_nearer(small: SmallMotions) -> None:
    errors = [small.error(name) for name in small.models]
    assert next(iter(small.models)) == "equation (8)"
    assert list(small.models)[-1] == "exact linearisation"
    assert np.all(np.diff(errors) < 0.0)


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_the_linear_models_have_the_numbers_that_they_are_named_for(small: SmallMotions) -> None:
    iw = 2j * np.pi * small.frequency
    for name, numbers in small.masses.items():
        response = quarter_car_space(numbers)(iw)[:2, 0] * iw
        assert small.models[name] == pytest.approx(response.T, rel=1e-12)


ANGLES = np.linspace(0.0, np.pi, 61)
coefficients = st.floats(0.01, 100.0) | st.floats(-100.0, -0.01)


@given(powers=st.tuples(coefficients, coefficients, coefficients))
def test_a_parabola_is_met_exactly(powers: tuple[float, float, float]) -> None:
    values = Polynomial(powers)(ANGLES)
    found = approximate(ANGLES, values, 2)
    size = np.max(np.abs(powers))
    assert np.array(found.coefficients) == pytest.approx(np.array(powers), abs=1e-11 * size)
    assert found(ANGLES) == pytest.approx(values, abs=1e-11 * size)
    assert found.largest * np.max(np.abs(values)) < 1e-12 * size
    assert found.rms <= found.largest


@given(heights=st.lists(st.floats(-1.0, 1.0), min_size=61, max_size=61).filter(lambda all_: any(all_)))
def test_a_constant_leaves_the_spread_about_the_mean(heights: list[float]) -> None:
    values = np.array(heights)
    found = approximate(ANGLES, values, 0)
    greatest = np.max(np.abs(values))
    assert found.coefficients[0] == pytest.approx(np.mean(values), abs=1e-14)
    assert found.rms * greatest == pytest.approx(np.std(values), abs=1e-14)
    assert found.largest * greatest == pytest.approx(np.max(np.abs(values - np.mean(values))), abs=1e-14)


@given(share=st.floats(0.001, 0.5))
def test_what_is_left_of_a_known_wave_is_its_share(share: float) -> None:
    """A wave that no parabola follows: a Legendre polynomial of degree three, at equal weights of its nodes."""
    nodes, _ = np.polynomial.legendre.leggauss(400)
    third = np.polynomial.legendre.legval(nodes, [0.0, 0.0, 0.0, 1.0])
    lower = np.polynomial.polynomial.polyvander(nodes, 2)
    third = third - lower @ np.linalg.lstsq(lower, third, rcond=None)[0]
    values = 1.0 + nodes**2 + share * third
    found = approximate(nodes, values, 2)
    greatest = np.max(np.abs(values))
    assert found.largest == pytest.approx(share * np.max(np.abs(third)) / greatest, rel=1e-9)
    assert found.rms == pytest.approx(share * np.sqrt(np.mean(third**2)) / greatest, rel=1e-9)
    assert np.array(found.coefficients) == pytest.approx([1.0, 0.0, 1.0], abs=1e-11)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_the_shares_do_not_depend_on_the_unit(scale: float) -> None:
    values = np.cosh(ANGLES)
    one, other = approximate(ANGLES, values, 2), approximate(ANGLES, scale * values, 2)
    assert (other.rms, other.largest) == pytest.approx((one.rms, one.largest), rel=1e-9)
