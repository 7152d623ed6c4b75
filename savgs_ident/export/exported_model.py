"""What is exported: an identified rig with all that is known about it.

Every export takes one :class:`ExportedModel` and a folder, and writes files there. What a format can hold of the
posterior and of a diagnosis travels along.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.rig import Rig
from savgs_ident.effects.registry import model_parameters
from savgs_ident.export.equations import Equations, equations_of


@dataclass(frozen=True)
class ExportedModel:
    """An identified rig on its way out.

    Attributes:
        rig: the rig, as drawn or identified.
        effects: names of what acts in the model besides the frictionless rig, a diagnosed effect included.
        samples: draws of a posterior by parameter, each (n,), SI; empty without a posterior.
        diagnosis: the verdict of a diagnosis as its JSON says it; empty without one.
    """

    rig: Rig
    effects: tuple[str, ...]
    samples: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    diagnosis: Mapping[str, object] = field(default_factory=dict)

    @property
    def table(self) -> ParameterTable:
        """All parameters of the model."""
        return model_parameters(self.rig, self.effects)

    @property
    def equations(self) -> Equations:
        """The model's equations."""
        return equations_of(self.rig, self.effects)

    @property
    def covariance(self) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Names and covariance [products of their units], (n, n), of the estimated parameters.

        Empty for a drawing.
        """
        carried = self.rig.provenance.get("covariance")
        if not isinstance(carried, Mapping):
            return (), np.zeros((0, 0))
        return tuple(carried["names"]), np.array(carried["matrix"], dtype=np.float64)


@dataclass(frozen=True)
class Exporter:
    """A format: what it is in words, and the function that writes it and says which files it made."""

    about: str
    write: Callable[[ExportedModel, Path], tuple[Path, ...]]
