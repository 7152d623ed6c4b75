"""The rig's ports as places of an unknown signal: laws of what a port sees, and free harmonics.

A force may be any law of displacement, velocity and load of its port, or what a contact there carries that gives a
little before it slides; what gives way, of the load there and its rate; a sensor's error, a linear filter of its
reading or a law of the reading and its rate; the road's, of the cam's angle. A law is a sum of smooth functions, some
sharp about zero velocity, where friction turns round. Where a force may be unknown and something may give way, these
are two laws, and so are the two of a sensor: a place follows one.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.attribution import Law, Place
from savgs_ident.diagnose.rig.columns import impose, node_loads
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.effects.learned.forces import OF_THE_LOAD, SHARP, functions
from savgs_ident.model.effect import Port
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.model.values import Values
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSolution

Signal = NDArray[np.float64]

Fields = list[tuple[str, Signal]]
"""Where something is imposed, and what, at the nodes."""

FORCES = (Port.STRUT, Port.SUSPENSION, Port.TYRE_RADIAL, Port.TYRE_LATERAL, Port.RAIL)
"""Ports at which a force may be unknown."""

STRETCHES = (1e-4, 1e-3)
"""How far a contact gives before it slides [m]."""

SIMPLE = 0.05
"""Probability of a simple law, to that of any other: most that is so simple is in the catalogue."""

RESONANCES = (3.0, 4.0, 5.4, 7.3, 9.8, 13.0, 18.0, 24.0, 33.0, 50.0)
"""Natural frequencies [Hz] of what the frame may do."""

INSTANTS = 256
"""Instants of a period at which a law of a sensor's reading is evaluated."""

FREE_ORDERS = 9
"""Highest order of a free signal."""


class Nodes(NamedTuple):
    """Phase [rad], dwell and angular frequency [rad/s] of the nodes, (P,) each."""

    phase: Signal
    dwell: NDArray[np.intp]
    omega: Signal


WAY_LOADS = {
    Port.LINK: ("link", "link_way"),
    Port.ROAD: ("road", "plate_way"),
    Port.FRAME: ("frame", "frame_way"),
}
"""The load under which a port gives way, and where that is imposed."""


GIVING = {
    Port.STRUT: (("strut", "mount_way"), ("damper", "damper_way")),
    Port.TYRE_LATERAL: (("tyre_lateral", "carcass_way"),),
}
"""The same where a force may be unknown too."""


def nodes_of(solution: PeriodicSolution) -> Nodes:
    """The nodes of a motion."""
    layout = solution.mesh.layout
    omega = 2.0 * np.pi * np.asarray(solution.excitation.frequency)[layout.dwell]
    return Nodes(np.asarray(solution.mesh.phase), np.asarray(layout.dwell), omega)


def places_of(plant: RigPlant, terms: tuple[str, ...], p: Values, solution: PeriodicSolution) -> list[Place]:
    """All ports as places about a motion with ``terms`` at the parameters ``p``."""
    model = plant.complete(terms)
    ports, carried = node_loads(model, p, solution)
    nodes = nodes_of(solution)
    laws: dict[str, list[tuple[float, Fields]]] = {}
    free: dict[str, Fields] = {}
    for port in FORCES:
        seen = [np.asarray(part) for part in ports[port.value]]
        held = [_stop(seen[0], width, nodes, solution) for width in STRETCHES]
        every, few = [*_force_laws(*seen), *held], [*_simple_laws(*seen), *held]
        laws[port.value] = [(1.0, [(port.value, each) for each in every])]
        laws[port.value].append((SIMPLE, [(port.value, each) for each in few]))
        for load, field in GIVING.get(port, ()):
            beyond = np.asarray(carried[load].beyond_rest)
            ways = _force_laws(beyond, _rate(beyond, nodes, solution), np.zeros_like(beyond))
            laws[port.value].append((1.0, [(field, _with_rate(each, nodes, solution)) for each in ways]))
        free[port.value] = [(port.value, each) for each in _waves(nodes)]
    for port, (load, field) in WAY_LOADS.items():
        beyond = np.asarray(carried[load].beyond_rest)
        ways = _force_laws(beyond, _rate(beyond, nodes, solution), np.zeros_like(beyond))
        if port is Port.ROAD:
            ways = [*ways, *_cam_waves(nodes, solution)]
        if port is Port.FRAME:
            ways = [beyond, *_resonances(beyond, nodes)]
        laws[port.value] = [(1.0, [(field, _with_rate(each, nodes, solution)) for each in ways])]
        free[port.value] = [(field, _with_rate(each, nodes, solution)) for each in _waves(nodes)]
    wheel = np.asarray(ports["rail"].velocity) + np.asarray(ports["suspension"].velocity)
    body = _rate(np.asarray(ports["rail"].velocity), nodes, solution)
    masses: Fields = [("rail", body), ("tyre_radial", _rate(wheel, nodes, solution))]
    laws["inertia"], free["inertia"] = [(1.0, masses)], masses
    groups = [*(law for some in laws.values() for _, law in some), *free.values()]
    fields = [each for some in groups for each in some]
    rows = iter(impose(model, plant.likelihood, plant.orders, p, solution, fields))

    def taken(fields: Fields) -> Signal:
        return np.stack([next(rows) for _ in fields]).T

    law_rows = {name: tuple(Law(taken(law), prior) for prior, law in some) for name, some in laws.items()}
    places = [Place(name, law_rows[name], taken(some)) for name, some in free.items()]
    return places + _sensor_places(plant, p, solution)


def free_signal(coefficients: Signal, phase: Signal) -> Signal:
    """The free signal of a test at phases [rad], from its coefficients.

    Phases and signal are (n,), coefficients (f,).
    """
    order = np.arange(1, coefficients.size // 2 + 1)[:, None]
    return np.asarray(coefficients[0::2] @ np.cos(order * phase) + coefficients[1::2] @ np.sin(order * phase))


def _waves(nodes: Nodes) -> list[Signal]:
    return [wave(order * nodes.phase) for order in range(1, FREE_ORDERS + 1) for wave in (np.cos, np.sin)]


def _force_laws(displacement: Signal, velocity: Signal, load: Signal) -> list[Signal]:
    """Functions of what a port sees, each of about unit size."""
    x = displacement - displacement.mean()
    x = x / max(float(np.abs(x).max()), np.finfo(float).tiny)
    v = velocity / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    loaded = bool(np.any(load))
    n = load / np.abs(load).max() if loaded else load
    found = [np.asarray(each) for each in functions(jnp.asarray(x), jnp.asarray(v), jnp.asarray(n))]
    return found if loaded else found[: -len(OF_THE_LOAD)]


def _simple_laws(displacement: Signal, velocity: Signal, load: Signal) -> list[Signal]:
    """The few that come first to mind: a friction, a damper, a spring, a friction in proportion to the load."""
    x = displacement - displacement.mean()
    v = velocity / max(float(np.abs(velocity).max()), np.finfo(float).tiny)
    sharp = np.tanh(v / SHARP[0])
    carried = [load / np.abs(load).max() * sharp] if np.any(load) else []
    return [sharp, v, x / max(float(np.abs(x).max()), np.finfo(float).tiny), *carried]


def _stop(displacement: Signal, width: float, nodes: Nodes, solution: PeriodicSolution) -> Signal:
    """What a contact of unit grip carries that gives by ``width`` [m] before it slides (Prandtl's element)."""
    carried = np.zeros_like(displacement)
    for first, count in zip(solution.mesh.layout.starts, solution.mesh.layout.counts, strict=True):
        along = displacement[first : first + count]
        moves = (along - np.roll(along, 1)) / width
        now = 0.0
        # The first period forgets where it began.
        for place, move in enumerate((*moves, *moves)):
            now = min(max(now + move, -1.0), 1.0)
            carried[first + place % count] = now
    return carried


def _rate(signal: Signal, nodes: Nodes, solution: PeriodicSolution) -> Signal:
    """Time derivative at the nodes, by differences to both neighbours."""
    layout, gap = solution.mesh.layout, np.asarray(solution.mesh.gap)
    ahead, behind = gap, gap[layout.preceding]
    forward = (signal[layout.following] - signal) / ahead
    backward = (signal - signal[layout.preceding]) / behind
    return np.asarray(nodes.omega * (forward * behind + backward * ahead) / (ahead + behind))


def _with_rate(signal: Signal, nodes: Nodes, solution: PeriodicSolution) -> Signal:
    return np.stack([signal, _rate(signal, nodes, solution)], axis=1)


def _cam_waves(nodes: Nodes, solution: PeriodicSolution) -> list[Signal]:
    """What a cam of another shape or lift would do, and one that turns a moment earlier or later than is told."""
    turned = np.angle(np.asarray(solution.excitation.road))[:, 1][nodes.dwell]
    angle, speed = nodes.phase + turned, nodes.omega / np.max(nodes.omega)
    shapes = [wave(order * angle) for order in (1, 2, 3) for wave in (np.cos, np.sin)]
    return [*shapes, speed * np.cos(angle), speed * np.sin(angle)]


def _resonances(load: Signal, nodes: Nodes) -> list[Signal]:
    """What an oscillator of each natural frequency makes of a load, slightly damped."""
    found = []
    tests = [np.flatnonzero(nodes.dwell == test) for test in range(int(nodes.dwell.max()) + 1)]
    grid = 2.0 * np.pi * np.arange(256) / 256
    for natural in RESONANCES:
        out = np.zeros_like(load)
        for rows in tests:
            spectrum = np.fft.rfft(np.interp(grid, nodes.phase[rows], load[rows], period=2.0 * np.pi))
            omega = nodes.omega[rows[0]] * np.arange(spectrum.size)
            own = 2.0 * np.pi * natural
            answer = np.fft.irfft(spectrum * own**2 / (own**2 - omega**2 + 0.2j * own * omega), 256)
            out[rows] = np.interp(nodes.phase[rows], grid, answer, period=2.0 * np.pi)
        found.append(out)
    return found


def _sensor_places(plant: RigPlant, p: Values, solution: PeriodicSolution) -> list[Place]:
    """Errors of a sensor: linear filters of its reading, or a law of reading and rate; and free harmonics of it."""
    read = np.array(harmonics(plant.complete(()), p, solution, plant.orders))
    order = np.arange(plant.orders + 1)
    omega = 2.0 * np.pi * np.asarray(solution.excitation.frequency)[:, None] * order
    places = []
    for c, channel in enumerate(RESPONSE_CHANNELS):

        def rows_of(values: NDArray[np.complex128], c: int = c) -> Signal:
            out = np.zeros_like(read)
            out[:, c] = values
            return np.asarray(plant.likelihood.rows(jnp.asarray(out)))

        mine = read[:, c]
        filters = [1.0 + 0.0 * omega, 1j * omega / 20.0, -((omega / 20.0) ** 2)]
        filters += [corner / (corner + 1j * omega) for corner in (20.0, 60.0, 180.0)]
        dynamic = np.stack([rows_of(mine * each) for each in filters], axis=1)
        static = np.stack([rows_of(each) for each in _reading_laws(mine, omega)], axis=1)
        unit = [
            np.where(order == k, 1.0, 0.0) * turn for k in range(1, plant.orders + 1) for turn in (1.0, -1j)
        ]
        free = np.stack([rows_of(np.broadcast_to(each, mine.shape)) for each in unit], axis=1)
        places.append(Place(f"sensor.{channel}", (Law(dynamic), Law(static)), free))
    return places


def _reading_laws(reading: NDArray[np.complex128], omega: Signal) -> list[NDArray[np.complex128]]:
    """Harmonics of functions of a reading and its rate, from its harmonics; both (dwells, orders), rad/s."""
    orders = reading.shape[1]
    turn = np.exp(2j * np.pi * np.outer(np.arange(orders), np.arange(INSTANTS)) / INSTANTS)
    along, rate = (np.real(each[:, 1:] @ turn[1:]) for each in (reading, 1j * omega * reading))
    laws = _force_laws(along.ravel(), rate.ravel(), np.zeros(along.size))
    return [np.fft.rfft(each.reshape(along.shape))[:, :orders] * 2.0 / INSTANTS for each in laws]
