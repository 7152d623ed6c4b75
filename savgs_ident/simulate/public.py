"""What ``import savgs_ident`` offers of simulation: responses over frequency, a sweep, and tests of any plant.

Under the inputs of measured dwells a model answers at the frequencies of the dwells (:func:`simulate`). For a
smooth curve it is also solved between them (:func:`simulate_between`): the inputs then move as in the dwells to
either side, their harmonics interpolated over frequency. As many frequencies are added as there are dwells, in the
widest gaps, for arrays of the same shape need no second compilation.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.presentation import NO_ORIGIN, Origin, Progress, Result, no_progress
from savgs_ident.core.status import Status
from savgs_ident.core.values import as_values
from savgs_ident.plants.at_rest import require_return
from savgs_ident.plants.base import AbstractPlant, Excitation
from savgs_ident.plants.model import Model
from savgs_ident.plants.profiles import Constant, LinearSweep, Offset, ProfileSource, SweptAngle
from savgs_ident.recordings.recording import Campaign
from savgs_ident.responses.dwells import estimate_response
from savgs_ident.responses.harmonic_response import HarmonicResponse, unbiased_peak_to_peak
from savgs_ident.simulate.compared_tests import recorded_names
from savgs_ident.simulate.curves import ModelCurve, model_curve, programmes_of
from savgs_ident.simulate.excitation import (
    interpolate_excitation,
    measured_excitation,
    only_driven,
    resting_values,
    sine_excitation,
    typical_amplitude,
)
from savgs_ident.simulate.mesh import Layout
from savgs_ident.simulate.periodic import PeriodicSettings, layout_of, simulate_periodic
from savgs_ident.simulate.program_cache import use_persistent_cache
from savgs_ident.simulate.readings import harmonics


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

    def of_tests(self, kept: NDArray[np.intp], orders: int) -> "SimulatedResponse":
        """Of some of the tests, orders 0..``orders``."""
        return replace(
            self,
            excitation=only_driven(self.excitation, kept),
            harmonics=self.harmonics[kept, :, : orders + 1],
            status=tuple(self.status[d] for d in kept),
        )

    def curve(self, label: str) -> ModelCurve:
        """As a curve for a figure."""
        lines = programmes_of(self.model.plant, self.excitation)
        return model_curve(label, self.frequency, self.harmonics, self.driven, self.ok, lines)


_DRAWN = PeriodicSettings(adaptations=1)
"""Settings for curves: a second adaptation of the nodes moves them by less than the width of a line."""


def simulate_response(
    model: Model,
    excitation: Excitation,
    orders: int,
    settings: PeriodicSettings | None = None,
    layout: Layout | None = None,
    origin: Origin = NO_ORIGIN,
) -> SimulatedResponse:
    """The periodic motions of a model, a result of this ``origin``; the rest as in :func:`simulate_periodic`."""
    plant, p = model.build(), as_values(model.table.as_dict())
    solution = simulate_periodic(plant, p, excitation, settings, layout)
    found = np.asarray(harmonics(plant, p, solution, orders))
    return SimulatedResponse(model, excitation, found, solution.status(), origin=origin)


def simulate_between(known: SimulatedResponse) -> SimulatedResponse:
    """``known`` and as many frequencies again, see :func:`interpolate_excitation`, as one."""
    layout = layout_of(known.excitation, _DRAWN, known.model.build())
    orders = known.harmonics.shape[2] - 1
    added = interpolate_excitation(known.excitation, programmes_of(known.model.plant, known.excitation))
    return merge_responses(known, simulate_response(known.model, added, orders, _DRAWN, layout))


def disable_effects(model: Model) -> Model:
    """The model with its effects at their null: the same compiled plant then shows it without them."""
    nulls = (model.catalogue[effect].null for effect in model.effects)
    return model.with_values({name: value for null in nulls for name, value in null.items()})


def merge_responses(one: SimulatedResponse, other: SimulatedResponse) -> SimulatedResponse:
    """Two solutions of one model as one, by growing frequency."""
    order = np.argsort(np.concatenate([one.frequency, other.frequency]), kind="stable")
    # By NumPy: a program for every shape would take longer.
    excitation = jax.tree.map(
        lambda a, b: jnp.asarray(np.concatenate([a, b])[order]), one.excitation, other.excitation
    )
    status = one.status + other.status
    return SimulatedResponse(
        one.model,
        excitation,
        np.concatenate([one.harmonics, other.harmonics])[order],
        tuple(status[i] for i in order),
    )


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


DWELLS = (
    0.5, 0.8, 1.1, 1.4, 1.6, 1.75, 1.85, 1.95, 2.0, 2.05, 2.15, 2.25, 2.3, 2.35, 2.4, 2.45, 2.55, 2.65, 2.75,
    2.85, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0,
)  # fmt: skip
"""The frequencies of the shipped campaign's dwells [Hz]."""


def simulate(
    model: Model,
    frequency: Sequence[float] = (),
    campaign: Campaign | None = None,
    orders: int = 15,
    progress: Progress = no_progress,
    *,
    amplitude: float | None = None,
    levels: Mapping[str, float] = MappingProxyType({}),
) -> SimulatedResponse:
    """The periodic motions of a model under a sine in its plant's first input, the others at rest.

    Args:
        model: the plant with its effects.
        frequency: of the tests [Hz]; 28 from 0.5 to 6 if empty.
        campaign: all inputs as in its dwells instead.
        orders: highest harmonic order.
        progress: called with a sentence on what is being done.
        amplitude: of the first input [its unit]; if left out, what the plant declares: half the cam's stroke for the
            rig, what moves a coordinate by its typical size for others.
        levels: by how much further inputs are held above rest [their units], by name.

    A motion that was not found has its status in the result. Raises :class:`InputError` for a frequency or an
    amplitude that is not above zero, for ``orders`` below 1, where a campaign is given besides a frequency or an
    amplitude, and where it cannot be used; and for a plant that no force brings back to where it was.
    """
    use_persistent_cache()
    if orders < 1:
        raise InputError(f"orders is {orders}", source="orders", remedy="ask for at least order 1")
    excitation = _excitation(model, frequency, campaign, orders, amplitude, levels)
    progress(f"solving {excitation.frequency.shape[0]} periodic motions")
    found = simulate_response(model, excitation, orders, origin=model.origin(campaign))
    if not found.ok.any():
        require_return(model.build(), as_values(model.table.as_dict()))
    return found


def simulate_sweep(
    model: Model, progress: Progress = no_progress, *, amplitude: float | None = None
) -> SimulatedSweep:
    """A sweep of the plant's first input from 0 to 3 Hz in 60 s, from standstill, the others at rest.

    ``amplitude`` as in :func:`simulate`. Raises :class:`InputError` for one that is not above zero.
    """
    # Its integrator takes a second to import, which no other command waits for.
    from savgs_ident.simulate.transient import simulate_transient

    use_persistent_cache()
    progress("integrating a sweep of 60 s")
    table, size = model.table, _amplitude(model, amplitude)
    level, *others = resting_values(model.plant, table).values()
    time = np.linspace(0.0, DURATION_S, round(DURATION_S * RATE_HZ) + 1)
    sweep = LinearSweep(size, LOWEST_HZ, HIGHEST_HZ, DURATION_S)
    driven = Offset(sweep, level) if model.plant.inputs[0].rest else sweep
    # A sine that begins upwards is a cosine a quarter of a turn later: laws of a cam count from where it is highest.
    turning = SweptAngle(LOWEST_HZ, HIGHEST_HZ, DURATION_S, -np.pi / 2.0)
    source = ProfileSource((driven, *(Constant(rest) for rest in others)), turning)
    solution = simulate_transient(model.build(), as_values(table.as_dict()), source, time)
    readings = np.stack([np.asarray(each) for each in solution.readings])
    moved = np.asarray(jax.lax.map(driven.value, solution.times))
    return SimulatedSweep(model, time, moved, readings, solution.status(), origin=model.origin())


def simulate_dwells(
    model: Model,
    frequency: Sequence[float],
    amplitudes: Mapping[str, float],
    noise: Mapping[str, float],
    *,
    samples: int = 4000,
    orders: int = 9,
    seed: int = 1,
    levels: Mapping[str, float] = MappingProxyType({}),
    progress: Progress = no_progress,
) -> HarmonicResponse:
    """Harmonic tests of a plant as they would be measured: what :func:`fit`, :func:`sample`, :func:`diagnose` take.

    Args:
        model: the plant with its effects.
        frequency: of the tests [Hz].
        amplitudes: of the plant's inputs [unit of each], by name; the others rest.
        noise: standard deviation of one sample of each of the plant's channels [unit of each], by name.
        samples: samples of each channel in a test.
        orders: highest harmonic order.
        seed: of all random numbers.
        levels: by how much inputs are held above rest [their units], by name.
        progress: called with a sentence on what is being done.

    Raises :class:`InputError` for names that the plant does not have, a channel without noise, a frequency that is
    not above zero, and a test without periodic motion.
    """
    use_persistent_cache()
    plant, table = model.build(), model.table
    _check_names("input", [*amplitudes, *levels], [each.name for each in plant.inputs])
    _check_names("channel", noise, [each.name for each in plant.channels])
    for each in plant.channels:
        if not noise.get(each.name, 0.0) > 0.0:
            raise InputError(f"channel '{each.name}' has no noise", remedy="give its standard deviation")
    hertz = np.unique(_checked(frequency))
    every = {each.name: amplitudes.get(each.name, 0.0) for each in plant.inputs}
    excitation, p = sine_excitation(plant, table, hertz, every, levels), as_values(table.as_dict())
    progress(f"solving {hertz.size} periodic motions")
    solution = simulate_periodic(plant, p, excitation)
    lost = [f"{f:g} Hz" for f, status in zip(hertz, solution.status(), strict=True) if not status.ok]
    if lost:
        raise InputError("there is no periodic motion at " + ", ".join(lost), remedy="change the amplitudes")
    true = np.zeros((hertz.size, len(recorded_names(plant)), orders + 1), complex)
    for c, given in enumerate(plant.inputs):
        true[:, c, :2] = np.asarray(excitation.harmonics[given.name])
    true[:, len(plant.inputs) :] = np.asarray(harmonics(plant, p, solution, orders))
    return _measured(plant, hertz, true, noise, samples, np.random.default_rng(seed))


def _measured(
    plant: AbstractPlant,
    hertz: NDArray[np.float64],
    true: NDArray[np.complex128],
    noise: Mapping[str, float],
    samples: int,
    random: np.random.Generator,
) -> HarmonicResponse:
    """What sensors with ``noise`` [unit of each channel] show of ``true`` harmonics (D, C, K) [unit of each]."""
    names = recorded_names(plant)
    sample_sd = np.array([noise.get(name, 0.0) for name in names])
    # A sine that is fitted to n samples is known to the noise times the square root of 2 / n in each part.
    sd = sample_sd * np.sqrt(2.0 / samples)
    found = true + sd[:, None] * (random.standard_normal((2, *true.shape)).T @ [1.0, 1j]).T
    found[:, :, 0] = found[:, :, 0].real
    covariance = np.broadcast_to((sd**2)[:, None, None, None] * np.eye(2), (*found.shape, 2, 2)).copy()
    valid = np.ones(found.shape, np.bool_)
    peaks = [unbiased_peak_to_peak(*each) for each in zip(found, covariance, valid, strict=True)]
    return HarmonicResponse(
        tests=tuple(f"dwell_{f:g}Hz" for f in hertz),
        channels=names,
        frequency=hertz,
        frequency_sd=np.zeros(hertz.size),
        harmonics=found,
        covariance=covariance,
        valid=valid,
        peak_to_peak=np.stack([each[0] for each in peaks]),
        peak_to_peak_sd=np.stack([each[1] for each in peaks]),
        noise_sd=np.tile(sample_sd, (hertz.size, 1)),
        periods=np.full(hertz.size, 10),
    )


def _check_names(what: str, given: Iterable[str], known: Sequence[str]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"the plant has no {what} '{name}'", remedy="choose among: " + ", ".join(known))


def _checked(frequency: Sequence[float]) -> Sequence[float]:
    for value in frequency:
        if not 0.0 < value < np.inf:
            raise InputError(f"{value:g} Hz is no frequency", remedy="give a frequency above 0 Hz")
    return frequency


def _amplitude(model: Model, given: float | None) -> float:
    """The amplitude of the first input [its unit]."""
    if given is None:
        return typical_amplitude(model.plant, model.table)
    if not 0.0 < given < np.inf:
        raise InputError(f"an amplitude of {given:g} moves nothing", remedy="give one above zero")
    return given


def _excitation(
    model: Model,
    frequency: Sequence[float],
    campaign: Campaign | None,
    orders: int,
    amplitude: float | None,
    levels: Mapping[str, float],
) -> Excitation:
    driven = model.plant.inputs[0].name
    _check_names("input", levels, [each.name for each in model.plant.inputs[1:]])
    if campaign is None:
        hertz = np.unique(_checked(frequency) if len(frequency) else DWELLS)
        size = _amplitude(model, amplitude)
        return sine_excitation(model.plant, model.table, hertz, {driven: size}, levels)
    if len(frequency) or amplitude is not None or levels:
        raise InputError(
            "a campaign has frequencies, amplitudes and levels of its own",
            source=campaign.source,
            remedy="give a campaign, or a frequency, an amplitude and levels",
        )
    return measured_excitation(model.plant, estimate_response(campaign, orders, driven), model.table)
