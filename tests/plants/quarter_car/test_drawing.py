"""The drawing at rest and in small motion: equilibrium, equivalent stiffness and damping, frequencies."""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.kinematics import installation_ratio, strut_length, suspension_travel
from savgs_ident.plants.quarter_car.plant import Loads, QuarterCar

from .instants import NOMINAL, as_values, inputs_of, motion_of

K_EQ, C_EQ = 59987.0, 2087.4
"""Equivalent stiffness [N/m] and damping [N s/m] of the paper, at the nominal state."""


class Small(NamedTuple):
    """Residual (2,) at rest, its derivatives (2, 2) in coordinates and accelerations, and the loads."""

    residual: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    mass: NDArray[np.float64]
    loads: Loads


@pytest.fixture(scope="module")
def small(simqc: QuarterCar, numbers: dict[str, float]) -> Callable[[NDArray[np.float64]], Small]:
    """SimQC linearised about an instant."""

    def residual(moved: Array, p: Values, curves: SectionCurves, instant: Array) -> Array:
        at = instant.at[jnp.array([0, 1, 4, 5])].set(moved)
        return simqc.residual(p, motion_of(at), jnp.zeros(0), jnp.zeros(0), inputs_of(at), curves)

    @jax.jit
    def linearise(p: Values, instant: Array) -> tuple[Array, Array, Loads]:
        moved = instant[jnp.array([0, 1, 4, 5])]
        loads = simqc.loads(p, motion_of(instant), jnp.zeros(0), jnp.zeros(0), inputs_of(instant))
        # The curves are the closed form to 1e-11 and much less to differentiate once more.
        curves = section_curves(p)
        value, slope = jax.linearize(lambda x: residual(x, p, curves, instant), moved)
        columns = [slope(unit) for unit in jnp.unstack(jnp.eye(4))]
        return value, jnp.stack(columns, axis=1), loads

    def parts(instant: NDArray[np.float64]) -> Small:
        value, slope, loads = linearise(as_values(numbers), instant)
        slope = np.asarray(slope)
        return Small(np.asarray(value), slope[:, :2], slope[:, 2:], loads)

    return parts


def _at_rest(small: Callable[[NDArray[np.float64]], Small], link: float) -> NDArray[np.float64]:
    """Static equilibrium at a link angle [rad], by Newton's method."""
    instant = NOMINAL.copy()
    instant[8] = link
    for _ in range(8):
        here = small(instant)
        instant[:2] -= np.linalg.solve(here.stiffness, here.residual)
    assert np.max(np.abs(here.residual)) < 1e-9
    return instant


def test_the_drawing_is_in_equilibrium(
    small: Callable[[NDArray[np.float64]], Small], numbers: dict[str, float]
) -> None:
    weight = (numbers["m_s"] + numbers["m_u"]) * numbers["g"]
    assert np.max(np.abs(small(NOMINAL).residual)) < 1e-8 * weight
    assert _at_rest(small, np.pi / 2.0)[:2] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_the_load_at_rest_is_the_weight_and_the_strut_force_that_of_the_sheet(
    small: Callable[[NDArray[np.float64]], Small], rig_sheet: dict[str, Any]
) -> None:
    loads = small(NOMINAL).loads
    assert float(loads.vertical) == pytest.approx((320.0 + 49.0) * 9.81, rel=1e-8)
    assert float(loads.strut) == pytest.approx(rig_sheet["strut"]["force_nominal"], rel=1e-12)
    # Without friction nothing pushes sideways: the rail holds only the moment of the tyre's load.
    assert float(loads.reaction[0]) == pytest.approx(0.0, abs=1e-9)
    assert float(loads.touch.compression) == pytest.approx(rig_sheet["tyre"]["static_deflection"], rel=1e-12)


def test_link_and_strut_are_in_line_in_the_equilibrium_at_zero(
    small: Callable[[NDArray[np.float64]], Small], numbers: dict[str, float]
) -> None:
    """The strut's length is stationary there; turning the link compresses the strut."""
    p = as_values(numbers)
    slope = jax.jit(jax.grad(strut_length, argnums=2))
    angles = np.linspace(0.0, np.pi * 0.98, 11)
    found = [float(slope(p, _at_rest(small, angle)[1], angle)) / numbers["l_SL"] for angle in angles]
    assert abs(found[0]) < 1e-4
    assert max(found[1:]) < 0.0
    assert found[5] == pytest.approx(-1.0, abs=2e-3)


def test_the_equivalent_stiffness_and_damping_are_those_of_the_paper(
    numbers: dict[str, float], rig_sheet: dict[str, Any]
) -> None:
    """k_eq = k_sd R^2 + F_SD dR/dl_s and c_eq = c_sd R^2 at the nominal state."""

    @jax.jit
    def equivalents(p: Values, zero: Array, link: Array) -> tuple[Array, Array]:
        def force(angle: Array) -> Array:
            length = strut_length(p, angle, link)
            return p["k_sd"] * (p["l_free"] - length) * installation_ratio(p, angle, link)

        # The suspension's force at the wheel against its deflection: eq. (8) without taking it apart.
        k_eq = jax.grad(force)(zero) / jax.grad(suspension_travel, argnums=1)(p, zero)
        return k_eq, p["c_sd"] * installation_ratio(p, zero, link) ** 2

    k_eq, c_eq = equivalents(as_values(numbers), np.float64(0.0), np.float64(np.pi / 2.0))
    assert float(k_eq) == pytest.approx(rig_sheet["installation"]["k_eq"], rel=1e-7)
    assert float(k_eq) == pytest.approx(K_EQ, rel=0.01)
    assert float(c_eq) == pytest.approx(C_EQ, rel=0.01)


def test_alpha_is_negative_and_nearly_a_parabola_in_the_link_angle(
    small: Callable[[NDArray[np.float64]], Small], numbers: dict[str, float]
) -> None:
    """alpha = (dl_SD/dtheta_SL) / R: the suspension deflection that a turn of the link is worth (Fig. 7)."""
    p = as_values(numbers)

    @jax.jit
    def alpha(angle: Array, link: Array) -> Array:
        return jax.grad(strut_length, argnums=2)(p, angle, link) / installation_ratio(p, angle, link)

    links = np.linspace(0.0, np.pi, 37)
    found = np.array([float(alpha(_at_rest(small, link)[1], link)) for link in links])
    assert np.all(found[1:-2] < 0.0)
    peak = np.max(np.abs(found))
    assert peak == pytest.approx(numbers["l_SL"] / 0.6, rel=0.02)
    assert np.degrees(links[np.argmin(found)]) == pytest.approx(90.0, abs=10.0)
    parabola = np.polynomial.Polynomial.fit(links, found, 2)(links)
    assert 1.0 - np.var(found - parabola) / np.var(found) > 0.99


def test_the_frequencies_are_those_of_a_quarter_car(
    small: Callable[[NDArray[np.float64]], Small], numbers: dict[str, float]
) -> None:
    """The sprung mass on suspension and tyre in series near 2 Hz, the wheel hop where two masses put it."""
    at = small(NOMINAL)
    # Kinematic symmetry: work done around a small loop is zero, so stiffness and mass are symmetric.
    assert at.mass == pytest.approx(at.mass.T, rel=1e-12)
    assert at.stiffness == pytest.approx(at.stiffness.T, rel=1e-6)
    found = np.sqrt(np.sort(scipy.linalg.eigh(-at.stiffness, -at.mass, eigvals_only=True))) / (2.0 * np.pi)
    assert found[0] == pytest.approx(2.0, rel=0.03)
    masses = np.diag([numbers["m_s"], numbers["m_u"]])
    springs = np.array([[K_EQ, -K_EQ], [-K_EQ, K_EQ + numbers["k_t"]]])
    lumped = np.sqrt(np.sort(scipy.linalg.eigh(springs, masses, eigvals_only=True))) / (2.0 * np.pi)
    # Lumping the unsprung mass at the wheel centre is wrong, but not by much.
    assert found[0] == pytest.approx(lumped[0], rel=0.02)
    assert found[1] == pytest.approx(lumped[1], rel=0.1)
