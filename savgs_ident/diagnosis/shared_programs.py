"""Models whose programs serve several hypotheses, so that fewer have to be compiled.

Effects with as many internal states stand side by side in one model (:mod:`savgs_ident.effects.alternatives`), and a
learned force may act at any force port in another.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from savgs_ident.core.values import Values
from savgs_ident.effects.alternatives import Alternatives, shared_by
from savgs_ident.effects.effect import Effect
from savgs_ident.effects.learned import LearnedForce, SharedForce, shared_force
from savgs_ident.plants.base import AbstractPlant
from savgs_ident.simulate.program_cache import placed


@dataclass(frozen=True)
class SharedPrograms:
    """Models of a baseline with more of a catalogue.

    Attributes:
        model: the baseline, with all effects without states.
        catalogue: all effects by name.
        baseline: names of those that the baseline has.
    """

    model: AbstractPlant
    catalogue: Mapping[str, Effect]
    baseline: tuple[str, ...]

    def with_effects(self, terms: Sequence[str]) -> AbstractPlant | None:
        """The model with ``terms`` among others with as many states; None where one of them has a program alone."""
        with_states = [name for name in self._added(terms) if self.catalogue[name].states]
        shared = [self._alternatives[name] for name in with_states if name in self._alternatives]
        if not shared or len(shared) < len(with_states):
            return None
        return replace(self.model, alternatives=tuple(shared))

    def with_force(self, terms: Sequence[str], p: Values) -> tuple[AbstractPlant, Values] | None:
        """The model with a learned force at one of its ports, and its parameters, SI.

        None where that is not all that ``terms`` add.
        """
        force = self._force(terms)
        return force and (replace(self.model, alternatives=(force.law,)), force.values(p))

    def names(self, terms: Sequence[str], names: Sequence[str]) -> Sequence[str]:
        """The ``names`` of parameters as the model has them that is solved with ``terms``."""
        force = self._force(terms)
        return names if force is None else force.names(names)

    def _added(self, terms: Sequence[str]) -> list[str]:
        return [name for name in terms if name not in self.baseline]

    def _force(self, terms: Sequence[str]) -> SharedForce | None:
        added = self._added(terms)
        return self._forces.get(added[0]) if len(added) == 1 else None

    @cached_property
    def _forces(self) -> Mapping[str, SharedForce]:
        """The learned forces of the catalogue."""
        learned = {name: each for name, each in self.catalogue.items() if isinstance(each.law, LearnedForce)}
        return placed({name: shared_force(each, self.model.scaled_ports) for name, each in learned.items()})

    @cached_property
    def _alternatives(self) -> Mapping[str, Alternatives]:
        """Effects that the baseline does not have, each among others with as many states."""
        absent = (each for name, each in self.catalogue.items() if name not in self.baseline)
        return {name: each for name, each in placed(shared_by(absent)).items() if len(each.effects) > 1}
