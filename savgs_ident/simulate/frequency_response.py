"""The response of a model over frequency: periodic motions at many frequencies, and a sweep.

Under the inputs of measured dwells a model answers at the frequencies of the dwells. For a smooth curve it is also
solved between them: the inputs then move as in the dwells to either side, their harmonics interpolated over
frequency. As many frequencies are added as there are dwells, in the widest gaps, for arrays of the same shape
need no second compilation.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.presentation import Result
from savgs_ident.core.status import Status
from savgs_ident.core.values import as_values
from savgs_ident.plants.base import Excitation
from savgs_ident.plants.model import Model
from savgs_ident.responses.harmonic_response import peak_to_peak
from savgs_ident.simulate.mesh import Layout, layout_for
from savgs_ident.simulate.periodic import PeriodicSettings, harmonics, simulate_periodic


@dataclass(frozen=True)
class ModelCurve:
    """A model's response at F frequencies, in the C channels of its plant.

    Attributes:
        label: what the legend calls it.
        frequency: [Hz], (F,), increasing.
        transfer: complex first harmonic per unit of the first input, (F, C); NaN where not solved.
        peak_to_peak: [unit], (F, C); NaN where not solved.
    """

    label: str
    frequency: NDArray[np.float64]
    transfer: NDArray[np.complex128]
    peak_to_peak: NDArray[np.float64]


def model_curve(
    label: str,
    frequency: NDArray[np.float64],
    harmonics: NDArray[np.complex128],
    driven: NDArray[np.complex128],
    solved: NDArray[np.bool_],
) -> ModelCurve:
    """The curve of ``harmonics`` (F, C, K) under an input whose first harmonics are ``driven`` (F,).

    Frequencies that are not ``solved`` (F,) are left open.
    """
    every = np.ones(harmonics.shape, dtype=np.bool_)
    transfer = np.where(solved[:, None], harmonics[:, :, 1] / driven[:, None], np.nan)
    reach = np.where(solved[:, None], peak_to_peak(harmonics, every), np.nan)
    return ModelCurve(label, frequency, transfer, reach)


@dataclass(frozen=True)
class SimulatedResponse(Result):
    """Harmonics of the readings of a model under an excitation of F frequencies.

    Attributes:
        model: what was solved.
        excitation: what drove it.
        harmonics: complex, (F, C, orders + 1), in the channels of its plant, SI.
        status: whether each was found, length F.
    """

    presenter: ClassVar[str] = "SIMULATED_RESPONSE"

    model: Model
    excitation: Excitation
    harmonics: NDArray[np.complex128]
    status: tuple[Status, ...]

    @property
    def trusted(self) -> bool:
        """Whether all were found."""
        return bool(np.all(self.ok))

    @property
    def frequency(self) -> NDArray[np.float64]:
        """[Hz], (F,)."""
        return np.asarray(self.excitation.frequency)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which were found, (F,)."""
        return np.array([status.ok for status in self.status], dtype=np.bool_)

    @property
    def driven(self) -> NDArray[np.complex128]:
        """First harmonics of the first input [its unit], (F,)."""
        return np.asarray(self.excitation.harmonics[self.model.plant.inputs[0].name])[:, 1]

    def curve(self, label: str) -> ModelCurve:
        """As a curve for a figure."""
        return model_curve(label, self.frequency, self.harmonics, self.driven, self.ok)


_DRAWN = PeriodicSettings(adaptations=1)
"""Settings for curves: a second adaptation of the nodes moves them by less than the width of a line."""


def simulate_response(
    model: Model,
    excitation: Excitation,
    orders: int,
    settings: PeriodicSettings | None = None,
    layout: Layout | None = None,
) -> SimulatedResponse:
    """The periodic motions of a model; the rest as in :func:`simulate_periodic`."""
    plant, p = model.build(), as_values(model.table.as_dict())
    solution = simulate_periodic(plant, p, excitation, settings, layout)
    found = np.asarray(harmonics(plant, p, solution, orders))
    return SimulatedResponse(model, excitation, found, solution.status())


def simulate_between(known: SimulatedResponse) -> SimulatedResponse:
    """``known`` and as many frequencies again, see :func:`interpolate_excitation`, as one."""
    layout = layout_for(known.frequency, _DRAWN.nodes, _DRAWN.slow)
    orders = known.harmonics.shape[2] - 1
    added = interpolate_excitation(known.excitation)
    return merge_responses(known, simulate_response(known.model, added, orders, _DRAWN, layout))


def disable_effects(model: Model) -> Model:
    """The model with its effects at their null: the same compiled plant then shows it without them."""
    nulls = (model.catalogue[effect].null for effect in model.effects)
    return model.with_values({name: value for null in nulls for name, value in null.items()})


def merge_responses(one: SimulatedResponse, other: SimulatedResponse) -> SimulatedResponse:
    """Two solutions of one model as one, by growing frequency."""
    order = np.argsort(np.concatenate([one.frequency, other.frequency]), kind="stable")
    excitation = jax.tree.map(lambda a, b: jnp.concatenate([a, b])[order], one.excitation, other.excitation)
    status = one.status + other.status
    return SimulatedResponse(
        one.model,
        excitation,
        np.concatenate([one.harmonics, other.harmonics])[order],
        tuple(status[i] for i in order),
    )


def interpolate_excitation(excitation: Excitation) -> Excitation:
    """As many frequencies again, in the widest gaps on a logarithmic axis."""
    known = np.asarray(excitation.frequency)
    added = bisect_widest_gaps(known, known.size)

    def interpolated(values: object) -> NDArray[np.complex128]:
        columns = np.asarray(values).T
        parts = [
            np.interp(added, known, column.real) + 1j * np.interp(added, known, column.imag)
            for column in columns
        ]
        return np.stack(parts, axis=1)

    harmonics = {name: jnp.asarray(interpolated(values)) for name, values in excitation.harmonics.items()}
    return Excitation(jnp.asarray(added), harmonics)


def bisect_widest_gaps(known: NDArray[np.float64], count: int) -> NDArray[np.float64]:
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


LOWEST_HZ, HIGHEST_HZ, DURATION_S, RATE_HZ = 0.0, 3.0, 60.0, 500.0
"""The paper's sweep, and how densely it is written down."""


@dataclass(frozen=True)
class SimulatedSweep(Result):
    """A motion of a model under a swept input.

    Attributes:
        model: what was solved.
        time: [s], (n,).
        driven: its first input [unit of that], (n,).
        readings: of the C channels of its plant, SI, (C, n).
        status: how the integration ended.
    """

    presenter: ClassVar[str] = "SIMULATED_SWEEP"

    model: Model
    time: NDArray[np.float64]
    driven: NDArray[np.float64]
    readings: NDArray[np.float64]
    status: Status

    @property
    def trusted(self) -> bool:
        """Whether the integration ended well."""
        return self.status.ok

    @property
    def frequency(self) -> NDArray[np.float64]:
        """Frequency of the input at each instant [Hz], (n,)."""
        return LOWEST_HZ + (HIGHEST_HZ - LOWEST_HZ) * self.time / DURATION_S
