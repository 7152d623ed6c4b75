"""Laws of force that the positioner's baseline has or may lack, each a term of the engine.

A law is linear in its amplitudes: force = sum of amplitude x basis, where the basis depends on the motion and on
the law's shapes. Signs are those of what resists: the drive's force is what all laws add up to.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from savgs_ident.diagnosis.positioner.preparation import Motion
from savgs_ident.inference.observations import Term
from savgs_ident.inference.prior import Linear, Logarithmic

Shapes = Mapping[str, Any]
"""Shapes by name, SI; complex ones where slopes are asked for."""

Basis = Callable[[Motion, Shapes], NDArray[Any]]
"""Force per unit of every amplitude, (amplitudes, n)."""

CREEP = 1e-4
"""Velocity [m/s] at which dry friction has three quarters of its size: a sign, far below what a sample resolves."""

LEAST_PITCH, LARGEST_PITCH = 1.25e-3, 2.5e-2
"""Pitches at which a cogging is looked for [m]."""

SHAPE = 0.7
"""Width of the logarithm of what shapes a law."""

_STEP = 1e-30


@dataclass(frozen=True)
class Law:
    """A term and what it does.

    Attributes:
        term: its name, place and coordinates.
        basis: force per unit of its amplitudes.
        refines: name of the law that it is a detail of; empty for a law of its own.
    """

    term: Term
    basis: Basis
    refines: str = ""

    def shapes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Its shapes among ``values`` [SI], typical where not given."""
        return {each.name: values.get(each.name, each.centre) for each in self.term.shapes}

    def force(self, motion: Motion, values: Mapping[str, float]) -> NDArray[np.float64]:
        """The force [N] along a motion, (n,)."""
        sizes = np.array([values[each.name] for each in self.term.amplitudes])
        return np.asarray(sizes @ self.basis(motion, self.shapes(values)))

    def slope(self, motion: Motion, values: Mapping[str, float], name: str) -> NDArray[np.float64]:
        """Slope of the force in one of its parameters [N per unit], (n,).

        That in a shape by a complex step, to rounding.
        """
        for place, each in enumerate(self.term.amplitudes):
            if each.name == name:
                return np.asarray(self.basis(motion, self.shapes(values))[place])
        aside = self.shapes(values) | {name: values[name] + 1j * _STEP * values[name]}
        sizes = np.array([values[each.name] for each in self.term.amplitudes])
        return np.asarray((sizes @ self.basis(motion, aside)).imag / (_STEP * values[name]))


def _sign(motion: Motion) -> NDArray[np.float64]:
    return np.tanh(motion.velocity / CREEP)


def _inertia(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return motion.acceleration[None]


def _viscous(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return motion.velocity[None]


def _coulomb(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return _sign(motion)[None]


def _offset(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return np.ones((1, motion.velocity.size))


def _coulomb_asymmetry(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return np.abs(_sign(motion))[None]


def _viscous_asymmetry(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return np.abs(motion.velocity)[None]


def _stribeck(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    fading = np.exp(-((motion.velocity / shapes["stribeck_velocity"]) ** 2))
    return np.asarray(_sign(motion) * fading)[None]


def _quadratic(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return (motion.velocity * np.abs(motion.velocity))[None]


def _spring(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    return motion.position[None]


def _cogging(motion: Motion, shapes: Shapes) -> NDArray[Any]:
    angle = 2.0 * np.pi * motion.position / shapes["cogging_pitch"]
    return np.stack([np.sin(angle), np.cos(angle)])


def _amplitude(name: str, unit: str, size: float, lower: float = -np.inf) -> Linear:
    return Linear(name, unit, 0.0, size, lower)


INERTIA = Law(Term("inertia", "carriage", (Logarithmic("mass", "kg", 100.0, 1.0),)), _inertia)
"""M a. Where nothing is known, the prior is about the round 100 kg, to a factor of e."""

VISCOUS = Law(Term("viscous", "guide", (Logarithmic("viscous_friction", "N s/m", 100.0, 1.0),)), _viscous)
"""Fv v, about the round 100 N s/m."""

BASELINE = (INERTIA, VISCOUS)
"""Laws of the baseline."""

CATALOGUE = (
    Law(Term("coulomb", "guide", (_amplitude("coulomb_friction", "N", 20.0, 0.0),)), _coulomb),
    Law(Term("offset", "drive", (_amplitude("force_offset", "N", 5.0),)), _offset),
    Law(Term("quadratic", "guide", (_amplitude("quadratic_drag", "N s^2/m^2", 500.0),)), _quadratic),
    Law(Term("spring", "screw", (_amplitude("spring_rate", "N/m", 20.0),)), _spring),
    Law(
        Term("coulomb_asymmetry", "guide", (_amplitude("coulomb_difference", "N", 5.0),)),
        _coulomb_asymmetry,
        refines="coulomb",
    ),
    Law(
        Term("viscous_asymmetry", "guide", (_amplitude("viscous_difference", "N s/m", 50.0),)),
        _viscous_asymmetry,
        refines="viscous",
    ),
    Law(
        Term(
            "stribeck",
            "guide",
            (_amplitude("stribeck_friction", "N", 5.0, 0.0),),
            (Logarithmic("stribeck_velocity", "m/s", 0.02, SHAPE, 2e-3, 0.1),),
        ),
        _stribeck,
        refines="coulomb",
    ),
    Law(
        Term(
            "cogging",
            "motor",
            (_amplitude("cogging_sine", "N", 2.0), _amplitude("cogging_cosine", "N", 2.0)),
            (Logarithmic("cogging_pitch", "m", 5e-3, SHAPE, LEAST_PITCH, LARGEST_PITCH),),
        ),
        _cogging,
        refines="inertia",
    ),
)
"""Laws that may be missing. Amplitudes are normal about nothing, with sizes that are usual for such an axis.

Dry friction, an offset, drag and a spring stand in every textbook and come first; what refines a law is a detail
that is asked for once these are settled, and only where the law itself is there.
"""
