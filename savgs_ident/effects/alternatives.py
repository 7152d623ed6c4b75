"""Several effects with as many internal states, of which one acts.

A program that solves a plant is long to compile, and with another law, or the same law at another port, it is another
program. Which of several effects acts is a number here, so that one program serves all of them:

    shared = shared_by(catalogue.values())
    replace(plant, alternatives=(shared["mount_compliance"],))

All laws are evaluated and one is taken: the motions of a rig with one of seven take a third longer to solve.
"""

from collections.abc import Iterable, Mapping

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from savgs_ident.effects.base import InternalState
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
