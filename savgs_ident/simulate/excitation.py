"""What drives a plant in periodic tests: the harmonics of its inputs, as they are given or as they were recorded.

At the nodes of a mesh they are summed, or read from a table where there are many of them.
"""

from collections.abc import Mapping
from math import ceil, log2
from types import MappingProxyType
from typing import Any, cast

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import ParameterTable
from savgs_ident.core.values import as_values
from savgs_ident.effects.base import Fundamental, InputSignal
from savgs_ident.plants.at_rest import carried_along
from savgs_ident.plants.base import AbstractPlant, Excitation, Input, input_size
from savgs_ident.responses.harmonic_response import ComparedPart, HarmonicResponse
from savgs_ident.simulate.mesh import Layout, Mesh, over_dwells, waves

SUMMED = 64
"""Most harmonics that are summed one by one at every node."""

SIGNIFICANT = 4.0
"""Harmonics below this many standard deviations are taken as noise and not imposed."""


def signals_at(
    plant: AbstractPlant, excitation: Excitation, mesh: Mesh
) -> tuple[tuple[InputSignal, ...], Fundamental]:
    """Value and rate of every input at the nodes of a mesh, (P,) each, and the angle of the test.

    Nothing turns in a window of a test that does not repeat.
    """
    dwell, phase = mesh.layout.dwell, jnp.asarray(mesh.phase)
    omega = 2.0 * jnp.pi * excitation.frequency[dwell]
    harmonics = [excitation.harmonics[each.name] for each in plant.inputs]
    first = harmonics[0]
    offset = jnp.angle(first[:, 1]) if first.shape[1] > 1 else jnp.zeros(())
    turns = jnp.asarray(True if excitation.part is None else excitation.part.repeats)
    angle = phase + jnp.broadcast_to(offset, excitation.frequency.shape)[dwell]
    turning = jnp.broadcast_to(turns, excitation.frequency.shape)[dwell]
    fundamental = Fundamental(jnp.where(turning, angle, 0.0), jnp.where(turning, omega, 0.0))
    signals = [
        _synthesise(each[dwell], omega, phase)
        if each.shape[1] <= SUMMED
        else _interpolate(each, dwell, omega, phase)
        for each in harmonics
    ]
    return tuple(InputSignal(*each) for each in signals), fundamental


def inputs_at(plant: AbstractPlant, excitation: Excitation, mesh: Mesh) -> Any:
    """The plant's inputs at the nodes of a mesh; every field is of shape (P,)."""
    return plant.drive(*signals_at(plant, excitation, mesh))


def _synthesise(harmonics: Array, omega: Array, phase: Array) -> tuple[Array, Array]:
    """Value and time derivative at the nodes, both (P,), from harmonics (P, K)."""
    order = jnp.arange(harmonics.shape[1])
    cosines, sines = waves(phase, harmonics.shape[1] - 1)
    real, imaginary = harmonics.real.T, harmonics.imag.T
    value = jnp.sum(real * cosines - imaginary * sines, axis=0)
    rate = -jnp.sum(order[:, None] * (real * sines + imaginary * cosines), axis=0) * omega
    return value, rate


def _interpolate(
    harmonics: Array, dwell: NDArray[np.intp], omega: Array, phase: Array
) -> tuple[Array, Array]:
    """The same from the harmonics (D, K) of each test, by cubics through a table of a period and its slopes.

    With eight instants to the shortest wave they are off by 1e-3 of it, and by 1e-5 of one three times as long.
    """
    count = 2 ** ceil(log2(8 * harmonics.shape[1]))
    spectrum = 0.5 * count * harmonics.at[:, 0].multiply(2.0)
    turned = 1j * jnp.arange(harmonics.shape[1])
    value, rate, second = (jnp.fft.irfft(spectrum * turned**power, count) for power in range(3))
    place = phase * (count / (2.0 * np.pi))
    before = jnp.floor(place).astype(jnp.int64)
    share, width = place - before, 2.0 * np.pi / count

    def between(level: Array, slope: Array) -> Array:
        (y0, y1), (d0, d1) = (
            [each[dwell, (before + further) % count] for further in (0, 1)] for each in (level, slope)
        )
        rise = y1 - y0 - width * d0
        bend = width * (d1 - d0)
        return y0 + share * (width * d0 + share * (3.0 * rise - bend + share * (bend - 2.0 * rise)))

    return between(value, rate), between(rate, second) * omega


def motion_scale(
    model: AbstractPlant, signals: tuple[InputSignal, ...], excitation: Excitation, layout: Layout
) -> Float[Array, "m P"]:
    """A typical size of every state [its unit] in each test, from the amplitudes of its inputs.

    Where a test begins moving, from the sizes of the plant besides: inputs may rest there.
    """
    moving = 0.0 if excitation.part is None else excitation.part.begins_moving
    amplitudes, speeds = (
        [_amplitude(each, layout) for each in listed] for listed in zip(*signals, strict=True)
    )
    sizes = [
        sum(
            abs(given.moves[i]) * amplitude for given, amplitude in zip(model.inputs, amplitudes, strict=True)
        )
        + moving * each.size
        for i, each in enumerate(model.coordinates)
    ]
    rates = [
        sum(abs(given.moves[i]) * amplitude for given, amplitude in zip(model.inputs, speeds, strict=True))
        + moving * each.rate_size
        for i, each in enumerate(model.coordinates)
    ]
    states = [jnp.full_like(excitation.frequency, state.scale) for state in model.states]
    return jnp.stack([*sizes, *rates, *states])[:, layout.dwell]


def _amplitude(values: Float[Array, " P"], layout: Layout) -> Float[Array, " D"]:
    return (over_dwells(values, layout) + over_dwells(-values, layout)) / 2.0


def typical_amplitude(plant: AbstractPlant | type[AbstractPlant], table: ParameterTable) -> float:
    """Amplitude of the first input in a test [its unit]: half of its stroke, where it declares one.

    Otherwise the largest with which no coordinate moves by more than its typical size.
    """
    driven = plant.inputs[0]
    return table[driven.stroke].value / 2.0 if driven.stroke else input_size(plant, driven)


def typical_levels(plant: AbstractPlant, table: ParameterTable) -> dict[str, float]:
    """How far from rest further inputs are typically held [their units], by name, of those whose mean counts."""
    counting = zip(plant.inputs, means_that_count(plant, table), strict=True)
    return {each.name: input_size(plant, each) for each, counts in list(counting)[1:] if counts}


def resting_values(plant: AbstractPlant | type[AbstractPlant], table: ParameterTable) -> dict[str, float]:
    """What each input is at rest [its unit], by its name."""
    return {each.name: table[each.rest].value if each.rest else 0.0 for each in plant.inputs}


def sine_excitation(
    plant: AbstractPlant | type[AbstractPlant],
    table: ParameterTable,
    frequency: NDArray[np.float64],
    amplitudes: Mapping[str, float],
    levels: Mapping[str, float] = MappingProxyType({}),
) -> Excitation:
    """Sines of ``amplitudes`` [unit of each input], by name, at D frequencies [Hz], about rest; other inputs rest.

    ``levels`` are by how much inputs are above rest in the mean [their units].
    """
    harmonics = {}
    for name, rest in resting_values(plant, table).items():
        mean = rest + levels.get(name, 0.0)
        row = [mean, amplitudes[name]] if name in amplitudes else [mean]
        harmonics[name] = jnp.asarray(np.tile(np.array(row, np.complex128), (frequency.size, 1)))
    return Excitation(jnp.asarray(frequency), harmonics)


def interpolate_excitation(excitation: Excitation, programme: NDArray[np.intp]) -> Excitation:
    """As many frequencies again, in the widest gaps on a logarithmic axis of each ``programme`` (D,); growing."""
    every = np.asarray(excitation.frequency)
    lines = [np.flatnonzero(programme == each) for each in np.unique(programme)]
    added = [bisect_widest_gaps(every[line], line.size) for line in lines]
    order = np.argsort(np.concatenate(added), kind="stable")

    def interpolated(values: object) -> NDArray[np.complex128]:
        table = np.asarray(values)
        parts = [
            np.stack(
                [
                    np.interp(new, every[line], column.real) + 1j * np.interp(new, every[line], column.imag)
                    for column in table[line].T
                ],
                axis=1,
            )
            for line, new in zip(lines, added, strict=True)
        ]
        return np.concatenate(parts)[order]

    harmonics = {name: jnp.asarray(interpolated(values)) for name, values in excitation.harmonics.items()}
    return Excitation(jnp.asarray(np.concatenate(added)[order]), harmonics)


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


def measured_excitation(
    plant: AbstractPlant | type[AbstractPlant], measured: HarmonicResponse, table: ParameterTable
) -> Excitation:
    """The inputs of the tests as they were recorded, harmonics that stand out of their noise.

    An input that was not recorded, and need not be, rests at the value that ``table`` has for it. Raises
    :class:`InputError` if an input that is required was not recorded.
    """
    kept = means_that_count(plant, table)
    harmonics = {
        each.name: jnp.asarray(_recorded(each, mean, measured, table))
        for each, mean in zip(plant.inputs, kept, strict=True)
    }
    part = None if measured.part is None else cast(Any, ComparedPart)(*map(jnp.asarray, measured.part))
    begun = None if measured.initial_states is None else jnp.asarray(measured.initial_states.states)
    return Excitation(jnp.asarray(measured.frequency), harmonics, part, begun)


def means_that_count(plant: AbstractPlant | type[AbstractPlant], table: ParameterTable) -> tuple[bool, ...]:
    """Of each input whether its mean counts: whether the plant does not move along with it as a whole."""
    said = [each.keeps_mean for each in plant.inputs]
    if None in said and isinstance(plant, AbstractPlant):
        along = carried_along(plant, as_values(table.as_dict()))
        said = [not each if mean is None else mean for mean, each in zip(said, along, strict=True)]
    return tuple(mean is True for mean in said)


def only_driven(excitation: Excitation, kept: NDArray[np.intp]) -> Excitation:
    """What drives the plant in some of the tests; as in dwells where they all are."""
    if excitation.part is None:
        harmonics = {name: each[kept] for name, each in excitation.harmonics.items()}
        return Excitation(excitation.frequency[kept], harmonics)
    part = ComparedPart(*(np.asarray(each)[kept] for each in excitation.part))
    harmonics = {name: each[kept] for name, each in excitation.harmonics.items()}
    if part.repeats.all():
        few = {name: _that_move(each) for name, each in harmonics.items()}
        return Excitation(excitation.frequency[kept], few)
    begun = None if excitation.initial_states is None else excitation.initial_states[kept]
    windows = cast(Any, ComparedPart)(*map(jnp.asarray, part))
    return Excitation(excitation.frequency[kept], harmonics, windows, begun)


def _that_move(harmonics: Array) -> Array:
    """Up to the highest order (D, K) that is not zero in every test: windows have many more than dwells."""
    highest = np.flatnonzero(np.asarray(harmonics).any(axis=0)).max(initial=0)
    return harmonics[:, : max(int(highest), 1) + 1]


def _recorded(
    given: Input, keeps_mean: bool, measured: HarmonicResponse, table: ParameterTable
) -> NDArray[np.complex128]:
    rest = table[given.rest].value if given.rest else 0.0
    if given.name not in measured.channels:
        if given.required:
            raise InputError(
                f"the {given.about} was not recorded",
                channel=given.name,
                remedy="map its channel in channels.toml",
            )
        return np.full((measured.frequency.size, 1), rest, dtype=np.complex128)
    place = measured.channel(given.name)
    harmonics = measured.harmonics[:, place].copy()
    variance = np.trace(measured.covariance[:, place], axis1=-2, axis2=-1)
    stands_out = np.abs(harmonics) ** 2 > SIGNIFICANT**2 * variance
    stands_out[:, 0] = True
    valid = measured.valid[:, place]
    harmonics[~(stands_out & valid)] = 0.0
    if keeps_mean:
        harmonics[~valid[:, 0], 0] = rest
    else:
        harmonics[:, 0] = _means(harmonics, measured)
    if given.orders is None:
        return harmonics
    # A window is long: its orders are a few tenths of a hertz apart, and all of them count.
    harmonics[measured.dwells, given.orders + 1 :] = 0.0
    return harmonics if measured.windows.size else harmonics[:, : given.orders + 1]


def _means(harmonics: NDArray[np.complex128], measured: HarmonicResponse) -> NDArray[np.float64]:
    """The mean of an input in each test [its unit], (D,): about zero, and from zero where a window begins at rest."""
    means = np.zeros(harmonics.shape[0])
    if measured.part is not None:
        rested = measured.part.begins_at_rest > 0.0
        means[rested] = -harmonics[rested, 1:].sum(axis=1).real
    return means
