"""How the effects of a model act together at one instant.

Forces at a port add up; what gives way in the path of one load adds up too. An :class:`Acting` is made for one
evaluation of the model: it asks the effects port by port and keeps what it found on the way.
"""

from collections.abc import Iterator
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from savgs_ident.model.effect import (
    AbstractEffect,
    AbstractForce,
    AbstractGrip,
    AbstractRoadFault,
    AbstractSeries,
    Cam,
    Grip,
    Load,
    Port,
    PortSignals,
)
from savgs_ident.model.inputs import Inputs
from savgs_ident.model.tyre import Road
from savgs_ident.model.values import Values


class Part(NamedTuple):
    """An effect with its states and their rates. States are in their own units, rates in those per second."""

    effect: AbstractEffect
    state: Float[Array, " s"]
    rate: Float[Array, " s"]


class Way(NamedTuple):
    """By how much something gives way [m or rad], and how fast."""

    displacement: Float[Array, ""]
    velocity: Float[Array, ""]


class Acting:
    """The effects of a model at one instant, with parameters ``p``.

    Attributes:
        balances: what vanishes for the right rates of an effect's states, (s,), by the effect's name.
        ports: what the forces at each port see.
        carried: the load in which something may give way, by port; the damper's is ``damper``.
    """

    def __init__(self, parts: tuple[Part, ...], p: Values) -> None:
        self.parts, self.p = parts, p
        self.balances: dict[str, Array] = {}
        self.ports: dict[str, PortSignals] = {}
        self.carried: dict[str, Load] = {}

    def _series(self, port: Port, in_damper: bool) -> Iterator[tuple[AbstractSeries, Part]]:
        for part in self.parts:
            effect = part.effect
            if isinstance(effect, AbstractSeries) and effect.port is port and effect.in_damper is in_damper:
                yield effect, part

    def way(self, port: Port, given: Float[Array, "2"], in_damper: bool = False) -> Way:
        """How everything in series at a port gives way, ``given`` from outside included.

        ``given`` are displacement and velocity [m, m/s or rad, rad/s].
        """
        way = Way(given[0], given[1])
        for _, part in self._series(port, in_damper):
            way = Way(way.displacement + part.state[0], way.velocity + part.rate[0])
        return way

    def carry(
        self, port: Port, total: Float[Array, ""], rest: Float[Array, ""], in_damper: bool = False
    ) -> None:
        """Put everything in series at a port under its load, of which ``rest`` is there in the nominal state.

        Loads are in [N], or [N m] at the link.
        """
        load = Load(total, rest)
        self.carried["damper" if in_damper else port.value] = load
        for effect, part in self._series(port, in_damper):
            self.balances[effect.name] = effect.balance(self.p, load, part.state, part.rate)

    def force(self, port: Port, signals: PortSignals, given: Float[Array, ""]) -> Float[Array, ""]:
        """Force of all effects at a port [N], ``given`` from outside included."""
        self.ports[port.value] = signals
        total = given
        for effect, state, rate in self.parts:
            if isinstance(effect, AbstractForce) and effect.port is port:
                total = total + effect.force(self.p, signals, state)
                self.balances[effect.name] = rate - effect.rate(self.p, signals, state)
        return total

    def grip(self, signals: PortSignals) -> Grip:
        """The rail's grip in both directions [N]: the sum of all shares."""
        up, down = jnp.zeros_like(signals.load), jnp.zeros_like(signals.load)
        for effect, _, _ in self.parts:
            if isinstance(effect, AbstractGrip):
                share = effect.grip(self.p, signals)
                up, down = up + share.against_up, down + share.against_down
        return Grip(up, down)

    def plate(self, inputs: Inputs) -> Road:
        """What the plate does, all faults of the recorded road added."""
        height, velocity = inputs.road
        cam = inputs.cam or Cam(jnp.zeros_like(height), jnp.zeros_like(height))
        for effect, _, _ in self.parts:
            if isinstance(effect, AbstractRoadFault):
                shift = effect.shift(self.p, inputs.road, cam)
                height, velocity = height + shift.height, velocity + shift.velocity
        return Road(height, velocity)
