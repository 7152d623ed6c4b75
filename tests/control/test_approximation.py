"""Polynomials that stand for a quantity: exact for what they can be, and best in least squares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

from savgs_ident.control.approximation import approximate

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
