"""What was inferred at a port, against the motion there: a friction is a loop, a spring a line."""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.attribution import Attribution
from savgs_ident.diagnose.result import ForceLoop
from savgs_ident.diagnose.rig.columns import marched_effect, node_loads
from savgs_ident.diagnose.rig.places import free_signal
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.model.effect import (
    AbstractEffect,
    AbstractForce,
    AbstractGrip,
    AbstractSeries,
    Port,
    PortSignals,
)
from savgs_ident.model.values import Values
from savgs_ident.simulate.periodic import PeriodicSolution

SHOWN = (0.1, 0.5, 0.9)
"""Tests that are shown, by their rank in frequency."""

SAMPLES = 256
"""Instants of a loop."""

TURNING = 1e-3
"""Velocity [m/s] over which a drawn friction changes sides."""

UNITS: Mapping[str, str] = {
    "link": "rad",
    "road": "m",
    "frame": "m",
    "sensor.sprung_accel": "m/s^2",
    "sensor.susp_deflection": "m",
}
"""Unit of what is inferred where it is no force."""

MOTION: Mapping[str, str] = {
    "link": "strut",
    "road": "tyre_radial",
    "frame": "rail",
    "sensor.sprung_accel": "rail",
    "sensor.susp_deflection": "suspension",
}
"""Whose motion stands for a port that has none of its own."""


def loops_of(
    plant: RigPlant,
    p: Values,
    solution: PeriodicSolution,
    found: Attribution,
    effect: AbstractEffect | None,
) -> tuple[ForceLoop, ...]:
    """Loops at a port for a slow, a middle and a fast test, with the law of a named ``effect`` over them.

    ``p`` and ``solution`` are the baseline's, with the parameters of the effect among ``p``.
    """
    if found.name == "inertia":
        return ()
    ports, _ = node_loads(plant.complete(()), p, solution)
    signals = ports[MOTION.get(found.name, found.name)]
    law = None if effect is None else _law(plant, effect, p, solution, ports)
    order = np.argsort(np.asarray(solution.excitation.frequency))
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)
    grid = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    loops = []
    for test in dict.fromkeys(int(order[int(share * (len(order) - 1))]) for share in SHOWN):
        mine = layout.dwell == test

        def at(values: NDArray[np.float64], mine: NDArray[np.bool_] = mine) -> NDArray[np.float64]:
            return np.interp(grid, phase[mine], np.asarray(values)[mine], period=2.0 * np.pi)

        loops.append(
            ForceLoop(
                port=found.name,
                frequency_hz=float(solution.excitation.frequency[test]),
                displacement=at(np.asarray(signals.displacement)),
                velocity=at(np.asarray(signals.velocity)),
                inferred=free_signal(found.coefficients[test], grid),
                law=np.zeros(0) if law is None else _without_mean(at(law)),
                unit=UNITS.get(found.name, "N"),
            )
        )
    return tuple(loops)


def _without_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(values - values.mean())


def _law(
    plant: RigPlant,
    effect: AbstractEffect,
    p: Values,
    solution: PeriodicSolution,
    ports: Mapping[str, PortSignals],
) -> NDArray[np.float64] | None:
    """What a named effect does at its port along the motion, (P,); None for one that has no signal there."""
    signals = ports.get(effect.port.value)
    if isinstance(effect, AbstractGrip) and signals is not None:
        grip = jax.vmap(lambda each: effect.grip(p, each))(signals)
        side = jnp.tanh(signals.velocity / TURNING)
        return -np.asarray(jnp.where(side > 0.0, grip.against_up, grip.against_down) * side)
    if isinstance(effect, AbstractForce) and not effect.states and signals is not None:
        return np.asarray(jax.vmap(lambda each: effect.force(p, each, jnp.zeros(0)))(signals))
    if isinstance(effect, AbstractForce):
        return marched_effect(plant.complete(()), p, solution, effect)
    if isinstance(effect, AbstractSeries) and effect.port is not Port.TYRE_LATERAL:
        way, rate = marched_effect(plant.complete(()), p, solution, effect).T
        return strut_force(p, way, rate, effect.in_damper) if effect.port is Port.STRUT else way
    return None


def strut_force(
    p: Values, way: NDArray[np.float64], rate: NDArray[np.float64], in_damper: bool
) -> NDArray[np.float64]:
    """By how much spring and damper push more, apart, where something in series with them gives way [m], [m/s].

    ``way`` and ``rate`` are (n,), and so is the force [N].
    """
    spring = 0.0 if in_damper else float(p["k_sd"])
    return -(spring * way + float(p["c_sd"]) * rate)
