"""Plants that are written as a system of first order, x' = f(x, u; p), plus what effects add at its ports.

    class Drive(StateSpacePlant):
        states_declared = (
            State("angle", "rad", 0.1, "angle of the shaft"),
            State("speed", "rad/s", 1.0, "its speed", rate_of="angle"),
            State("current", "A", 0.5, "current of the motor"),
        )
        ...
        def rhs(self, x, u, p, f):
            load = f.force(BEARING, x.angle, x.speed)
            return {
                "speed": (p["k_m"] * x.current + load) / p["J"],
                "current": (u.voltage - p["R"] * x.current - p["k_m"] * x.speed) / p["L"],
            }

A state that is the rate of another one makes a coordinate with it, whose acceleration the right-hand side gives; all
others are internal states of the plant. So the solvers, which know coordinates and internal states alone, take it as
they take any plant.
"""

from abc import abstractmethod
from collections import namedtuple
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.core.values import Values
from savgs_ident.effects.base import InternalState, Port, PortKind, PortSignals
from savgs_ident.effects.composition import EffectsAtInstant, SeriesDeflection
from savgs_ident.plants.base import AbstractPlant, Coordinate, Inputs, Motion, Scalar


def _record_of(name: str, fields: list[str]) -> Any:
    """A class of named tuples, whose fields are known only when a plant is declared."""
    return namedtuple(name, fields)


@dataclass(frozen=True)
class State:
    """One state of a plant that is written as a system of first order.

    Attributes:
        name: its name.
        unit: its unit, SI.
        size: typical size [``unit``], for tolerances of solvers.
        about: what it is.
        rate_of: the state whose time derivative it is; empty where it is none's.
        rate: typical size of its own time derivative [``unit``/s]; where it is left out it follows from the sizes.
    """

    name: str
    unit: str
    size: float
    about: str = ""
    rate_of: str = ""
    rate: float = 0.0


class PortsAtInstant:
    """What acts at the ports of a plant at an instant: ``f`` of :meth:`StateSpacePlant.rhs`."""

    def __init__(self, acting: EffectsAtInstant) -> None:
        self._acting = acting

    def force(
        self,
        port: Port,
        displacement: Array,
        velocity: Array,
        load: Array | float = 0.0,
        rest: Array | float = 0.0,
    ) -> Float[Array, ""]:
        """The force of all effects at a port, with the pair that it works along [the port's units].

        ``load`` is what the port carries, where friction is proportional to it; ``rest`` the displacement at rest.
        """
        like = jnp.zeros_like(displacement)
        return self._acting.force(port, PortSignals(displacement, velocity, like + load, like + rest))

    def deflection(self, port: Port) -> SeriesDeflection:
        """By how much, and how fast, what is in series at a port gives way [the port's units]."""
        return self._acting.deflection(port)

    def carry(self, port: Port, load: Array, rest: Array | float = 0.0) -> None:
        """Put what is in series at a port under its load [the port's unit], of which ``rest`` is there at rest."""
        self._acting.carry(port, load, jnp.zeros_like(load) + rest)


class StateSpacePlant(AbstractPlant):
    """Base of plants that are written as a system of first order; see :mod:`savgs_ident.plants.state_space`.

    A plant declares ``states_declared``, ``inputs``, ``channels``, ``ports`` and ``parameters``, and implements
    :meth:`rhs` and :meth:`output`. ``moves`` of its inputs are those of the coordinates, which are the states that
    have a rate among the states, in their order. An input whose recording may be faulty has a port of the kind
    ``INPUT`` with the input's name as its location.
    """

    states_declared: ClassVar[tuple[State, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        declared = {each.name: each for each in cls.states_declared}
        pairs = [(declared[each.rate_of], each) for each in declared.values() if each.rate_of in declared]
        moving = {part.name for pair in pairs for part in pair}
        cls.coordinates = tuple(
            Coordinate(q.name, q.unit, q.about or q.name, q.size, v.size, v.rate or v.size**2 / q.size)
            for q, v in pairs
        )
        cls.coordinate_type = _record_of("Coordinates", [q.name for q, _ in pairs])
        cls.own_states = tuple(
            InternalState(each.name, each.unit, each.size)
            for each in declared.values()
            if each.name not in moving
        )
        cls._rates = tuple(v.name for _, v in pairs)
        cls._record = _record_of("States", list(declared))
        given = getattr(cls, "inputs", ())
        cls._values = _record_of("Values", [f"{each.name}{of}" for each in given for of in ("", "_rate")])

    _rates: ClassVar[tuple[str, ...]] = ()
    _record: ClassVar[Any] = tuple
    _values: ClassVar[Any] = tuple

    @abstractmethod
    def rhs(self, x: Any, u: Any, p: Values, f: PortsAtInstant) -> Mapping[str, Scalar]:
        """Time derivatives of the states, by name [unit of each per second]; not of those whose rate is a state.

        ``x`` has the states as attributes, ``u`` the inputs and their rates (``u.road``, ``u.road_rate``); ``p`` are
        the parameters by name, SI; ``f`` is what acts at the ports.
        """

    @abstractmethod
    def output(self, x: Any, dx: Any, u: Any, p: Values) -> tuple[Scalar, ...]:
        """What the channels show, one scalar for each, by the states ``x``, their derivatives ``dx`` and inputs."""

    def evaluate(
        self, p: Values, motion: Motion, u: Inputs, acting: EffectsAtInstant, prepared: None = None
    ) -> tuple[Float[Array, " n"], Any]:
        """Derivatives of the right-hand side less those of the motion, in the order of coordinates and own states."""
        x, dx = self._states(motion, acting.own, acting.own_rates)
        rates = self.rhs(x, self._driven(u, acting), p, PortsAtInstant(acting))
        wanted = [*self._rates, *(each.name for each in self.own_states)]
        return jnp.stack([rates[name] - getattr(dx, name) for name in wanted]), None

    def read(
        self, p: Values, motion: Motion, s: Array, sd: Array, u: Inputs, prepared: None = None
    ) -> tuple[Scalar, ...]:
        """What :meth:`output` gives."""
        own = len(self.own_states)
        recorded = self._values(*(part for signal in u.signals for part in signal))
        return self.output(*self._states(motion, s[:own], sd[:own]), recorded, p)

    def _states(self, motion: Motion, own: Array, own_rates: Array) -> tuple[Any, Any]:
        """The states and their time derivatives as records."""
        x, dx = {}, {}
        for place, (coordinate, rate) in enumerate(zip(self.coordinates, self._rates, strict=True)):
            x[coordinate.name], x[rate] = motion.q[place], motion.qd[place]
            dx[coordinate.name], dx[rate] = motion.qd[place], motion.qdd[place]
        for place, state in enumerate(self.own_states):
            x[state.name], dx[state.name] = own[place], own_rates[place]
        return self._record(**x), self._record(**dx)

    def _driven(self, u: Inputs, acting: EffectsAtInstant) -> Any:
        """The inputs with the faults of those that have a port."""
        ports = {port.location: port for port in self.ports if port.kind is PortKind.INPUT}
        signals = (
            acting.input(ports[each.name], signal, u.fundamental) if each.name in ports else signal
            for each, signal in zip(self.inputs, u.signals, strict=True)
        )
        return self._values(*(part for signal in signals for part in signal))
