"""A model solved for a figure or a table: at the dwells that were measured, and between them.

Between the dwells the road and the link move as they do in the dwells to either side, their harmonics
interpolated over frequency. As many frequencies are added as there are dwells, in the widest gaps: arrays of
the same shape need no second compilation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.rig import Rig
from savgs_ident.core.status import Status
from savgs_ident.effects.registry import EFFECTS, build_model, model_parameters
from savgs_ident.model.values import as_values
from savgs_ident.report.curves import ModelCurve, model_curve
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.harmonics import harmonics
from savgs_ident.simulate.layout import Layout, layout_for
from savgs_ident.simulate.periodic import PeriodicSettings, simulate_periodic


@dataclass(frozen=True)
class Solved:
    """Harmonics of the readings of a model under an excitation of F frequencies.

    Attributes:
        excitation: what drove the rig.
        harmonics: complex, (F, 2, orders + 1), channels as in :data:`READINGS`, SI.
        status: whether each was found, length F.
    """

    excitation: Excitation
    harmonics: NDArray[np.complex128]
    status: tuple[Status, ...]

    @property
    def frequency(self) -> NDArray[np.float64]:
        """[Hz], (F,)."""
        return np.asarray(self.excitation.frequency)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which were found, (F,)."""
        return np.array([status.ok for status in self.status], dtype=np.bool_)

    def curve(self, label: str) -> ModelCurve:
        """As a curve for a figure."""
        road = np.asarray(self.excitation.road)[:, 1]
        return model_curve(label, self.frequency, self.harmonics, road, self.ok)


_DRAWN = PeriodicSettings(adaptations=1)
"""Settings for curves: a second adaptation of the nodes moves them by less than the width of a line."""


def solve(
    rig: Rig,
    effects: Sequence[str],
    excitation: Excitation,
    orders: int,
    settings: PeriodicSettings | None = None,
    layout: Layout | None = None,
) -> Solved:
    """The periodic motions of a rig with the named effects; the rest as in :func:`simulate_periodic`."""
    table = model_parameters(rig, effects)
    p = as_values(table.as_dict())
    model = build_model(rig, effects)
    solution = simulate_periodic(model, p, excitation, settings, layout)
    return Solved(excitation, np.asarray(harmonics(model, p, solution, orders)), solution.status())


def solve_between(rig: Rig, effects: Sequence[str], known: Solved) -> Solved:
    """``known`` and as many frequencies again, see :func:`between`, as one."""
    layout = layout_for(known.frequency, _DRAWN.nodes, _DRAWN.slow)
    orders = known.harmonics.shape[2] - 1
    return joined(known, solve(rig, effects, between(known.excitation), orders, _DRAWN, layout))


def without_effects(rig: Rig, effects: Sequence[str]) -> Rig:
    """The rig with the named effects at their null: the same compiled model then shows it without them."""
    nulls = {name: value for effect in effects for name, value in EFFECTS[effect].null.items()}
    return replace(rig, parameters=model_parameters(rig, effects).with_values(nulls))


def joined(one: Solved, other: Solved) -> Solved:
    """Two solutions of one model as one, by growing frequency."""
    order = np.argsort(np.concatenate([one.frequency, other.frequency]), kind="stable")
    parts = zip(one.excitation, other.excitation, strict=True)
    excitation = Excitation(*(jnp.concatenate([a, b])[order] for a, b in parts))
    status = one.status + other.status
    return Solved(
        excitation,
        np.concatenate([one.harmonics, other.harmonics])[order],
        tuple(status[i] for i in order),
    )


def between(excitation: Excitation) -> Excitation:
    """As many frequencies again, in the widest gaps on a logarithmic axis."""
    known = np.asarray(excitation.frequency)
    added = widest_gaps(known, known.size)

    def interpolated(values: object) -> NDArray[np.complex128]:
        columns = np.asarray(values).T
        parts = [
            np.interp(added, known, column.real) + 1j * np.interp(added, known, column.imag)
            for column in columns
        ]
        return np.stack(parts, axis=1)

    return Excitation(
        jnp.asarray(added),
        jnp.asarray(interpolated(excitation.road)),
        jnp.asarray(interpolated(excitation.link)),
    )


def widest_gaps(known: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """``count`` frequencies, each in the middle of what is then the widest gap; growing.

    ``known`` (D,) grows; a single one has no gap and is followed at one per cent.
    """
    points = list(np.log(known)) if known.size > 1 else [*np.log(known), *(np.log(known) + 0.01)]
    added = []
    for _ in range(count):
        gap = int(np.argmax(np.diff(points)))
        middle = 0.5 * (points[gap] + points[gap + 1])
        points.insert(gap + 1, middle)
        added.append(middle)
    return np.asarray(np.exp(np.sort(added)))
