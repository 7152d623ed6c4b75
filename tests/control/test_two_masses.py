"""The numbers of equation (8), and its simplifications undone: inertia and damper as they are."""

import jax.numpy as jnp
import numpy as np
import pytest

from savgs_ident.control.linear_study import SmallMotions
from savgs_ident.control.quarter_car_space import TwoMasses
from savgs_ident.control.two_masses import paper_masses, with_damper_at_rest, with_distributed_masses
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.model.dynamics import upright_mass
from savgs_ident.model.kinematics import linkage
from savgs_ident.model.quarter_car import QuarterCar
from savgs_ident.model.values import Values, as_values

from .by_hand import slope, travel


@pytest.fixture(scope="module")
def distributed(small: SmallMotions) -> TwoMasses:
    """With wishbones and upright as the bodies they are."""
    return small.masses["(8), masses distributed, too"]


def test_distributed_masses_weigh_in_heave_what_the_lumped_ones_do(
    distributed: TwoMasses, numbers: Values
) -> None:
    """Chassis and wheel at one velocity: nothing turns, everything moves."""
    total = float(numbers["m_s"]) + float(numbers["m_u"])
    assert distributed.mass.sum() == pytest.approx(total, rel=1e-12)


def test_distributed_masses_are_positive_and_symmetric(distributed: TwoMasses) -> None:
    assert distributed.mass == pytest.approx(distributed.mass.T, rel=1e-12)
    assert np.min(np.linalg.eigvalsh(distributed.mass)) > 0.0


def test_distributed_masses_hold_the_kinetic_energy_of_the_bodies(
    distributed: TwoMasses, numbers: Values
) -> None:
    """The chassis still and the wheel at 1 m/s: the bodies by differences of their places."""

    def place(name: str) -> np.ndarray:
        def along(part: int) -> float:
            def at(angle: float) -> float:
                return float(np.ravel(getattr(linkage(numbers, jnp.asarray(angle)), name))[part])

            return slope(at, 0.0, 1e-3)

        return np.array([along(part) for part in range(2 if name.startswith("cg") else 1)])

    per_angle = slope(lambda angle: travel(numbers, angle), 0.0, 1e-3)
    bodies = {"L": numbers["m_L"], "U": numbers["m_U"], "K": upright_mass(numbers)}
    twice = sum(
        float(mass) * np.sum(place(f"cg_{body}") ** 2)
        + float(numbers[f"J_{body}"]) * place(f"roll_{body}")[0] ** 2
        for body, mass in bodies.items()
    )
    assert distributed.mass[1, 1] == pytest.approx(twice / per_angle**2, rel=1e-8)


def test_the_damper_at_rest_has_the_slope_of_its_curve_there(
    frictionless: QuarterCar, numbers: Values, masses: TwoMasses
) -> None:
    at_rest = with_damper_at_rest(frictionless, numbers, masses)
    step = 1e-7
    share = float(frictionless.damper(jnp.asarray(step)) - frictionless.damper(jnp.asarray(-step))) / (
        2.0 * step
    )
    assert at_rest.c_eq == pytest.approx(share * masses.c_eq, rel=1e-4)
    assert at_rest._replace(c_eq=masses.c_eq) == masses


def test_friction_changes_none_of_the_numbers(
    friction: QuarterCar, frictionless: QuarterCar, numbers: Values
) -> None:
    with_it, without = paper_masses(friction, numbers), paper_masses(frictionless, numbers)
    assert with_it[1:] == without[1:]
    assert np.array_equal(with_it.mass, without.mass)


def test_an_effect_that_changes_a_mass_is_in_the_numbers(rig: Rig) -> None:
    model = build_model(rig, ("sprung_mass", "unsprung_mass"))
    p = as_values(model_parameters(rig, ("sprung_mass", "unsprung_mass")).as_dict())
    effective = model.effective(p)
    found = paper_masses(model, p)
    heavy = with_distributed_masses(model, p, found)
    assert np.diag(found.mass) == pytest.approx([float(effective["m_s"]), float(effective["m_u"])])
    assert np.trace(found.mass) != pytest.approx(float(p["m_s"]) + float(p["m_u"]), rel=1e-6)
    assert heavy.mass.sum() == pytest.approx(found.mass.sum(), rel=1e-12)
