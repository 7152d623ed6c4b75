"""What an effect would do to the response, to first order at its null, without a model that has it.

An effect without states is in the model already, at its null: its sensitivities are derivatives of the response. An
effect with states is marched along the port signals of the motion as it is until it repeats, at a typical size;
what it would do at its port is then imposed on the linearised rig.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.small_root import jacobian, solve_dense
from savgs_ident.core.threads import in_parallel
from savgs_ident.core.values import Values, as_values
from savgs_ident.effects.base import (
    AbstractForceLaw,
    AbstractLaw,
    AbstractSeriesLaw,
    Bristle,
    Load,
    Port,
    PortKind,
    PortSignals,
)
from savgs_ident.effects.composition import contact_bristle
from savgs_ident.effects.effect import Effect
from savgs_ident.inference.background.imposed import impose, node_loads
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.inference.observations import Term
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.along_motion import FORWARD, NEWTON_STEPS
from savgs_ident.simulate.mesh import Layout
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed

SAMPLES = 384
"""Instants of a dwell's period along which states are marched; of a window as many as it has nodes."""

PERIODS = 16
"""Most periods of a dwell until they repeat: what rang at the start has died away even in a slow frame."""

PERIODS_OF_A_WINDOW = 2
"""The same of a window, which is long, and compared after a lead; one that begins with a given state has none."""


REPEATED = 1e-9
"""Change of every state in a period, relative to what it is then [1], from which on periods repeat: friction forgets
its past in two."""


class AlikeTests(NamedTuple):
    """Tests along which states are marched alike: their places, instants in a period, and periods at most."""

    places: tuple[int, ...]
    instants: int
    periods: int

    @property
    def grid(self) -> NDArray[np.float64]:
        """Phases of the instants [rad], (instants,)."""
        return 2.0 * np.pi * np.arange(self.instants) / self.instants


def alike_tests(
    layout: Layout, windows: NDArray[np.intp], wanted: Sequence[int] | None = None
) -> list[AlikeTests]:
    """The dwells, and the windows at these places, which are of one length; of all tests or those ``wanted``."""
    tests = range(len(layout.counts)) if wanted is None else wanted
    dwells = tuple(test for test in tests if test not in windows)
    found = [AlikeTests(dwells, SAMPLES, PERIODS)] if dwells else []
    for opened, periods in ((False, PERIODS_OF_A_WINDOW), (True, 1)):
        alike = tuple(test for test in tests if test in windows and (test in layout.opened) is opened)
        if alike:
            found.append(AlikeTests(alike, layout.counts[alike[0]], periods))
    return found


class EvenSignals(NamedTuple):
    """What ports see in tests that are marched alike, at even instants.

    Attributes:
        tests: the tests.
        signals: at each force port, or the loads of what is in series, by name, (d, n) each.
        steps: from one instant to the next [s], (d,).
    """

    tests: AlikeTests
    signals: Mapping[str, PortSignals | Load]
    steps: NDArray[np.float64]


def sensitivities_with_states(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    effects: Sequence[Effect],
    typical: Sequence[Mapping[str, float]],
) -> NDArray[np.float64]:
    """Change of the rows by each effect at its ``typical`` parameters, (effects, m).

    Rows are in the units of their readings, ``typical`` in SI.
    """
    even = _evenly(model, p, solution, None)

    def field(one: tuple[Effect, Mapping[str, float]]) -> tuple[str, NDArray[np.float64]]:
        effect, given = one
        return effect.port.name, _marched(effect, [dict(p) | as_values(given)], even, solution)[0]

    fields = in_parallel(field, zip(effects, typical, strict=True))
    return impose(model, likelihood, orders, p, solution, fields)


def secants_of_terms(
    model: AbstractPlant,
    likelihood: Likelihood,
    orders: int,
    p: Values,
    solution: PeriodicSolution,
    effects: Sequence[Effect],
    terms: Sequence[Term],
    size: float,
) -> dict[str, NDArray[np.float64]]:
    """Change of the rows per unit of the amplitude of every term whose effect has states, by name, (tries, m, 1).

    They are secants to the typical sizes, ``size`` scales from the centres.
    """
    every, typical = [], []
    for term, effect in zip(terms, effects, strict=True):
        there = {each.name: each.centre + size * each.scale for each in term.amplitudes}
        every += [effect] * len(term.tried)
        typical += [there | shapes for shapes in term.tried]
    moved = iter(sensitivities_with_states(model, likelihood, orders, p, solution, every, typical))
    return {
        term.name: np.stack([next(moved)[:, None] for _ in term.tried]) / (size * term.amplitudes[0].scale)
        for term in terms
    }


def rehearse(p: Values, effects: Sequence[Effect], alike: Sequence[AlikeTests]) -> None:
    """Have compiled what marches effects with states, on a rig that stands still: nothing else must wait for it."""
    for tests in alike:
        still = jnp.zeros((len(tests.places), tests.instants))
        for effect in effects:
            gives = effect.port.kind is PortKind.SERIES
            seen = Load(still, still) if gives else PortSignals(still, still, still, still)
            _march_along(
                effect, [p], EvenSignals(tests, {effect.port.name: seen}, np.ones(len(tests.places)))
            )


def marched_effect(
    model: AbstractPlant,
    several: Sequence[Values],
    solution: PeriodicSolution,
    effect: Effect,
    tests: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """What an effect with states does at its port along a motion, at each of ``several`` parameters.

    A force (v, P) [N], or a way and its rate (v, P, 2). The parameters differ in those of the effect alone, which
    ``model`` does not have. Zero at the nodes of other tests than the ``tests``, if given.
    """
    return _marched(effect, several, _evenly(model, several[0], solution, tests), solution)


def marched_contact(
    model: AbstractPlant,
    several: Sequence[Values],
    solution: PeriodicSolution,
    effect: Effect,
    tests: Sequence[int] | None = None,
) -> NDArray[np.float64]:
    """Friction [N] of the contact at the port of an effect along a motion of ``model``, (v, P).

    Under the friction limits of the effect and of the model at each of ``several`` parameters, which differ in those
    of the effect alone. The bristle's anchor is marched: it is not that of the motion, which has limits of its own.
    Zero at the nodes of other tests than the ``tests``, if given.
    """
    others = tuple(each for each in model.effects if each.loads_contact and each.name != effect.name)
    known = placed(_stacked(several))

    def march(each: EvenSignals) -> Array:
        sliding = each.signals[effect.port.name]
        assert isinstance(sliding, PortSignals)
        steps = jnp.asarray(each.steps)
        return _march_contact((*others, effect), effect.port, known, sliding, steps, each.tests.periods)

    even = _evenly(model, several[0], solution, tests)
    return _at_nodes([(each.tests, march(each)) for each in even], solution)


def _stacked(several: Sequence[Values]) -> Values:
    """The same parameters of several sets, (v,) each."""
    return {name: jnp.stack([jnp.asarray(each[name]) for each in several]) for name in several[0]}


def _evenly(
    model: AbstractPlant, p: Values, solution: PeriodicSolution, wanted: Sequence[int] | None
) -> list[EvenSignals]:
    """Port signals, and loads as those of series elements, of all tests or those ``wanted``."""
    ports, carried = node_loads(model, p, solution)
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)

    def of(tests: AlikeTests) -> EvenSignals:
        nodes = [layout.nodes_of([place]) for place in tests.places]

        def even(values: Array) -> Array:
            flat = np.asarray(values)
            rows = [np.interp(tests.grid, phase[each], flat[each], period=2.0 * np.pi) for each in nodes]
            return jnp.asarray(np.stack(rows))

        signals: dict[str, PortSignals | Load] = {
            name: PortSignals(*(even(part) for part in each)) for name, each in ports.items()
        }
        for name, load in carried.items():
            signals[name] = Load(even(load.total), even(load.rest))
        frequency = np.asarray(solution.excitation.frequency)[list(tests.places)]
        return EvenSignals(tests, signals, 1.0 / (tests.instants * frequency))

    return [of(tests) for tests in alike_tests(layout, solution.excitation.windows, wanted)]


def _marched(
    effect: Effect, several: Sequence[Values], even: Sequence[EvenSignals], solution: PeriodicSolution
) -> NDArray[np.float64]:
    """What the effect does at its port, at the nodes: a force (v, P), or a way and its rate (v, P, 2)."""
    return _at_nodes([(each.tests, _march_along(effect, several, each)) for each in even], solution)


def _march_along(effect: Effect, several: Sequence[Values], even: EvenSignals) -> Float[Array, "v d n k"]:
    """The same along the last period of tests that are marched alike, (v, d, n, k)."""
    weight = np.array([1.0 if state.slips else FORWARD for state in effect.states])
    numbers, weights, steps = placed(
        (_stacked([effect.by_role(p) for p in several]), jnp.asarray(weight), jnp.asarray(even.steps))
    )
    marched = _march(effect.law, numbers, even.signals[effect.port.name], steps, weights, even.tests.periods)
    return marched * effect.port.sense if isinstance(effect.law, AbstractForceLaw) else marched


# A law and not an effect: one program serves all ports where it stands.
@eqx.filter_jit
def _march(
    law: AbstractLaw,
    several: Values,
    signals: PortSignals | Load,
    steps: Float[Array, " d"],
    weight: Float[Array, " s"],
    periods: int,
) -> Float[Array, "v d n k"]:
    """What a law does along the last period, a force, or a way and its rate, with each of several numbers (v,)."""
    # A step ends at an instant, and sees the port as it is on the way there.
    signals = jax.tree.map(
        lambda each: each + (1.0 - weight[0]) * (jnp.roll(each, 1, axis=1) - each), signals
    )

    def march(v: Values) -> Array:
        def defect(now: Array, before: Array, at: Any, step: Array) -> Array:
            rate, state = (now - before) / step, weight * now + (1.0 - weight) * before
            if isinstance(law, AbstractSeriesLaw):
                return law.balance(v, at, state, rate)
            assert isinstance(law, AbstractForceLaw), law.name
            return rate - law.rate(v, at, state)

        def output(now: Array, before: Array, at: Any, step: Array) -> Array:
            if isinstance(law, AbstractForceLaw):
                return law.force(v, at, now)[None]
            return jnp.stack([now[0], (now[0] - before[0]) / step])

        return _repeat(defect, output, weight.size, signals, steps, periods)

    return jax.vmap(march)(several)


@eqx.filter_jit
def _march_contact(
    effects: tuple[Effect, ...],
    port: Port,
    several: Values,
    signals: PortSignals,
    steps: Float[Array, " d"],
    periods: int,
) -> Float[Array, "v d n 1"]:
    def march(p: Values) -> Array:
        def held(now: Array, at: PortSignals) -> Bristle:
            return contact_bristle(effects, port, p, at, now[0])

        def defect(now: Array, before: Array, at: PortSignals, step: Array) -> Array:
            return (now - before) / step - held(now, at).rate

        def output(now: Array, before: Array, at: PortSignals, step: Array) -> Array:
            del before, step
            return held(now, at).force[None]

        return _repeat(defect, output, 1, signals, steps, periods)

    return jax.vmap(march)(several)


class _Marched(NamedTuple):
    """States at the end of a period, (s,), what is wanted along it, (n, k), periods so far, whether they repeat."""

    end: Array
    along: Array
    periods: Array
    repeats: Array


def _repeat(
    defect: Callable[..., Array],
    output: Callable[..., Array],
    size: int,
    signals: Any,
    steps: Float[Array, " d"],
    periods: int,
) -> Float[Array, "d n k"]:
    """``output`` along the last of several periods, or the first that repeats the one before.

    ``defect`` vanishes for the state at the end of a step.
    """

    def one_dwell(signals: Any, step: Array) -> Array:
        def advance(before: Array, at: Any) -> tuple[Array, Array]:
            def better(_: Array, now: Array) -> Array:
                left, matrix = jacobian(lambda each: defect(each, before, at, step), now)
                return now - solve_dense(matrix, left)

            now = jax.lax.fori_loop(0, NEWTON_STEPS, better, before)
            return now, output(now, before, at, step)

        def period(begun: Array) -> tuple[Array, Array]:
            return jax.lax.scan(advance, begun, signals)

        def goes_on(now: _Marched) -> Array:
            return (now.periods < periods) & ~now.repeats

        def another(now: _Marched) -> _Marched:
            end, along = period(now.end)
            moved, most = jnp.abs(end - now.end), jnp.abs(end)
            return _Marched(end, along, now.periods + 1, jnp.all(moved <= REPEATED * most))

        begin = jnp.zeros(size)
        _, along = jax.eval_shape(period, begin)
        first = _Marched(begin, jnp.zeros(along.shape, along.dtype), jnp.zeros((), int), jnp.asarray(False))
        return jax.lax.while_loop(goes_on, another, first).along

    return jax.vmap(one_dwell)(signals, steps)


def _at_nodes(along: Sequence[tuple[AlikeTests, Array]], solution: PeriodicSolution) -> NDArray[np.float64]:
    """What is known at even instants, (v, d, n, k) of tests alike, on the nodes: (v, P) for k = 1, else (v, P, k)."""
    layout, phase = solution.mesh.layout, np.asarray(solution.mesh.phase)
    several, *_, outputs = along[0][1].shape
    out = np.zeros((several, layout.total, outputs))
    for tests, marched in along:
        for place, values in zip(tests.places, np.moveaxis(np.asarray(marched), 1, 0), strict=True):
            mine = layout.nodes_of([place])
            for v, k in np.ndindex(several, outputs):
                out[v, mine, k] = np.interp(phase[mine], tests.grid, values[v, :, k], period=2.0 * np.pi)
    return out[..., 0] if outputs == 1 else out
