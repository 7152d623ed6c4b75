"""Hypotheses of an unknown signal at each location of a plant: laws of what a port sees, and free harmonics.

A location is where the ports of one name are. What may be unknown there follows from the kinds of its ports:

    port     a law may be any sum of functions of
    force    displacement, velocity and load of the port, or of what a contact there carries before it slides
    series   the load and its rate; where what is in series swings, of the load and of what resonances make of it
    input    the angle of the test: the shape of the input, or its ripple
    sensor   the reading and its rate, or linear filters of the reading
    number   slopes in the numbers, or forces of the masses among them; only where no other port is: elsewhere
             laws of what acts there can do the same

Each is a set of functions of its own, and an unknown signal follows one law of one set.

The functions of a set are smooth, some sharp about zero velocity, where friction turns round. Most of what is
missing in a model is simple: one friction, one compliance, one delay. A sum of a dozen functions can do the same, but
so can that of the location beside it; so every set also has its simple laws, of one function or a few.
"""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.diagnosis.effect_sensitivities import impose, node_loads
from savgs_ident.diagnosis.localisation import InputLocation, Law
from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.effects.base import Family, Load, Port, PortKind, PortSignals
from savgs_ident.effects.learned import (
    OF_SLIDERS,
    OF_THE_LOAD,
    OF_THE_MOTION,
    OF_WHAT_GIVES,
    STRETCHES,
    filters,
    functions,
    what_gives,
)
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.periodic import PeriodicSolution, harmonics
from savgs_ident.simulate.program_cache import placed

if TYPE_CHECKING:
    from savgs_ident.diagnosis.dwell_problem import DwellProblem

Signal = NDArray[np.float64]


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


RESONANCES = (3.0, 4.0, 5.4, 7.3, 9.8, 13.0, 18.0, 24.0, 33.0, 50.0)
"""Natural frequencies [Hz] of what may swing under its load."""

WAVES = (4, 5, 6, 7, 8, 9)
"""Orders of the ripple of an input, beyond those of its shape."""

INSTANTS = 256
"""Instants of a period at which a law of a sensor's reading is evaluated."""

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
    columns: NDArray[np.float64], families: Sequence[Family], plain: tuple[int, ...] = (), port: str = ""
) -> tuple[Law, ...]:
    """The laws of a set of functions: any sum of them or of those of a family, each alone, the plain ones together.

    The functions change the rows by ``columns`` [unit of the row], (m, q); they are of the ``families``, and
    ``plain`` are indices among the q; ``port`` is the name of the port where they act.
    """
    alone = [([place], families[place]) for place in range(columns.shape[1])]
    shares = [DEFAULTS.simple_law_prior / len(alone)] * len(alone)
    simple = [
        Law(columns[:, places], share, False, family, port)
        for (places, family), share in zip(alone, shares, strict=True)
    ]
    if plain:
        simple = [each._replace(prior=each.prior / 2.0) for each in simple]
        simple.append(Law(columns[:, list(plain)], DEFAULTS.simple_law_prior / 2.0, False, None, port))
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
    values = [np.asarray(each) for each in what_gives(n, whole, rest)]
    return Functions(values, tuple(each.family for each in OF_WHAT_GIVES), (0,))


def damped_functions(beyond: Signal, nodes: MeshPoints, solution: PeriodicSolution) -> Functions:
    """Ways by which something gives under a load (P,) [its unit] and its rate: what a damper beside it changes."""
    rate = rate_of(beyond, nodes, solution)
    found = [each / max(float(np.abs(each).max()), np.finfo(float).tiny) for each in (beyond, rate)]
    values = [*found, found[1] * np.abs(found[1]), found[0] * found[1]]
    return Functions(values, (Family.COMPLIANCE,) * len(values), (0, 1))


def resonance_functions(beyond: Signal, nodes: MeshPoints) -> Functions:
    """What gives under a load [the port's unit of force], (P,), and what slightly damped modes would make of it."""
    modes = [_resonance(beyond, natural, nodes) for natural in RESONANCES]
    return Functions([beyond, *modes], (Family.OSCILLATOR,) * (1 + len(modes)))


def input_shape(angle: Signal, nodes: MeshPoints) -> Functions:
    """Another shape or size [1] of an input, and one that comes a moment earlier or later than recorded.

    ``angle`` [rad], (P,), is that of the test.
    """
    speed = nodes.omega / np.max(nodes.omega)
    shapes = [wave(order * angle) for order in (1, 2, 3) for wave in (np.cos, np.sin)]
    families = (Family.GAIN, Family.DYNAMICS, *(Family.SHAPE,) * 4, Family.DYNAMICS, Family.DYNAMICS)
    return Functions([*shapes, speed * np.cos(angle), speed * np.sin(angle)], families, (0, 1))


def input_ripple(angle: Signal) -> Functions:
    """Waves [1] on an input that are shorter than those of a wrong shape; ``angle`` [rad], (P,), is the test's."""
    waves = [wave(order * angle) for order in WAVES for wave in (np.cos, np.sin)]
    return Functions(waves, (Family.SHAPE,) * len(waves))


def sensor_filters(omega: Signal) -> list[NDArray[np.complex128]]:
    """Linear filters of a reading [1]: those of a learned transfer function.

    Filters and angular frequencies ``omega`` [rad/s] are (dwells, orders) each.
    """
    return [np.asarray(each, np.complex128) for each in filters(jnp.asarray(omega))]


def sensor_functions(reading: NDArray[np.complex128], omega: Signal) -> list[NDArray[np.complex128]]:
    """Harmonics [1] of functions of a reading and its rate.

    They, the harmonics of the ``reading`` [its unit] and the angular frequencies ``omega`` [rad/s] are
    (dwells, orders) each.
    """
    orders = reading.shape[1]
    turn = np.exp(2j * np.pi * np.outer(np.arange(orders), np.arange(INSTANTS)) / INSTANTS)
    along, rate = (np.real(each[:, 1:] @ turn[1:]) for each in (reading, 1j * omega * reading))
    found = motion_functions(along.ravel(), rate.ravel(), np.zeros(along.size))
    return [np.fft.rfft(each.reshape(along.shape))[:, :orders] * 2.0 / INSTANTS for each in found.values]


def motion_functions(
    displacement: Signal, velocity: Signal, load: Signal, held: Sequence[Signal] = ()
) -> Functions:
    """Functions of what a port sees, each of about unit size, and what its spring-sliders carry, ``held``."""
    x = displacement - displacement.mean()
    x = x / max(float(np.abs(x).max()), np.finfo(float).tiny)
    v = velocity / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    loaded = bool(np.any(load))
    n = load / np.abs(load).max() if loaded else load
    found = [np.asarray(each) for each in functions(jnp.asarray(x), jnp.asarray(v), jnp.asarray(n))]
    if not loaded:
        found = found[: -len(OF_THE_LOAD)]
    families = [each.family for each in (*OF_THE_MOTION, *OF_THE_LOAD)][: len(found)]
    plain = (*PLAIN_FORCES, *([_LOADED_FRICTION] if loaded else []))
    sliders = tuple(each.family for each in OF_SLIDERS[: len(held)])
    beyond = tuple(range(len(found), len(found) + len(held)))
    return Functions([*found, *held], (*families, *sliders), (*plain, *beyond))


def _slider(displacement: Signal, width: float, solution: PeriodicSolution) -> Signal:
    """What a spring-slider of unit grip carries that gives by ``width`` [m] before it slides, over a period."""
    carried = np.zeros_like(displacement)
    for first, count in zip(solution.mesh.layout.starts, solution.mesh.layout.counts, strict=True):
        along = displacement[first : first + count]
        # The first period forgets where it began.
        carried[first : first + count] = prandtl_element(np.concatenate([along, along]), width)[count:]
    return carried


def prandtl_element(displacement: Signal, width: float) -> Signal:
    """What a spring and a slider of unit grip carry along a motion (n,), sliding when stretched by ``width`` [m]."""
    carried = np.zeros_like(displacement)
    moves, now = np.diff(displacement, prepend=displacement[:1]) / width, 0.0
    for place, move in enumerate(moves):
        now = min(max(now + move, -1.0), 1.0)
        carried[place] = now
    return carried


def _resonance(load: Signal, natural: float, nodes: MeshPoints) -> Signal:
    """What an oscillator of a natural frequency [Hz] makes of a load (P,)."""
    out, grid, own = np.zeros_like(load), 2.0 * np.pi * np.arange(256) / 256, 2.0 * np.pi * natural
    for test in range(int(nodes.dwell.max()) + 1):
        rows = np.flatnonzero(nodes.dwell == test)
        spectrum = np.fft.rfft(np.interp(grid, nodes.phase[rows], load[rows], period=2.0 * np.pi))
        omega = nodes.omega[rows[0]] * np.arange(spectrum.size)
        answer = np.fft.irfft(spectrum * own**2 / (own**2 - omega**2 + 0.2j * own * omega), 256)
        out[rows] = np.interp(nodes.phase[rows], grid, answer, period=2.0 * np.pi)
    return out


Fields = list[tuple[str, Signal]]
"""Ports at which something is imposed, and what, at the nodes."""

FREE_ORDERS = 9
"""Highest order of a free signal."""


def ports_by_location(plant: AbstractPlant) -> dict[str, tuple[Port, ...]]:
    """The ports of a plant by location, in the order in which it declares them."""
    locations = dict.fromkeys(port.location for port in plant.ports)
    return {each: tuple(port for port in plant.ports if port.location == each) for each in locations}


def signal_port(plant: AbstractPlant, location: str) -> Port | None:
    """The port of a location at which an unknown signal is inferred: a force before what gives way or an input.

    None where there are numbers alone.
    """
    ports = ports_by_location(plant)[location]
    kinds = (PortKind.FORCE, PortKind.SERIES, PortKind.INPUT, PortKind.SENSOR)
    return next((port for kind in kinds for port in ports if port.kind is kind), None)


def force_port(plant: AbstractPlant | type[AbstractPlant], location: str) -> Port | None:
    """The port of a location where a force may act; None where there is no such port."""
    ports = (port for port in plant.ports if port.kind is PortKind.FORCE and port.location == location)
    return next(ports, None)


class _Seen(NamedTuple):
    """What the hypotheses are made of: the motion of a model, and what its ports see along it."""

    problem: "DwellProblem"
    model: AbstractPlant
    p: Values
    solution: PeriodicSolution
    nodes: MeshPoints
    signals: dict[str, PortSignals]
    loads: dict[str, Load]

    @property
    def angle(self) -> Signal:
        """Angle of the tests at the nodes [rad], (P,): that of the first input's first order."""
        first = np.asarray(self.solution.excitation.harmonics[self.problem.plant.inputs[0].name])[:, 1]
        return np.asarray(self.nodes.phase + np.angle(first)[self.nodes.dwell])

    def imposed(self, fields: Fields) -> Signal:
        """Change of the rows by each of the fields, (m, fields)."""
        likelihood, orders = self.problem.likelihood, self.problem.orders
        return impose(self.model, likelihood, orders, self.p, self.solution, fields).T

    def fields(self, port: Port, values: Sequence[Signal]) -> Fields:
        """Signals at the nodes, (P,) each, to be imposed at a port: with their rates where it is no force."""
        if port.kind is PortKind.FORCE:
            return [(port.name, each) for each in values]
        rates = (rate_of(each, self.nodes, self.solution) for each in values)
        return [(port.name, np.stack(pair, axis=1)) for pair in zip(values, rates, strict=True)]


def input_locations(
    problem: "DwellProblem", terms: tuple[str, ...], p: Values, solution: PeriodicSolution
) -> list[InputLocation]:
    """All locations about a motion with ``terms`` at the parameters ``p`` [SI]."""
    model = problem.complete(terms)
    signals, loads = node_loads(model, p, solution)
    seen = _Seen(problem, model, p, solution, mesh_points(solution), signals, loads)
    locations, sensors = [], []
    for name, ports in ports_by_location(problem.plant).items():
        kinds = {port.kind for port in ports}
        if PortKind.SENSOR in kinds:
            sensors.append(name)
        elif kinds == {PortKind.NUMBER}:
            locations.append(_numbers(name, ports, seen))
        else:
            locations.append(_signals(name, ports, seen))
    return locations + _sensors(sensors, seen)


def _signals(name: str, ports: Sequence[Port], seen: _Seen) -> InputLocation:
    """A location where something acts, gives way or is imposed."""
    sets = [(port, each) for port in ports for each in _functions(port, seen)]
    port = signal_port(seen.problem.plant, name)
    assert port is not None
    fields = [seen.fields(where, each.values) for where, each in sets]
    free = seen.fields(port, _waves(seen.nodes))
    columns = seen.imposed([*(each for some in fields for each in some), *free])
    laws: list[Law] = []
    start = 0
    for (where, each), some in zip(sets, fields, strict=True):
        laws += laws_of_functions(
            columns[:, start : start + len(some)], each.families, each.plain, where.name
        )
        start += len(some)
    return InputLocation(name, tuple(laws), columns[:, start:])


def _functions(port: Port, seen: _Seen) -> Iterator[Functions]:
    """The sets of functions that an unknown signal at a port may follow."""
    if port.kind is PortKind.FORCE:
        yield force_functions(port, seen.signals[port.name], seen.solution)
    elif port.kind is PortKind.SERIES:
        beyond = np.asarray(seen.loads[port.name].beyond_rest)
        if port.resonant:
            yield resonance_functions(beyond, seen.nodes)
        else:
            yield series_functions(seen.loads[port.name])
            yield damped_functions(beyond, seen.nodes, seen.solution)
    elif port.kind is PortKind.INPUT:
        yield input_shape(seen.angle, seen.nodes)
        yield input_ripple(seen.angle)


def _numbers(name: str, ports: Sequence[Port], seen: _Seen) -> InputLocation:
    """A location of numbers alone: forces of masses where they are declared, slopes in the numbers otherwise.

    What hangs on a mass may swing: it pulls as modes make it of the mass's acceleration.
    """
    inertias = [each for port in ports for each in port.inertias]
    if not inertias:
        numbers = [number for port in ports for number in port.numbers]
        slopes = seen.problem.slopes(
            seen.model, placed(dict(seen.p)), seen.solution, [number.name for number in numbers]
        )
        columns = slopes * np.array([number.change for number in numbers])
        return InputLocation(name, laws_of_functions(columns, (Family.NUMBER,) * len(numbers)), columns)
    fields, swinging = [], []
    for each in inertias:
        velocity = sum(np.asarray(seen.signals[where].velocity) for where in each.velocity)
        acceleration = rate_of(np.asarray(velocity), seen.nodes, seen.solution)
        fields.append((each.force, acceleration))
        swinging += [(each.force, _resonance(acceleration, natural, seen.nodes)) for natural in RESONANCES]
    columns = seen.imposed([*fields, *swinging])
    still, moving = columns[:, : len(fields)], columns[:, len(fields) :]
    laws = [*laws_of_functions(still, (Family.NUMBER,) * len(fields))]
    for first in range(0, moving.shape[1], len(RESONANCES)):
        mine = moving[:, first : first + len(RESONANCES)]
        laws += laws_of_functions(mine, (Family.OSCILLATOR,) * mine.shape[1])
    return InputLocation(name, tuple(laws), still)


def free_signal(coefficients: Signal, phase: Signal) -> Signal:
    """The free signal of a test at phases [rad], from its coefficients.

    Phases and signal are (n,), coefficients (f,).
    """
    order = np.arange(1, coefficients.size // 2 + 1)[:, None]
    return np.asarray(coefficients[0::2] @ np.cos(order * phase) + coefficients[1::2] @ np.sin(order * phase))


def _waves(nodes: MeshPoints) -> list[Signal]:
    return [wave(order * nodes.phase) for order in range(1, FREE_ORDERS + 1) for wave in (np.cos, np.sin)]


def _sensors(names: Sequence[str], seen: _Seen) -> list[InputLocation]:
    """Errors of a sensor: linear filters of its reading, or a law of reading and rate; and free harmonics of it."""
    problem = seen.problem
    read = np.array(harmonics(problem.complete(()), seen.p, seen.solution, problem.orders))
    order = np.arange(problem.orders + 1)
    omega = 2.0 * np.pi * np.asarray(seen.solution.excitation.frequency)[:, None] * order
    locations = []
    for name in names:
        c = problem.channels.index(name.removeprefix("sensor."))

        def rows(values: NDArray[np.complex128], c: int = c) -> Signal:
            out = np.zeros_like(read)
            out[:, c] = values
            return np.asarray(problem.likelihood.rows(jnp.asarray(out)))

        mine = read[:, c]
        dynamic = np.stack([rows(mine * each) for each in sensor_filters(omega)], axis=1)
        static = np.stack([rows(each) for each in sensor_functions(mine, omega)], axis=1)
        unit = [
            np.where(order == k, 1.0, 0.0) * turn for k in range(1, problem.orders + 1) for turn in (1.0, -1j)
        ]
        free = np.stack([rows(np.broadcast_to(each, mine.shape)) for each in unit], axis=1)
        port = next(
            each.name
            for each in problem.plant.ports
            if each.location == name and each.kind is PortKind.SENSOR
        )
        dynamics = (Family.GAIN, *(Family.DYNAMICS,) * (dynamic.shape[1] - 1))
        laws = (
            *laws_of_functions(dynamic, dynamics, GAIN_AND_RATE, port),
            *laws_of_functions(static, (Family.SHAPE,) * static.shape[1], (), port),
        )
        locations.append(InputLocation(name, laws, free))
    return locations
