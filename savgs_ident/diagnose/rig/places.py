"""The rig's ports as places of an unknown signal: laws of what a port sees, and free harmonics.

A force may be any law of displacement, velocity and load of its port, or what a contact there carries that gives a
little before it slides; what gives way, of the load there and its rate; a sensor's error, a linear filter of its
reading or a law of the reading and its rate; the road's, of the cam's angle. Where a force may be unknown and
something may give way, these are two families of laws (:mod:`savgs_ident.diagnose.rig.laws`), and so are the road's
and the two of a sensor: a place follows one law of one of them.
"""

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnose.engine.attribution import Place
from savgs_ident.diagnose.rig.columns import impose, node_loads
from savgs_ident.diagnose.rig.laws import (
    GAIN_AND_RATE,
    Family,
    filters_of,
    laws_of,
    of_a_force,
    of_a_reading,
    of_a_wavy_cam,
    of_the_cam,
    of_the_frame,
    of_what_gives,
)
from savgs_ident.diagnose.rig.nodes import Nodes, Signal, nodes_of, rate_of
from savgs_ident.diagnose.rig.plant import RigPlant
from savgs_ident.model.effect import Port
from savgs_ident.model.sensors import RESPONSE_CHANNELS
from savgs_ident.model.values import Values
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.periodic import PeriodicSolution

Fields = list[tuple[str, Signal]]
"""Where something is imposed, and what, at the nodes."""

FORCES = (Port.STRUT, Port.SUSPENSION, Port.TYRE_RADIAL, Port.TYRE_LATERAL, Port.RAIL)
"""Ports at which a force may be unknown."""

FREE_ORDERS = 9
"""Highest order of a free signal."""

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


def places_of(plant: RigPlant, terms: tuple[str, ...], p: Values, solution: PeriodicSolution) -> list[Place]:
    """All ports as places about a motion with ``terms`` at the parameters ``p``."""
    model = plant.complete(terms)
    ports, carried = node_loads(model, p, solution)
    nodes = nodes_of(solution)
    told: dict[str, list[tuple[Fields, tuple[int, ...]]]] = {}
    free: dict[str, Fields] = {}

    def ways(family: Family, field: str) -> tuple[Fields, tuple[int, ...]]:
        return [(field, _with_rate(each, nodes, solution)) for each in family.functions], family.plain

    for port in FORCES:
        displacement, velocity, load = (np.asarray(part) for part in ports[port.value])
        forces = of_a_force(displacement, velocity, load, solution)
        told[port.value] = [([(port.value, each) for each in forces.functions], forces.plain)]
        for carrier, field in GIVING.get(port, ()):
            beyond = np.asarray(carried[carrier].beyond_rest)
            told[port.value].append(ways(of_what_gives(beyond, rate_of(beyond, nodes, solution)), field))
        free[port.value] = [(port.value, each) for each in _waves(nodes)]
    for port, (carrier, field) in WAY_LOADS.items():
        beyond = np.asarray(carried[carrier].beyond_rest)
        families = [of_what_gives(beyond, rate_of(beyond, nodes, solution))]
        if port is Port.ROAD:
            families += [of_the_cam(nodes, solution), of_a_wavy_cam(nodes, solution)]
        if port is Port.FRAME:
            families = [of_the_frame(beyond, nodes)]
        told[port.value] = [ways(each, field) for each in families]
        free[port.value] = [(field, _with_rate(each, nodes, solution)) for each in _waves(nodes)]
    wheel = np.asarray(ports["rail"].velocity) + np.asarray(ports["suspension"].velocity)
    body = rate_of(np.asarray(ports["rail"].velocity), nodes, solution)
    masses: Fields = [("rail", body), ("tyre_radial", rate_of(wheel, nodes, solution))]
    told["inertia"], free["inertia"] = [(masses, ())], masses
    groups = [*(fields for some in told.values() for fields, _ in some), *free.values()]
    imposed = [each for some in groups for each in some]
    rows = iter(impose(model, plant.likelihood, plant.orders, p, solution, imposed))

    def taken(fields: Fields) -> Signal:
        return np.stack([next(rows) for _ in fields]).T

    laws = {
        name: tuple(law for fields, plain in some for law in laws_of(taken(fields), plain))
        for name, some in told.items()
    }
    places = [Place(name, laws[name], taken(some)) for name, some in free.items()]
    return places + _sensor_places(plant, p, solution)


def free_signal(coefficients: Signal, phase: Signal) -> Signal:
    """The free signal of a test at phases [rad], from its coefficients.

    Phases and signal are (n,), coefficients (f,).
    """
    order = np.arange(1, coefficients.size // 2 + 1)[:, None]
    return np.asarray(coefficients[0::2] @ np.cos(order * phase) + coefficients[1::2] @ np.sin(order * phase))


def _waves(nodes: Nodes) -> list[Signal]:
    return [wave(order * nodes.phase) for order in range(1, FREE_ORDERS + 1) for wave in (np.cos, np.sin)]


def _with_rate(signal: Signal, nodes: Nodes, solution: PeriodicSolution) -> Signal:
    return np.stack([signal, rate_of(signal, nodes, solution)], axis=1)


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
        dynamic = np.stack([rows_of(mine * each) for each in filters_of(omega)], axis=1)
        static = np.stack([rows_of(each) for each in of_a_reading(mine, omega)], axis=1)
        unit = [
            np.where(order == k, 1.0, 0.0) * turn for k in range(1, plant.orders + 1) for turn in (1.0, -1j)
        ]
        free = np.stack([rows_of(np.broadcast_to(each, mine.shape)) for each in unit], axis=1)
        places.append(Place(f"sensor.{channel}", (*laws_of(dynamic, GAIN_AND_RATE), *laws_of(static)), free))
    return places
