"""Where something unknown sits, and whether it only is an effect of the catalogue by another law.

A law that is learned at a place may stand alone or beside the best effect, and the two tell of different things.
Where a wrong effect does nearly the same as what is missing, a law of what it leaves still shows where that really
sits. And where an effect is right, but the rig follows another law than the catalogue's (the rise of a Stribeck
friction falls off as a bell or exponentially, a stop is straight or progressive), what it leaves sits at its own
port: to call that unknown would be to look away from what is known.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from savgs_ident.diagnose.engine.attribution import Attribution

ALONE = 0.5
"""Share of the best place's gain in log evidence that a law alone has where an effect may stand in for it."""


class Sitting(NamedTuple):
    """A law at a place, alone or beside effects: ``weight`` is its log evidence and the log prior of the effects."""

    place: str
    weight: float


def sittings_of(places: Sequence[Attribution], prior: float = 0.0) -> tuple[Sitting, ...]:
    """What is explained at places, beside effects of this log prior if there are any."""
    return tuple(Sitting(each.name, each.evidence + prior) for each in places)


def may_be_imitated(places: Sequence[Attribution], without: float) -> frozenset[str]:
    """Names of the places at which something unknown may sit that an effect elsewhere only imitates.

    A law there explains alone much of what one does anywhere; ``without`` is the log evidence of the model without
    a law. What explains little but beside the effect is not what this one stands in for.
    """
    most = max(each.evidence for each in places) - without
    return frozenset(each.name for each in places if each.evidence - without >= ALONE * most)


def by_place(sittings: Sequence[Sitting]) -> Mapping[str, float]:
    """Log weight of every place, whatever stands beside a law there; the most probable first."""
    weights: dict[str, float] = {}
    for each in sittings:
        weights[each.place] = float(np.logaddexp(weights.get(each.place, -np.inf), each.weight))
    return dict(sorted(weights.items(), key=lambda item: -item[1]))


def at_and_elsewhere(sittings: Sequence[Sitting], place: str) -> tuple[float, float]:
    """Log weights of a law at a place and at any other, each place as probable beforehand as the next."""
    weights = by_place(sittings)
    others = [weight for name, weight in weights.items() if name != place]
    shared = float(np.log(max(len(weights), 1)))
    return weights.get(place, -np.inf) - shared, float(np.logaddexp.reduce([-np.inf, *others])) - shared
