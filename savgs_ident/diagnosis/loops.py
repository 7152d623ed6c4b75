"""The signal inferred at a port against the motion there, with the force of a named effect along the same motion.

A friction is a loop over the displacement, a stiffness a line, a damper a line over the velocity. The force of the
named effect is that of the model itself: the force at the port with the effect, less that without it, evaluated
along the motion of the baseline. Nothing of the rig's laws is written here.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.threads import in_parallel
from savgs_ident.core.values import Values, as_values
from savgs_ident.diagnosis.effect_sensitivities import marched_contact, marched_effect
from savgs_ident.diagnosis.localisation import Localisation
from savgs_ident.diagnosis.problem import DrawnLaw
from savgs_ident.diagnosis.result import ForceLoop
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractFrictionLimitLaw,
    AbstractNumberLaw,
    AbstractSeriesLaw,
    Port,
    PortKind,
)
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.background.imposed import node_loads
from savgs_ident.inference.background.locations import force_port, free_signal, signal_port
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.sensitivity import ports_at_nodes

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem

QUANTILES = (0.1, 0.5, 0.9)
"""The dwells that have a loop, by their rank in frequency: a slow, a middle and a fast one."""

SAMPLES = 256
"""Samples of a loop."""

SHOWN_S = 4.0
"""So much of a window is drawn where there are no dwells [s]."""


def force_loops(
    problem: "DwellProblem",
    p: Values,
    solution: PeriodicSolution,
    found: Localisation,
    law: DrawnLaw | None,
    nearest: DrawnLaw | None,
) -> tuple[ForceLoop, ...]:
    """Loops at a port for a slow, a middle and a fast dwell; without dwells the law along a part of a window.

    Beside them, the ``law`` that is named with its error, and the ``nearest`` formula. ``solution`` is the motion of
    the baseline; ``p`` are its parameters, SI.
    """
    port = signal_port(problem.plant, found.name)
    if port is None or not (problem.dwells.size or law or nearest):
        return ()
    ports, _ = node_loads(problem.complete(()), p, solution)
    moving = motion_port(problem.plant, port)
    signals = ports[moving]
    motion_unit = next(each.displacement_unit for each in problem.plant.ports if each.name == moving)
    frequency = np.asarray(solution.excitation.frequency)
    tests, turns, samples = _drawn_tests(problem, frequency)
    force, error, near = _drawn(problem, solution, law, nearest, tests)
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)
    grid = 2.0 * np.pi * turns * np.arange(samples) / samples
    loops = []
    for test in tests:
        nodes = layout.dwell == test

        def sample(
            values: Float[Array | np.ndarray, " P"], nodes: NDArray[np.bool_] = nodes
        ) -> NDArray[np.float64]:
            return np.interp(grid, phase[nodes], np.asarray(values)[nodes], period=2.0 * np.pi)

        loops.append(
            ForceLoop(
                port=found.name,
                frequency_hz=float(frequency[test]) / turns,
                displacement=sample(signals.displacement),
                velocity=sample(signals.velocity),
                inferred=free_signal(found.free_input[test], grid) if problem.dwells.size else np.zeros(0),
                law=np.zeros(0) if force is None else _without_mean(sample(force)),
                unit=_unit(problem.plant, port),
                motion_unit=motion_unit,
                law_sd=root_sum_square([_without_mean(sample(each)) for each in error]),
                nearest=np.zeros(0) if near is None else _without_mean(sample(near)),
            )
        )
    return tuple(loops)


def _drawn_tests(
    problem: "DwellProblem", frequency: NDArray[np.float64]
) -> tuple[tuple[int, ...], float, int]:
    """The tests that are drawn, how much of the period of each [1], and in how many samples."""
    if problem.dwells.size:
        order = problem.dwells[np.argsort(frequency[problem.dwells])]
        return (
            tuple(dict.fromkeys(int(order[int(share * (len(order) - 1))]) for share in QUANTILES)),
            1.0,
            SAMPLES,
        )
    window = len(frequency) // 2
    return (window,), min(1.0, SHOWN_S * float(frequency[window])), 8 * SAMPLES


def _drawn(
    problem: "DwellProblem",
    solution: PeriodicSolution,
    law: DrawnLaw | None,
    nearest: DrawnLaw | None,
    tests: Sequence[int],
) -> tuple[NDArray[np.float64] | None, list[NDArray[np.float64]], NDArray[np.float64] | None]:
    """The force of a law along a motion (P,), what its errors change in it, and that of the nearest formula.

    All in these ``tests``.
    """

    def forces_of(each: DrawnLaw) -> NDArray[np.float64] | None:
        several = [problem.values(values) for values in (each.values, *each.erring)]
        return effect_forces(problem.complete(()), several, solution, each.effect, tests)

    forces = None if law is None else forces_of(law)
    near = None if nearest is None else forces_of(nearest)
    first = None if near is None else near[0]
    return (None, [], first) if forces is None else (forces[0], [*(forces[1:] - forces[0])], first)


def root_sum_square(errors: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Size of independent errors together, (n,); empty without any."""
    return np.sqrt(np.sum(np.square(errors), axis=0)) if errors else np.zeros(0)


def _unit(plant: AbstractPlant, port: Port) -> str:
    """Unit of the signal that is inferred at a port."""
    if port.kind is PortKind.SENSOR:
        return next(each.unit for each in plant.channels if port.location == f"sensor.{each.name}")
    return port.force_unit if port.kind is PortKind.FORCE else port.displacement_unit


def motion_port(plant: AbstractPlant, port: Port) -> str:
    """Name of the force port whose motion is drawn for a port: its own where it has one."""
    if port.kind is PortKind.FORCE or port.motion:
        return port.motion or port.name
    forces = [each for each in plant.ports if each.kind is PortKind.FORCE]
    beside = [each for each in forces if each.location == port.location]
    return (beside or forces)[0].name


def effect_forces(
    model: AbstractPlant,
    several: Sequence[Values],
    solution: PeriodicSolution,
    effect: Effect,
    tests: Sequence[int] | None = None,
) -> NDArray[np.float64] | None:
    """What an effect adds to the signal at its port along a motion without it, at several parameters, (v, P).

    These are ``several`` sets that differ in the effect's own. A force [N] with the sign of the port; at a port that
    is not one of force, by how much it gives way [m or rad]; None for an error of a sensor or of the road, which has
    neither. ``model`` has the effect if that has no states. An effect with states is followed in the ``tests`` alone,
    if given.
    """
    p = several[0]
    null = as_values({name: float(value) for name, value in p.items()} | dict(effect.null))
    law, port = effect.law, force_port(model, effect.port.location)

    def held() -> NDArray[np.float64]:
        """What the contact of the effect holds with it beyond that at its null [N]."""
        own, without = (marched_contact(model, each, solution, effect, tests) for each in (several, [null]))
        return own - without

    def there(imposed: Array) -> Array:
        return _forces(model, p, solution, {effect.port.name: imposed})[port.name] if port else imposed[:, 0]

    if isinstance(law, AbstractFrictionLimitLaw):
        return held()
    if isinstance(law, AbstractForceLaw) and effect.states:
        force = marched_effect(model, several, solution, effect, tests)
        return force + held() if effect.loads_contact else force
    if isinstance(law, AbstractSeriesLaw):
        ways = jnp.asarray(marched_effect(model, several, solution, effect, tests))
        found = np.stack(in_parallel(there, ways))
        return found - np.asarray(_forces(model, p, solution)[port.name]) if port else found
    if isinstance(law, AbstractForceLaw | AbstractNumberLaw) and port is not None:
        every = in_parallel(lambda each: _forces(model, each, solution)[port.name], [null, *several])
        without, *own = map(np.asarray, every)
        return np.stack(own) - without
    return None


@eqx.filter_jit
def _forces(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, imposed: dict[str, Array] | None = None
) -> dict[str, Float[Array, " P"]]:
    """The whole force at each port along a motion [N]."""
    return ports_at_nodes(model, p, solution, imposed).forces


def _without_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inferred signal has no mean either."""
    return np.asarray(values - values.mean())
