"""The logic of both solvers on the smallest plant with dry friction, where a solution takes milliseconds.

The same is tested on the quarter-car rig among the slow tests.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.status import Status
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.effect import generic_effects
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.profiles import ProfileSource, Sine
from savgs_ident.plants.two_mass import PARAMETERS, TwoMass
from savgs_ident.simulate import transient
from savgs_ident.simulate.periodic import (
    PeriodicSettings,
    PeriodicSolution,
    resolve,
    simulate_periodic,
    solve_on_mesh,
)
from savgs_ident.simulate.readings import harmonics
from savgs_ident.simulate.transient import TransientSolution, simulate_transient, solve_rates

from .programme import altered, distance, finer, loads_along

GENERIC = generic_effects(TwoMass.ports)
FRICTION = GENERIC["guide_coulomb"]
PLANT = TwoMass() + FRICTION
P = as_values((PARAMETERS + ParameterTable(FRICTION.parameters)).as_dict())
LIFT = 0.01
DWELLS = np.array([0.5, 1.4, 2.35, 6.0])
"""A dwell that sticks for long, one that is hard to resolve, one at the resonance, a fast one [Hz]."""
SWAY = ProfileSource((Sine(LIFT, 2.35, 0.0, 0.0, 0.5),))
TIMES = np.linspace(0.0, 1.0, 2049)


def _road(frequency: NDArray[np.float64], lift: float = LIFT) -> Excitation:
    heights = np.tile(np.array([0.0, lift], complex), (len(frequency), 1))
    return Excitation(jnp.asarray(frequency), {"road_height": jnp.asarray(heights)})


def _orders(p: Values, solution: PeriodicSolution) -> NDArray[np.complex128]:
    return np.asarray(harmonics(PLANT, p, solution, 9))


@pytest.fixture(scope="module")
def few() -> PeriodicSolution:
    """The dwells, from a cold start with default settings."""
    found = simulate_periodic(PLANT, P, _road(DWELLS))
    assert all(status.ok for status in found.status())
    return found


def test_a_dwell_cut_off_at_the_iteration_limit_says_so(few: PeriodicSolution) -> None:
    settings = PeriodicSettings(iterations=1, adaptations=0)
    cut = simulate_periodic(PLANT, P, _road(DWELLS), settings)
    assert Status.MAX_ITERATIONS in cut.status()
    for status, off in zip(cut.status(), distance(_orders(P, cut), _orders(P, few)), strict=True):
        assert status.ok or np.max(off) > 1e-6


@pytest.mark.parametrize("absurd", [{"m_s": -320.0}, {"k": np.nan}], ids=["negative mass", "no number"])
def test_an_absurd_plant_has_no_motion_and_says_so(few: PeriodicSolution, absurd: dict[str, float]) -> None:
    p = altered(P, absurd)
    for found in (simulate_periodic(PLANT, p, _road(DWELLS)), resolve(PLANT, p, few)):
        assert not all(status.ok for status in found.status())


def test_a_plant_that_sticks_is_a_solution_too() -> None:
    """The sprung mass never slides, it only moves as the contact stretches."""
    (name,) = FRICTION.null
    stuck = altered(P, {name: 100.0 * float(P[name])})
    found = simulate_periodic(PLANT, stuck, _road(DWELLS))
    assert all(status.ok for status in found.status())
    swing = np.abs(_orders(stuck, found)[:, 0, 1]) / (2.0 * np.pi * DWELLS) ** 2
    pushed = np.max(np.abs([float(P["k"]), float(P["c"]) * 2.0 * np.pi * DWELLS.max()])) * LIFT
    assert np.all(swing < 3.0 * pushed / float(P["k_pre"]))


def test_a_warm_start_finds_what_a_cold_one_finds(few: PeriodicSolution) -> None:
    p = altered(P, {"k": 5.5e4, "c": 1.9e3, "k_t": 2.6e5})
    warm = resolve(PLANT, p, few)
    rest = type(few.trajectory)(*(0.0 * part for part in few.trajectory))
    cold = solve_on_mesh(PLANT, p, few.excitation, few.mesh, rest, PeriodicSettings.iterations)
    assert all(status.ok for status in (*warm.status(), *cold.status()))
    assert np.max(distance(_orders(p, warm), _orders(p, cold))) < 1e-10
    anew = simulate_periodic(PLANT, p, _road(DWELLS))
    assert np.max(distance(_orders(p, warm), _orders(p, anew))) < 2e-3


@pytest.mark.slow
def test_the_order_of_the_dwells_does_not_matter(few: PeriodicSolution) -> None:
    turned = simulate_periodic(PLANT, P, _road(DWELLS[::-1]))
    assert np.max(distance(_orders(P, turned)[::-1], _orders(P, few))) < 1e-10


@pytest.mark.slow
def test_default_nodes_are_good_to_two_thousandths_of_the_first_harmonic(few: PeriodicSolution) -> None:
    fine = finer(PLANT, P, few, 8)
    assert np.max(distance(_orders(P, few), _orders(P, fine))) < 2e-3


def _moved(tolerance: float = 1e-9) -> TransientSolution:
    return simulate_transient(PLANT, P, SWAY, TIMES, tolerance=tolerance)


@pytest.mark.slow
def test_it_stays_at_rest_on_a_flat_road() -> None:
    still = simulate_transient(PLANT, P, ProfileSource((Sine(0.0, 1.0, 0.0, 0.0, 0.5),)), TIMES)
    assert still.status().ok
    assert np.max(np.abs(still.readings.body_accel)) < 3e-5
    assert np.max(np.abs(still.readings.susp_deflection)) < 1e-9


@pytest.mark.slow
def test_a_motion_can_be_cut_and_continued() -> None:
    whole = _moved()
    half = simulate_transient(PLANT, P, SWAY, TIMES / 2.0, tolerance=1e-9)
    rest = simulate_transient(PLANT, P, SWAY, 0.5 + TIMES / 2.0, half.state_at(-1), tolerance=1e-9)
    for one, other in zip(
        (*whole.motion.q, *whole.motion.qd), (*rest.motion.q, *rest.motion.qd), strict=True
    ):
        np.testing.assert_allclose(one[-1], other[-1], atol=1e-6)


@pytest.mark.slow
def test_the_error_follows_the_tolerance() -> None:
    exact = np.asarray(_moved(1e-11).motion.q.z_s)

    def error(tolerance: float) -> float:
        """Of several runs: where a step ends at a reversal, another rounding halves or doubles it."""
        close = tolerance * np.array([0.9, 1.0, 1.1])
        return float(np.median([np.max(np.abs(np.asarray(_moved(t).motion.q.z_s) - exact)) for t in close]))

    rough, fine = error(1e-5), error(1e-9)
    assert fine < 1e-8
    assert fine < rough / 300.0


@pytest.mark.slow
def test_what_road_brings_is_lost_or_stored() -> None:
    """Over a second with stick and slip."""
    times = np.linspace(0.0, 1.0, 20_001)
    found = simulate_transient(PLANT, P, SWAY, times, tolerance=1e-10)
    (q, qd, _), loads = found.motion, loads_along(PLANT, P, found)
    (road,) = found.inputs.signals
    z_s, z_u, v_s, v_u = (np.asarray(each) for each in (*q, *qd))
    height, speed = np.asarray(road.value), np.asarray(road.rate)
    stored_energy = (
        float(P["m_s"]) * v_s**2
        + float(P["m_u"]) * v_u**2
        + float(P["k"]) * (z_u - z_s) ** 2
        + float(P["k_t"]) * (height - z_u) ** 2
    ) / 2.0
    work = {
        "road": np.asarray(loads.tyre) * speed,
        "damper": -float(P["c"]) * (v_u - v_s) ** 2,
        "tyre": -float(P["c_t"]) * (speed - v_u) ** 2,
        "guide": np.asarray(loads.guide) * v_s,
    }
    done = {name: np.trapezoid(power, times) for name, power in work.items()}
    size = np.trapezoid(np.abs(work["road"]), times)
    assert abs(sum(done.values()) - (stored_energy[-1] - stored_energy[0])) < 1e-5 * size
    assert all(done[name] < -1e-4 * size for name in ("damper", "tyre", "guide"))


@pytest.mark.slow
def test_the_solved_rates_leave_no_residual() -> None:
    found = _moved()
    at = jax.jit(jax.vmap(lambda m, s, sd, u: PLANT.residual(P, m, s, sd, u)))
    assert np.max(np.abs(at(found.motion, found.s, found.sd, found.inputs))) < 1e-6


@pytest.mark.slow
def test_what_gives_way_in_series_has_rates_and_slopes_of_its_own() -> None:
    mount = GENERIC["mount_compliance"]
    plant = TwoMass() + mount
    p = as_values((PARAMETERS + ParameterTable(mount.parameters)).as_dict())
    found = simulate_transient(plant, p, SWAY, TIMES)
    assert found.status().ok
    motion, at = found.motion, 700

    def rates(values: Values) -> jax.Array:
        q, qd = (jax.tree.map(lambda part: part[at], each) for each in motion[:2])
        u = jax.tree.map(lambda part: part[at], found.inputs)
        solved = solve_rates(plant, values, q, qd, found.s[at], u)
        return jnp.stack([*solved.qdd, *solved.sd])

    rates = jax.jit(rates)
    slope = jax.jvp(rates, (p,), ({name: jnp.asarray(value) for name, value in p.items()},))[1]
    step = 1e-5
    ends = [rates({name: value * (1.0 + side * step) for name, value in p.items()}) for side in (1.0, -1.0)]
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2.0 * step), rtol=1e-6, atol=1e-8)
    assert np.max(np.abs(found.sd)) > 0.0


@pytest.mark.slow
def test_a_motion_that_is_none_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    ill = dict(P) | {"k_t": jnp.asarray(jnp.nan)}
    begin = _moved().state_at(0)
    assert simulate_transient(PLANT, ill, SWAY, TIMES, begin).status() is Status.NOT_FINITE
    monkeypatch.setattr(transient, "MOST_STEPS", 20)
    assert simulate_transient(PLANT, P, SWAY, TIMES[::128]).status() is Status.MAX_ITERATIONS


@pytest.mark.parametrize("damping_ratio", [0.005, 0.05, 0.2])
def test_what_swings_in_resonance_is_found_as_soon_as_what_does_not(damping_ratio: float) -> None:
    """The plant is linear and moves by little: few steps reach the motion, however far what swings has to go."""
    swinging = GENERIC["guide_oscillator"]
    table = PARAMETERS + ParameterTable(swinging.parameters)
    light = {"guide_oscillator_mass": 1e-3, "guide_oscillator_damping_ratio": damping_ratio}
    found = simulate_periodic(
        TwoMass() + swinging,
        as_values(table.with_values(light).as_dict()),
        _road(np.array([table["guide_oscillator_frequency"].value])),
        PeriodicSettings(adaptations=0),
    )
    assert found.status() == (Status.CONVERGED,)
    assert int(found.iterations) <= 5
    body, swing = np.abs(found.trajectory.x[np.array([0, 4])]).max(axis=1)
    assert swing / body == pytest.approx(np.hypot(1.0, 2.0 * damping_ratio) / (2.0 * damping_ratio), rel=0.01)
