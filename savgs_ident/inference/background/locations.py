"""Hypotheses of an unknown signal at each location of a plant: laws of what a port sees, and free harmonics.

A location is where the ports of one name are. What may be unknown there follows from the kinds of its ports:

    port     a law may be any sum of functions of
    force    displacement, velocity and load of the port, or of what a contact there carries before it slides
    series   the load and its rate; where what is in series swings, of the load and of what resonances make of it
    input    the angle of the test: the shape of the input, or its ripple; its size and time where nothing turns
    sensor   the reading and its rate, or linear filters of the reading
    number   slopes in the numbers, or forces of the masses among them; only where no other port is: elsewhere
             laws of what acts there can do the same

Each is a set of functions of its own (:mod:`.port_functions`), and an unknown signal follows one law of one set.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import NDArray

from savgs_ident.core.values import Values
from savgs_ident.effects.base import Family, InputSignal, Load, Port, PortKind, PortSignals
from savgs_ident.inference.background.constants import BackgroundConstants
from savgs_ident.inference.background.imposed import impose, node_loads, slopes_in
from savgs_ident.inference.background.port_functions import (
    GAIN_AND_RATE,
    Functions,
    InputLocation,
    Law,
    MeshPoints,
    Recorded,
    Signal,
    damped_functions,
    force_functions,
    input_ripple,
    input_shape,
    input_size,
    laws_of_functions,
    mesh_points,
    rate_of,
    recorded_in_windows,
    resonance,
    resonance_functions,
    sensor_filters,
    sensor_functions,
    series_functions,
)
from savgs_ident.inference.likelihood import Likelihood
from savgs_ident.plants.base import AbstractPlant, Excitation, scale_of_time
from savgs_ident.simulate.excitation import signals_at
from savgs_ident.simulate.mesh import Mesh
from savgs_ident.simulate.periodic import PeriodicSolution
from savgs_ident.simulate.program_cache import placed
from savgs_ident.simulate.readings import analyse, harmonics, readings_of

Fields = list[tuple[str, Signal]]
"""Ports at which something is imposed, and what, at the nodes."""


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


class Linearisation(NamedTuple):
    """A model about a periodic motion, and the rows that are read there.

    Attributes:
        model: the model that moves.
        reading: the model whose sensors read.
        likelihood: what is compared, as rows.
        orders: highest order of the harmonics.
        p: the parameters, SI.
        solution: the motion.
    """

    model: AbstractPlant
    reading: AbstractPlant
    likelihood: Likelihood
    orders: int
    p: Values
    solution: PeriodicSolution

    def read(self) -> NDArray[np.complex128]:
        """Harmonics of the readings [unit of each], (D, C, K)."""
        return np.array(harmonics(self.reading, self.p, self.solution, self.orders))

    def rows(self, values: NDArray[np.complex128]) -> Signal:
        """Harmonics (D, C, K) as rows [unit of the reading], (m,)."""
        return self.likelihood.rows_of_one(values)

    def imposed(self, fields: Fields) -> Signal:
        """Change of the rows by each of the fields, (m, fields)."""
        return impose(self.model, self.likelihood, self.orders, self.p, self.solution, fields).T

    def slopes(self, names: Sequence[str]) -> Signal:
        """Slopes of the rows in the named parameters [units of the rows per SI unit], (m, n)."""
        p = placed(dict(self.p))
        return slopes_in(self.model, self.likelihood, self.orders, p, self.solution, names)


class _Seen(NamedTuple):
    """What the hypotheses are made of: a model about a motion, and what its ports see along it."""

    about: Linearisation
    nodes: MeshPoints
    signals: dict[str, PortSignals]
    loads: dict[str, Load]
    constants: BackgroundConstants

    @property
    def dwells(self) -> Signal:
        """1 of each test that repeats, 0 of the others, (D,)."""
        excitation = self.about.solution.excitation
        found = np.ones(excitation.frequency.shape[0])
        found[excitation.windows] = 0.0
        return found

    @property
    def angle(self) -> Signal:
        """Angle of the tests at the nodes [rad], (P,): that of the first input's first order."""
        excitation, first_input = self.about.solution.excitation, self.about.model.inputs[0].name
        first = np.asarray(excitation.harmonics[first_input])[:, 1]
        return np.asarray(self.nodes.phase + np.angle(first)[self.nodes.dwell])

    @property
    def amplitude(self) -> Signal:
        """Amplitude of the first input's first order in tests that repeat [its unit], 0 of the others, (D,)."""
        harmonics = self.about.solution.excitation.harmonics[self.about.model.inputs[0].name]
        return self.dwells * np.abs(np.asarray(harmonics)[:, 1])

    @property
    def mean_amplitude(self) -> float:
        """Its mean over these [its unit]; 1 where it moves in none."""
        return float(self.amplitude.sum() / max(self.dwells.sum(), 1.0)) or 1.0

    @property
    def size(self) -> Signal:
        """The amplitude over its mean [1], (D,), and 1 of tests that repeat if it moves in none."""
        return self.amplitude / self.mean_amplitude if self.amplitude.any() else self.dwells

    @property
    def recorded(self) -> Recorded:
        """The first input in tests that do not repeat, in its mean amplitude in those that do."""
        solution, model = self.about.solution, self.about.model
        windows = solution.excitation.windows
        if not windows.size:
            nothing = np.zeros(self.nodes.phase.size)
            return recorded_in_windows(nothing, nothing, self.nodes, windows)
        signal = _first_input(model, solution.excitation, solution.mesh)
        value, rate = (np.asarray(each) / self.mean_amplitude for each in signal)
        return recorded_in_windows(value, rate, self.nodes, windows)

    @property
    def readings(self) -> Signal:
        """What the sensors read at the nodes [the unit of each], (P, C); zeros where no test is in windows."""
        about, solution = self.about, self.about.solution
        if not solution.excitation.windows.size:
            return np.zeros((self.nodes.phase.size, len(about.model.channels)))
        return np.asarray(_readings(about.reading, placed(dict(about.p)), solution))

    def fields(self, port: Port, values: Sequence[Signal]) -> Fields:
        """Signals at the nodes, (P,) each, to be imposed at a port: with their rates where it is no force."""
        if port.kind is PortKind.FORCE:
            return [(port.name, each) for each in values]
        rates = (rate_of(each, self.nodes, self.about.solution) for each in values)
        return [(port.name, np.stack(pair, axis=1)) for pair in zip(values, rates, strict=True)]


def input_locations(about: Linearisation, constants: BackgroundConstants) -> list[InputLocation]:
    """All locations of a plant about a motion."""
    signals, loads = node_loads(about.model, about.p, about.solution)
    seen = _Seen(about, mesh_points(about.solution), signals, loads, constants)
    asked, sensors = [], []
    for name, ports in ports_by_location(about.model).items():
        kinds = {port.kind for port in ports}
        if PortKind.SENSOR in kinds:
            sensors.append(name)
        elif kinds == {PortKind.NUMBER}:
            asked.append(_numbers(name, ports, seen))
        else:
            asked.append(_signals(name, ports, seen))
    columns = about.imposed([field for each in asked for field in each.fields])
    ends = np.cumsum([len(each.fields) for each in asked], dtype=int)
    *parts, _ = np.split(columns, ends, axis=1)
    locations = [each.location(part) for each, part in zip(asked, parts, strict=True)]
    return locations + _sensors(sensors, seen)


class _Asked(NamedTuple):
    """Fields whose effect on the rows is asked for, and what location the answer (m, fields) makes."""

    fields: Fields
    location: Callable[[Signal], InputLocation]


def _signals(name: str, ports: Sequence[Port], seen: _Seen) -> _Asked:
    """A location where something acts, gives way or is imposed."""
    sets = [(port, each) for port in ports for each in _functions(port, seen)]
    port = signal_port(seen.about.model, name)
    assert port is not None
    fields = [seen.fields(where, each.values) for where, each in sets]
    free = seen.fields(port, _waves(seen))

    def location(columns: Signal) -> InputLocation:
        laws: list[Law] = []
        start = 0
        for (where, each), some in zip(sets, fields, strict=True):
            laws += laws_of_functions(
                columns[:, start : start + len(some)],
                each.families,
                seen.constants,
                each.plain,
                where.name,
            )
            start += len(some)
        return InputLocation(name, tuple(laws), columns[:, start:])

    return _Asked([*(each for some in fields for each in some), *free], location)


def _functions(port: Port, seen: _Seen) -> Iterator[Functions]:
    """The sets of functions that an unknown signal at a port may follow."""
    if port.kind is PortKind.FORCE:
        yield force_functions(port, seen.signals[port.name], seen.about.solution)
    elif port.kind is PortKind.SERIES:
        beyond = np.asarray(seen.loads[port.name].beyond_rest)
        if port.resonant:
            scale = scale_of_time(seen.about.model)
            yield resonance_functions(beyond, seen.nodes, seen.constants, scale)
        else:
            yield series_functions(seen.loads[port.name])
            yield damped_functions(beyond, seen.nodes, seen.about.solution)
    elif port.kind is PortKind.INPUT:
        recorded = seen.recorded
        if recorded.in_window.all():
            yield input_size(recorded)
            return
        angle, size = seen.angle, seen.size[seen.nodes.dwell]
        yield input_shape(angle, size, seen.nodes, recorded)
        yield input_ripple(angle, size, seen.constants)


def _numbers(name: str, ports: Sequence[Port], seen: _Seen) -> _Asked:
    """A location of numbers alone: forces of masses where they are declared, slopes in the numbers otherwise.

    What hangs on a mass may swing: it pulls as modes make it of the mass's acceleration.
    """
    constants = seen.constants
    inertias = [each for port in ports for each in port.inertias]
    if not inertias:
        numbers = [number for port in ports for number in port.numbers]
        slopes = seen.about.slopes([number.name for number in numbers])
        changes = slopes * np.array([number.change for number in numbers])
        laws = laws_of_functions(changes, (Family.NUMBER,) * len(numbers), constants)
        return _Asked([], lambda _: InputLocation(name, laws, changes))
    fields, swinging, scale = [], [], scale_of_time(seen.about.model)
    for each in inertias:
        velocity = sum(np.asarray(seen.signals[where].velocity) for where in each.velocity)
        acceleration = rate_of(np.asarray(velocity), seen.nodes, seen.about.solution)
        fields.append((each.force, acceleration))
        swinging += [
            (each.force, resonance(acceleration, natural / scale, constants.resonance_damping, seen.nodes))
            for natural in constants.resonances
        ]

    def location(columns: Signal) -> InputLocation:
        still, moving = columns[:, : len(fields)], columns[:, len(fields) :]
        laws = laws_of_functions(still, (Family.NUMBER,) * len(fields), constants)
        count = len(constants.resonances)
        for first in range(0, moving.shape[1], count):
            laws += laws_of_functions(
                moving[:, first : first + count], (Family.OSCILLATOR,) * count, constants
            )
        return InputLocation(name, laws, still)

    return _Asked([*fields, *swinging], location)


def free_signal(coefficients: Signal, phase: Signal) -> Signal:
    """The free signal of a test at phases [rad], from its coefficients.

    Phases and signal are (n,), coefficients (f,).
    """
    order = np.arange(1, coefficients.size // 2 + 1)[:, None]
    return np.asarray(coefficients[0::2] @ np.cos(order * phase) + coefficients[1::2] @ np.sin(order * phase))


def _waves(seen: _Seen) -> list[Signal]:
    """Components of a signal that is free in every dwell: in a window it would have too many."""
    phase, orders = seen.nodes.phase, range(1, seen.constants.free_orders + 1)
    counted = seen.dwells[seen.nodes.dwell]
    return [counted * wave(k * phase) for k in orders for wave in (np.cos, np.sin) if counted.any()]


def _sensors(names: Sequence[str], seen: _Seen) -> list[InputLocation]:
    """Errors of a sensor: linear filters of its reading, or a law of reading and rate; and free harmonics of it."""
    about, constants = seen.about, seen.constants
    channels = [each.name for each in about.model.channels]
    read, order = about.read(), np.arange(about.orders + 1)
    omega = 2.0 * np.pi * np.asarray(seen.about.solution.excitation.spacing)[:, None] * order
    time_scale = scale_of_time(about.model)
    along, locations = seen.readings, []
    for name in names:
        c = channels.index(name.removeprefix("sensor."))

        def rows(values: NDArray[np.complex128], c: int = c) -> Signal:
            out = np.zeros_like(read)
            out[:, c] = values
            return about.rows(out)

        mine = read[:, c]
        dynamic = np.stack([rows(mine * each) for each in sensor_filters(time_scale * omega)], axis=1)
        static = np.stack([rows(each) for each in _static_errors(along[:, c], mine, omega, seen)], axis=1)
        counted = seen.dwells[:, None]
        unit = [counted * (order == k) * turn for k in range(1, about.orders + 1) for turn in (1.0, -1j)]
        free = np.stack([rows(each) for each in unit], axis=1)
        port = next(
            each.name for each in about.model.ports if each.location == name and each.kind is PortKind.SENSOR
        )
        dynamics = (Family.GAIN, *(Family.DYNAMICS,) * (dynamic.shape[1] - 1))
        laws = (
            *laws_of_functions(dynamic, dynamics, constants, GAIN_AND_RATE, port),
            *laws_of_functions(static, (Family.SHAPE,) * static.shape[1], constants, (), port),
        )
        locations.append(InputLocation(name, laws, free))
    return locations


def _static_errors(
    value: Signal, read: NDArray[np.complex128], omega: Signal, seen: _Seen
) -> list[NDArray[np.complex128]]:
    """Harmonics (D, K) of functions of a reading and of its rate.

    Its ``value`` [its unit] is known at the nodes in windows, (P,), and its harmonics ``read`` and their angular
    frequencies [rad/s] of all tests, (D, K) each.
    """
    about, solution = seen.about, seen.about.solution
    windows, dwells = solution.excitation.windows, np.flatnonzero(seen.dwells)
    rate = rate_of(value, seen.nodes, solution)
    recorded = recorded_in_windows(value, rate, seen.nodes, windows)
    functions = sensor_functions(read[dwells], omega[dwells], recorded)
    found = np.zeros((len(functions), *read.shape), np.complex128)
    found[:, dwells] = [each.harmonics for each in functions]
    if windows.size:
        along = np.zeros((value.size, len(functions)))
        along[recorded.in_window] = np.stack([each.in_windows for each in functions], axis=1)
        shown = np.asarray(_analysed(jnp.asarray(along), solution, about.orders))
        found[:, windows] = np.swapaxes(shown, 0, 1)[:, windows]
    return list(found)


@eqx.filter_jit
def _first_input(model: AbstractPlant, excitation: Excitation, mesh: Mesh) -> InputSignal:
    return signals_at(model, excitation, mesh)[0][0]


@eqx.filter_jit
def _readings(model: AbstractPlant, p: Values, solution: PeriodicSolution) -> Array:
    return readings_of(model, p, solution.trajectory, solution)


@eqx.filter_jit
def _analysed(signals: Array, solution: PeriodicSolution, orders: int) -> Array:
    return analyse(signals, solution.mesh, orders, solution.excitation.part)
