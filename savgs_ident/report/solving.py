"""A model solved for a figure or a table: at the dwells that were measured, and between them.

Between the dwells the road and the link move as they do in the dwells to either side, their harmonics
interpolated over frequency. As many frequencies are added as there are dwells, in the widest gaps: arrays of
the same shape need no second compilation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.rig import Rig
from savgs_ident.core.status import Status
from savgs_ident.effects.registry import build_model, model_parameters
from savgs_ident.report.curves import ModelCurve, model_curve
from savgs_ident.responses.harmonic_response import HarmonicResponse
from savgs_ident.simulate.excitation import Excitation
from savgs_ident.simulate.periodic import harmonics, simulate_periodic

Told = Callable[[str], None]
"""Is told what is being done."""


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


def solve(rig: Rig, effects: Sequence[str], excitation: Excitation, orders: int) -> Solved:
    """The periodic motions of a rig with the named effects."""
    table = model_parameters(rig, effects)
    p = {name: jnp.asarray(value) for name, value in table.as_dict().items()}
    solution = simulate_periodic(build_model(rig, effects), p, excitation)
    return Solved(excitation, np.asarray(harmonics(p, solution, orders)), solution.status())


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
    return np.exp(np.sort(added))


def measured_excitation(response: HarmonicResponse, rig: Rig) -> Excitation:
    """The road and the link of the dwells as they were recorded; a link that was not stands still.

    Raises :class:`InputError` if the road was not recorded.
    """
    if "road_height" not in response.channels:
        raise InputError(
            "the road was not recorded", channel="road_height", remedy="map the road channel in channels.toml"
        )
    road = response.harmonics[:, response.channel("road_height")]
    if "link_angle" in response.channels:
        link = response.harmonics[:, response.channel("link_angle")]
    else:
        link = np.zeros_like(road)
        link[:, 0] = rig.parameters["psi_nominal"].value
    return Excitation(jnp.asarray(response.frequency), jnp.asarray(road), jnp.asarray(link))
