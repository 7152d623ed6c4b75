"""Several effects with as many internal states, of which one acts.

A program that solves a plant is long to compile, and with another law, or the same law at another port, it is another
program. Which of several effects acts is a number here, so that one program serves all of them:

    shared = shared_by(catalogue.values())
    replace(plant, alternatives=(shared["mount_compliance"],))

All laws are evaluated and one is taken: the motions of a rig with one of seven take a third longer to solve. For a
force law of many functions that is too much: where it may act at several ports, it is evaluated once, by what is seen
at the port where it does (:class:`AtOnePort`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Bool, Float, Int

from savgs_ident.core.values import Values
from savgs_ident.effects.base import FrictionLimit, InternalState, Port, PortSignals
from savgs_ident.effects.effect import Effect


class Alternatives(eqx.Module):
    """Effects of which one acts.

    Attributes:
        effects: with as many internal states each, and no share of what a contact holds.
        place: of the one that acts, among them.
    """

    effects: tuple[Effect, ...]
    place: Int[Array, ""]

    def acts(self, effect: Effect) -> Bool[Array, ""]:
        """Whether it is this one that acts."""
        return self.place == self.effects.index(effect)

    @property
    def acting(self) -> Effect:
        """The one that acts, outside of a program."""
        return self.effects[int(self.place)]

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states of the one that acts, with its scales, under names of none of the effects."""
        alike = zip(*(each.states for each in self.effects), strict=True)
        return tuple(
            InternalState(
                f"state_{number}",
                "",
                jnp.asarray([each.scale for each in some])[self.place],
                jnp.asarray([each.slips for each in some])[self.place],
            )
            for number, some in enumerate(alike, start=1)
        )


class Push(NamedTuple):
    """What a force law does at a port: its force [N], its share of what a contact holds, the rates of its states."""

    force: Float[Array, ""]
    limit: FrictionLimit
    rate: Float[Array, " s"]


class AtOnePort(eqx.Module):
    """A force law at one of several ports.

    What a port sees does not depend on the force at this port: the plant without the law says what that is.

    Attributes:
        effect: the law at a port that is none of the plant's, with numbers that do not tell where it acts. It says
            its force in the sense of the port where it does.
        ports: where it may act.
        place: of the one where it does, among them.
    """

    effect: Effect
    ports: tuple[Port, ...] = eqx.field(static=True)
    place: Int[Array, ""]

    @property
    def acting(self) -> Effect:
        """The effect at the port where it acts, outside of a program."""
        return replace(self.effect, port=self.ports[int(self.place)])

    @property
    def states(self) -> tuple[InternalState, ...]:
        """Internal states, with the scales of the port where it acts."""
        several = zip(*(self.effect.law.states(port) for port in self.ports), strict=True)
        return tuple(
            some[0]._replace(scale=jnp.asarray([each.scale for each in some])[self.place]) for some in several
        )

    def push(
        self, p: Values, signals: Mapping[str, PortSignals], state: Float[Array, " s"]
    ) -> dict[str, Push]:
        """What it does, by the names of the ports: a force at one of them, none at the others.

        ``signals`` are what the ports see without it, by their names [SI].
        """
        seen = zip(*(signals[port.name] for port in self.ports), strict=True)
        there = PortSignals(*(lax.select_n(self.place, *each) for each in seen))
        numbers = {name: p[name] for _, name in self.effect.numbers if isinstance(name, str)}
        # What a program does on a condition it does once; else it would do it anew for each that uses the force.
        found = lax.cond(self.place >= 0, partial(_act, self.effect), _nothing, numbers, there, state)
        pushes = dict[str, Push]()
        for place, port in enumerate(self.ports):
            given = found.force, *found.limit
            force, up, down = (jnp.where(self.place == place, each, 0.0) for each in given)
            pushes[port.name] = Push(force, FrictionLimit(up, down), found.rate)
        return pushes


def _act(effect: Effect, p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Push:
    force, limit = effect.force(p, signals, state), effect.friction_limit(p, signals)
    return Push(force, limit, effect.rate(p, signals, state))


def _nothing(p: Values, signals: PortSignals, state: Float[Array, " s"]) -> Push:
    """No force."""
    none = jnp.zeros_like(signals.displacement)
    return Push(none, FrictionLimit(none, none), jnp.zeros_like(state))


def shared_by(effects: Iterable[Effect]) -> Mapping[str, Alternatives]:
    """For each effect with states, by its name, all with as many states as it, of which it acts.

    None for those that have a share of what a contact holds: the contact's bristle is of one model or another.
    """
    alike: dict[int, list[Effect]] = {}
    for each in effects:
        if each.states and not each.loads_contact:
            alike.setdefault(len(each.states), []).append(each)
    return {
        each.name: Alternatives(tuple(some), jnp.asarray(place))
        for some in alike.values()
        for place, each in enumerate(some)
    }
