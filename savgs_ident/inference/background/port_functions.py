"""Functions of what a port sees, any sum of which is a law that an unknown signal may follow.

The functions of a set are smooth, some sharp about zero velocity, where friction turns round. Most of what is
missing in a model is simple: one friction, one compliance, one delay. A sum of a dozen functions can do the same, but
so can that of the location beside it; so every set also has its simple laws, of one function or a few.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.effects.base import Family, Load, Port, PortSignals
from savgs_ident.effects.laws.resonance import relative_response
from savgs_ident.effects.learned_functions import (
    OF_SLIDERS,
    OF_THE_LOAD,
    OF_THE_MOTION,
    OF_WHAT_GIVES,
    STRETCHES,
    RelativeMotion,
    filters,
    values_of,
    what_gives,
)
from savgs_ident.inference.background.constants import BackgroundConstants
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import compiled_quickly

Signal = NDArray[np.float64]
Matrix = NDArray[np.float64]


class Law(NamedTuple):
    """A law at a location, linear in its coefficients.

    Attributes:
        columns: change of the rows per function of the law, the same in all tests [unit of the row], (m, q).
        prior: its prior probability relative to the other laws of the location.
        whole: whether it may be any sum of a set of functions; a few of them otherwise.
        family: what kind of thing it is; None where it mixes several.
        port: name of the port where it acts; empty where that has no learned law.
    """

    columns: Matrix
    prior: float = 1.0
    whole: bool = True
    family: Family | None = None
    port: str = ""


@dataclass(frozen=True)
class InputLocation:
    """What an input at a location can do to the rows.

    Attributes:
        name: its name.
        laws: that the input may follow, one of them.
        free: change of the rows per component of a free input, in each dwell its own [unit of the row], (m, f).
    """

    name: str
    laws: tuple[Law, ...]
    free: Matrix

    @property
    def functions(self) -> Matrix:
        """What all functions do of which its laws consist [unit of the row], (m, q)."""
        return np.concatenate([law.columns for law in self.laws if law.whole], axis=1)


class MeshPoints(NamedTuple):
    """Phase [rad], dwell and angular frequency [rad/s] of the nodes, (P,) each."""

    phase: Signal
    dwell: NDArray[np.intp]
    omega: Signal


def mesh_points(solution: PeriodicSolution) -> MeshPoints:
    """The nodes of a motion."""
    layout = solution.mesh.layout
    omega = 2.0 * np.pi * np.asarray(solution.excitation.frequency)[layout.dwell]
    return MeshPoints(np.asarray(solution.mesh.phase), np.asarray(layout.dwell), omega)


def rate_of(signal: Signal, nodes: MeshPoints, solution: PeriodicSolution) -> Signal:
    """Time derivative [unit/s], (P,), of a signal (P,) at the nodes, by differences to both neighbours."""
    layout, gap = solution.mesh.layout, np.asarray(solution.mesh.gap)
    ahead, behind = gap, gap[layout.preceding]
    forward = (signal[layout.following] - signal) / ahead
    backward = (signal - signal[layout.preceding]) / behind
    return np.asarray(nodes.omega * (forward * behind + backward * ahead) / (ahead + behind))


class Recorded(NamedTuple):
    """An input, or a reading, in the tests that do not repeat.

    Attributes:
        in_window: which nodes are in such a test, (P,).
        value: what was recorded there less its mean in the test [1, or its unit], (P,), zero elsewhere.
        rate: its rate [that of the value/s], (P,), zero elsewhere.
    """

    in_window: NDArray[np.bool_]
    value: Signal
    rate: Signal


def recorded_in_windows(
    values: Signal, rates: Signal, nodes: MeshPoints, windows: NDArray[np.intp]
) -> Recorded:
    """What is known at all nodes, (P,) and (P,), in the tests at the places ``windows``."""
    inside = np.isin(nodes.dwell, windows)
    mean = np.bincount(nodes.dwell, values) / np.bincount(nodes.dwell)
    return Recorded(inside, inside * (values - mean[nodes.dwell]), inside * rates)


INSTANTS = 256
"""Instants of a period, at least, at which a law of a sensor's reading, or a load of a mode, is evaluated."""

_WORDS = [each.words for each in (*OF_THE_MOTION, *OF_THE_LOAD)]
PLAIN_FORCES = tuple(_WORDS.index(words) for words in ("tanh(v/0.01)", "v", "x"))
"""Indices of the plain ones among the :func:`motion_functions`: a friction, a damper, a spring."""

_LOADED_FRICTION = _WORDS.index("n tanh(v/0.01)")


GAIN_AND_RATE = (0, 1)
"""Indices of the plain ones among the :func:`sensor_filters`: a gain, and the rate, which is a small delay."""


class Functions(NamedTuple):
    """Functions of what is seen at P nodes, any sum of which is a law.

    Attributes:
        values: q of them [1, or the unit of what they are made of], (P,) each.
        families: to which family each belongs.
        plain: indices of those that make a simple law together.
    """

    values: list[Signal]
    families: tuple[Family, ...]
    plain: tuple[int, ...] = ()


def laws_of_functions(
    columns: NDArray[np.float64],
    families: Sequence[Family],
    constants: BackgroundConstants,
    plain: tuple[int, ...] = (),
    port: str = "",
) -> tuple[Law, ...]:
    """The laws of a set of functions: any sum of them or of those of a family, each alone, the plain ones together.

    The functions change the rows by ``columns`` [unit of the row], (m, q); they are of the ``families``, and
    ``plain`` are indices among the q; ``port`` is the name of the port where they act. The simple laws share the
    prior ``simple_law_prior``: those of one function alone, equally, all of it, or half of it where there are plain
    ones, whose sum has the other half.
    """
    prior = constants.simple_law_prior / (2.0 if plain else 1.0)
    share = prior / columns.shape[1]
    simple = [Law(columns[:, [place]], share, False, family, port) for place, family in enumerate(families)]
    if plain:
        simple.append(Law(columns[:, list(plain)], prior, False, None, port))
    different = dict.fromkeys(families)
    if len(different) == 1:
        return (Law(columns, 1.0, True, families[0], port), *simple)
    flexible = []
    for family in different:
        places = [place for place, each in enumerate(families) if each is family]
        if len(places) > 1:
            flexible.append(Law(columns[:, places], 1.0 / len(different), False, family, port))
    return (Law(columns, 1.0, True, None, port), *flexible, *simple)


def force_functions(port: Port, seen: PortSignals, solution: PeriodicSolution) -> Functions:
    """Forces as functions of what a ``port`` sees at the nodes of ``solution``, and those of spring-sliders."""
    displacement, velocity, load = (np.asarray(part) for part in seen[:3])
    held = [_slider(displacement, share * port.displacement, solution) for share in STRETCHES]
    return motion_functions(displacement, velocity, load, held)


def series_functions(load: Load) -> Functions:
    """Ways by which something gives under a ``load`` [the port's unit of force], (P,), as functions of it."""
    beyond = np.asarray(load.beyond_rest)
    largest = max(float(np.abs(beyond).max()), np.finfo(float).tiny)
    n, whole, rest = (
        jnp.asarray(np.broadcast_to(each, beyond.shape) / largest) for each in (beyond, load.total, load.rest)
    )
    values = [np.asarray(each) for each in _what_gives(n, whole, rest)]
    return Functions(values, tuple(each.family for each in OF_WHAT_GIVES), (0,))


def damped_functions(beyond: Signal, nodes: MeshPoints, solution: PeriodicSolution) -> Functions:
    """Ways by which something gives under a load (P,) [its unit] and its rate: what a damper beside it changes."""
    rate = rate_of(beyond, nodes, solution)
    found = [each / max(float(np.abs(each).max()), np.finfo(float).tiny) for each in (beyond, rate)]
    values = [*found, found[1] * np.abs(found[1]), found[0] * found[1]]
    return Functions(values, (Family.COMPLIANCE,) * len(values), (0, 1))


def resonance_functions(
    beyond: Signal, nodes: MeshPoints, constants: BackgroundConstants, time_scale: float
) -> Functions:
    """What gives under a load [the port's unit of force], (P,), and what slightly damped modes would make of it.

    ``time_scale`` [1] is that of the plant.
    """
    damping = constants.resonance_damping
    modes = [resonance(beyond, natural / time_scale, damping, nodes) for natural in constants.resonances]
    return Functions([beyond, *modes], (Family.OSCILLATOR,) * (1 + len(modes)))


def input_shape(angle: Signal, size: Signal, nodes: MeshPoints, recorded: Recorded) -> Functions:
    """Another shape or size [1] of an input, and one that comes a moment earlier or later than recorded.

    ``angle`` [rad], (P,), is that of the test and ``size`` (P,) its amplitude over the mean one. In a test without
    one, as on a road, nothing but its size and time can be other than ``recorded``.
    """
    rate = recorded.rate / np.max(nodes.omega[~recorded.in_window])
    speed = nodes.omega / np.max(nodes.omega)
    first, *shapes = [size * wave(order * angle) for order in (1, 2, 3) for wave in (np.cos, np.sin)]
    ahead, late = size * speed * np.cos(angle), size * speed * np.sin(angle)
    families = (Family.GAIN, Family.DYNAMICS, *(Family.SHAPE,) * 4, Family.DYNAMICS, Family.DYNAMICS)
    return Functions([first + recorded.value, *shapes, ahead, late - rate], families, (0, 1))


def input_ripple(angle: Signal, size: Signal, constants: BackgroundConstants) -> Functions:
    """Waves [1] on an input that are shorter than those of a wrong shape.

    ``angle`` [rad], (P,), is the test's and ``size`` (P,) its amplitude over the mean one.
    """
    orders = constants.ripple_orders
    waves = [size * wave(order * angle) for order in orders for wave in (np.cos, np.sin)]
    return Functions(waves, (Family.SHAPE,) * len(waves))


def input_size(recorded: Recorded) -> Functions:
    """Another size [1] of an input that never repeats, and one that comes a moment earlier or later."""
    value, rate = (each / max(float(np.abs(each).max()), np.finfo(float).tiny) for each in recorded[1:])
    return Functions([value, rate], (Family.GAIN, Family.DYNAMICS), (0, 1))


def sensor_filters(omega: Signal) -> list[NDArray[np.complex128]]:
    """Linear filters of a reading [1]: those of a learned transfer function.

    Filters and angular frequencies ``omega`` [rad/s], on the time scale of the plant, are (dwells, orders) each.
    """
    return [np.asarray(each, np.complex128) for each in _filters(jnp.asarray(omega))]


# Compiled as a whole, as all of these functions are.
@compiled_quickly
def _filters(omega: Any) -> list[Any]:
    return filters(omega)


class SensorFunction(NamedTuple):
    """A function of a reading and its rate [1].

    Attributes:
        harmonics: of the tests that repeat, (dwells, orders).
        in_windows: at the nodes of the others, (n,).
    """

    harmonics: NDArray[np.complex128]
    in_windows: Signal


def sensor_functions(
    reading: NDArray[np.complex128], omega: Signal, recorded: Recorded
) -> list[SensorFunction]:
    """Functions of a reading and its rate.

    The harmonics of the ``reading`` [its unit] in tests that repeat and their angular frequencies ``omega`` [rad/s]
    are (dwells, orders) each; in the others it is as ``recorded``.
    """
    orders = reading.shape[1]
    instants = max(INSTANTS, 2 ** ceil(log2(4 * orders)))
    turn = np.exp(2j * np.pi * np.outer(np.arange(orders), np.arange(instants)) / instants)
    along, rate = (np.real(each[:, 1:] @ turn[1:]) for each in (reading, 1j * omega * reading))
    values, rates = (
        np.concatenate([dwells.ravel(), others[recorded.in_window]])
        for dwells, others in ((along, recorded.value), (rate, recorded.rate))
    )
    found = motion_functions(values, rates, np.zeros(values.size))
    parts = (np.split(each, [along.size]) for each in found.values)
    return [
        SensorFunction(np.fft.rfft(dwells.reshape(along.shape))[:, :orders] * 2.0 / instants, others)
        for dwells, others in parts
    ]


def motion_functions(
    displacement: Signal, velocity: Signal, load: Signal, held: Sequence[Signal] = ()
) -> Functions:
    """Functions of what a port sees, each of about unit size, and what its spring-sliders carry, ``held``."""
    seen = (displacement - displacement.mean(), displacement, velocity, load)
    loaded = bool(np.any(load))
    x, d, v, n = (jnp.asarray(each / max(float(np.abs(each).max()), np.finfo(float).tiny)) for each in seen)
    without = (*OF_THE_MOTION, *(OF_THE_LOAD if loaded else ()))
    functions = (*without, *OF_SLIDERS[: len(held)])
    values = [np.asarray(each) for each in _values_of(functions, x, d, v, n, held)]
    plain = (*PLAIN_FORCES, *([_LOADED_FRICTION] if loaded else []))
    sliders = range(len(without), len(functions))
    return Functions(values, tuple(each.family for each in functions), (*plain, *sliders))


# Compiled as a whole: a program for each operation would take seconds to load.
@compiled_quickly
def _values_of(functions: Any, x: Any, d: Any, v: Any, n: Any, held: Any) -> Any:
    return values_of(functions, RelativeMotion(x, d, v, n, held=[jnp.asarray(each) for each in held]))


@eqx.filter_jit
def _what_gives(*load: Any) -> Any:
    return what_gives(*load)


def _slider(displacement: Signal, width: float, solution: PeriodicSolution) -> Signal:
    """What a spring-slider of unit friction carries that gives by ``width`` [m] before it slides, over a period."""
    carried = np.zeros_like(displacement)
    for first, count in zip(solution.mesh.layout.starts, solution.mesh.layout.counts, strict=True):
        along = displacement[first : first + count]
        # The first period forgets where it began.
        carried[first : first + count] = prandtl_element(np.concatenate([along, along]), width)[count:]
    return carried


def prandtl_element(displacement: Signal, width: float) -> Signal:
    """What a spring and a slider of unit friction carry along a motion (n,), which slide when stretched by ``width``.

    Motion and width have the same unit.
    """
    moves, now, carried = np.diff(displacement, prepend=displacement[:1]) / width, 0.0, []
    # Numbers of Python's own are several times as fast in a loop as those of an array.
    for move in moves.tolist():
        now = min(max(now + move, -1.0), 1.0)
        carried.append(now)
    return np.array(carried)


def resonance(load: Signal, natural: float, damping_ratio: float, nodes: MeshPoints) -> Signal:
    """What an oscillator of a natural frequency [Hz] makes of a load (P,)."""
    out = np.zeros_like(load)
    for test in range(int(nodes.dwell.max()) + 1):
        rows = np.flatnonzero(nodes.dwell == test)
        # A window is many periods of what swings, and has a node for each instant that matters.
        instants = max(INSTANTS, rows.size)
        grid = 2.0 * np.pi * np.arange(instants) / instants
        spectrum = np.fft.rfft(np.interp(grid, nodes.phase[rows], load[rows], period=2.0 * np.pi))
        omega = nodes.omega[rows[0]] * np.arange(spectrum.size)
        modal = relative_response(omega, 2.0 * np.pi * natural, damping_ratio)
        answer = np.fft.irfft(spectrum * modal, instants)
        out[rows] = np.interp(nodes.phase[rows], grid, answer, period=2.0 * np.pi)
    return out
