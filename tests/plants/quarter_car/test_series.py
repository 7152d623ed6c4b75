"""Springs in series at every port against their closed forms: they count from rest, where they change nothing."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.plants.quarter_car.catalogue import CATALOGUE, MODELS, build_model
from savgs_ident.plants.quarter_car.dynamics import SectionCurves, section_curves
from savgs_ident.plants.quarter_car.kinematics import strut_length
from savgs_ident.plants.quarter_car.plant import Equilibrium, Loads, QuarterCar, static_equilibrium
from savgs_ident.plants.quarter_car.ports import CARCASS, DAMPER, LINK, MOUNT, PLATE
from savgs_ident.plants.quarter_car.rig import Rig

from .instants import NOMINAL, as_values, draw_instants, inputs_of, motion_of
from .series import yielding

NONE = np.zeros(0)


def _seen(
    model: QuarterCar, p: Values, instant: NDArray[np.float64], s: Array, sd: Array
) -> tuple[Array, Loads]:
    """Residual and loads."""
    return _evaluated(model, p, section_curves(p), instant, s, sd)


# With the linkage compiled once for all models.
@eqx.filter_jit
def _evaluated(
    model: QuarterCar, p: Values, curves: SectionCurves, instant: NDArray[np.float64], s: Array, sd: Array
) -> tuple[Array, Loads]:
    at = (p, motion_of(instant), s, sd, inputs_of(instant), curves)
    return model.residual(*at), model.loads(*at)


@eqx.filter_jit
def _resting(model: QuarterCar, p: Values, curves: SectionCurves) -> Equilibrium:
    return static_equilibrium(model, p, jnp.asarray(0.6), jnp.zeros(()), curves)


def _at_rest(model: QuarterCar, p: Values) -> Equilibrium:
    return _resting(model, p, section_curves(p))


def _still(seed: int) -> NDArray[np.float64]:
    """An instant without velocities, the tyre on its plate."""
    instant = draw_instants(seed, 1)[0]
    instant[[2, 3, 7, 9]] = 0.0
    instant[6] = instant[0] + 0.37 * instant[1] + 0.01
    return instant


@pytest.mark.parametrize("seed", range(3))
def test_a_mount_makes_the_spring_of_the_strut_softer(
    simqc: QuarterCar, numbers: dict[str, float], seed: int
) -> None:
    """1/k' = 1/k + C, with the same push at rest."""
    compliance, instant = 2e-6, _still(seed)
    expected, loads = _seen(
        simqc, as_values(numbers | _softer_strut(numbers, compliance)), instant, NONE, NONE
    )
    way = compliance * (loads.strut - loads.carried["mount"].rest)[None]
    model = simqc + yielding(MOUNT, compliance)
    found, _ = _seen(model, as_values(numbers), instant, way, np.zeros(1))
    assert abs(float(found[2])) < 1e-11 * abs(float(way[0]))
    np.testing.assert_allclose(found[:2], expected, rtol=1e-11)


def _softer_strut(numbers: dict[str, float], compliance: float) -> dict[str, float]:
    """The spring that strut and mount are together."""
    p = as_values(numbers)
    length = float(strut_length(p, jnp.zeros(()), p["psi_nominal"]))
    k = numbers["k_sd"]
    return {
        "k_sd": k / (1.0 + compliance * k),
        "l_free": length + (numbers["l_free"] - length) * (1.0 + compliance * k),
    }


@pytest.mark.parametrize("seed", range(3))
def test_a_plate_makes_the_tyre_softer(simqc: QuarterCar, numbers: dict[str, float], seed: int) -> None:
    """1/k' = 1/k + C / cos^2 a, with the wheel's tilt a; where the tyre carries the weight nothing changes."""
    compliance, instant = 2e-6, _still(seed)
    cosine = float(_seen(simqc, as_values(numbers), instant, NONE, NONE)[1].touch.cos_tilt)
    weight = (numbers["m_s"] + numbers["m_u"]) * numbers["g"]
    softer = numbers | {
        "k_t": 1.0 / (1.0 / numbers["k_t"] + compliance / cosine**2),
        "r_free": numbers["r_free"] + compliance * weight / cosine,
    }
    vertical = float(_seen(simqc, as_values(softer), instant, NONE, NONE)[1].vertical)
    assert vertical > 100.0
    model = simqc + yielding(PLATE, compliance)
    way = np.array([compliance * (vertical - weight)])
    residual, loads = _seen(model, as_values(numbers), instant, way, np.zeros(1))
    assert float(loads.vertical) == pytest.approx(vertical, rel=1e-11)
    assert abs(float(residual[2])) < 1e-10 * abs(float(way[0]))


def test_a_gear_makes_the_strut_softer_by_the_square_of_its_arm(
    simqc: QuarterCar, numbers: dict[str, float]
) -> None:
    """In small, and away from rest, where its way x is not 0.

    With l(theta, psi + x), F = k (l_free - l), x = C (F r - rest), r = dl/dpsi:
    dF = -k (l_theta + r y F r_theta) / (1 + k r^2 y) dtheta, y = C / (1 - C F r_psi).
    """
    compliance, p = 5e-3, as_values(numbers)
    model = simqc + yielding(LINK, compliance)

    def push(theta: float) -> tuple[float, float]:
        """Force and way in balance at an angle of the wishbone, by the secant rule."""
        instant, still = NOMINAL.copy(), np.zeros(1)
        instant[1] = 0.1 + theta
        ways, missed = [0.0, -0.2], []
        for _ in range(9):
            residual, loads = _seen(model, p, instant, np.array(ways[-1:]), still)
            missed.append(float(residual[2]))
            if len(missed) == 1:
                continue
            slope = (missed[-1] - missed[-2]) / (ways[-1] - ways[-2]) if missed[-1] != missed[-2] else 1.0
            ways.append(ways[-1] - missed[-1] / slope)
        assert abs(missed[-1]) < 1e-14
        return float(loads.strut), ways[-1]

    step = 1e-4
    force, way = push(0.0)
    slope = (push(step)[0] - push(-step)[0]) / (2.0 * step)
    at = (p, jnp.asarray(0.1), jnp.asarray(np.pi / 2.0 + way))
    arm, turn = (float(jax.grad(strut_length, argnums=i)(*at)) for i in (2, 1))
    bend = float(jax.grad(jax.grad(strut_length, argnums=2), argnums=2)(*at))
    cross = float(jax.grad(jax.grad(strut_length, argnums=2), argnums=1)(*at))
    k = numbers["k_sd"]
    eased = compliance / (1.0 - compliance * force * bend)
    expected = -k * (turn + arm * eased * force * cross) / (1.0 + k * arm**2 * eased)
    assert abs(way) > 0.02
    assert slope == pytest.approx(expected, rel=1e-6)
    assert abs(slope / (-k * turn) - 1.0) > 0.03


def test_a_damper_behind_a_spring_passes_on_what_the_spring_holds(
    rig: Rig, numbers: dict[str, float]
) -> None:
    """Maxwell's element: the strut lengthens by spring and damper, F = x / C = -c (v + vx)."""
    velocity = (-2.0, -0.1, 0.0, 0.2, 2.0)
    c = numbers["c_sd"]
    straight = replace(rig, damper_velocity=velocity, damper_force=tuple(c * each for each in velocity))
    simqc, p = build_model(straight, ()), as_values(numbers)
    compliance, instant, held = 2e-6, draw_instants(5, 1)[0], 1.5e-3
    instant[3] = 0.8
    speed = float(_seen(simqc, p, instant, NONE, NONE)[1].strut_rate)
    assert abs(speed) > 0.1
    expected, loads = _seen(simqc, p | {"c_sd": np.zeros(())}, instant, NONE, NONE)
    model = simqc + yielding(DAMPER, compliance)
    rate = -speed - held / compliance / c
    found, with_damper = _seen(model, p, instant, np.array([held]), np.array([rate]))
    assert abs(float(found[2])) < 1e-12 * held
    assert float(with_damper.strut - loads.strut) == pytest.approx(held / compliance, rel=1e-9)
    assert np.max(np.abs(found[:2] - expected)) > 1.0


def test_a_carcass_holds_what_the_tread_passes_on(rig: Rig, numbers: dict[str, float]) -> None:
    """Below saturation F = x / C = mu F_tz / v_th (v - vx) on the plate."""
    simtr, instant, p = build_model(rig, MODELS["simtr"]), _still(2), as_values(numbers)
    instant[3] = 0.2
    anchor, compliance = instant[:1], 2e-6
    bare = _seen(simtr, p, instant, anchor, np.zeros(1))[1]
    speed, load = float(bare.touch.lateral_velocity), float(bare.vertical)
    viscous = numbers["mu_t"] * load / numbers["ydot_Hth"]
    assert 0.1 < abs(speed) / numbers["ydot_Hth"] < 0.9
    held = 0.5 * compliance * viscous * speed
    model = simtr + yielding(CARCASS, compliance)
    s, sd = np.append(anchor, held), np.array([0.0, 0.5 * speed])
    found, loads = _seen(model, p, instant, s, sd)
    assert abs(float(found[3])) < 1e-12 * abs(held)
    assert float(loads.lateral) == pytest.approx(-held / compliance, rel=1e-12)
    assert float(bare.lateral) == pytest.approx(-2.0 * held / compliance, rel=1e-12)


@pytest.mark.slow
def test_at_rest_on_another_link_angle_the_strut_is_softer_and_the_weight_bends_nothing(
    simtr: QuarterCar, numbers: dict[str, float]
) -> None:
    """Plate and frame carry what they carried when the rig was set up; so does a frame that has a velocity."""
    mount = 3e-7
    model = simtr + CATALOGUE["frame_mode"]
    for port, compliance in ((PLATE, 2e-7), (MOUNT, mount)):
        model = model + yielding(port, compliance, name=port.name)
    found = _at_rest(model, as_values(numbers))
    expected = _at_rest(simtr, as_values(numbers | _softer_strut(numbers, mount)))
    assert np.stack(found.q) == pytest.approx(np.stack(expected.q), abs=1e-11)
    assert abs(float(found.q.theta_LW)) > 1e-2
    assert np.asarray(found.s)[1:4] == pytest.approx(np.zeros(3), abs=1e-11)
    pushed = float(found.strut - _at_nominal_rest(numbers))
    assert float(found.s[4]) == pytest.approx(mount * pushed, rel=1e-7)


def _at_nominal_rest(numbers: dict[str, float]) -> float:
    """Push of the strut of the drawing [N]."""
    p = as_values(numbers)
    length = float(strut_length(p, jnp.zeros(()), p["psi_nominal"]))
    return numbers["k_sd"] * (numbers["l_free"] - length)
