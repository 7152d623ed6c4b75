"""The channels that recordings of a plant have, and what is checked of them whatever its parameters are."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.plants.base import AbstractPlant, scale_of_time
from savgs_ident.recordings.checks_signal import DataLocation
from savgs_ident.recordings.recording import SLOWEST_HZ, ChannelSpec, Recording, RecordingLayout
from savgs_ident.responses.resolution import roughness


def layout_of(plant: AbstractPlant | type[AbstractPlant]) -> RecordingLayout:
    """The channels of recordings of a plant, as it declares them; a dwell or a sweep moves its first input."""
    driving = tuple(ChannelSpec(each.name, each.unit, each.about) for each in plant.inputs)
    read = tuple(ChannelSpec(each.name, each.unit, each.about) for each in plant.channels)
    return RecordingLayout(
        (*driving, *read),
        driving[0].name,
        tuple(each.name for each in read),
        checks=(
            partial(check_sizes, _typical_sizes(plant)),
            partial(check_inputs, tuple(each.name for each in plant.inputs if each.required)),
        ),
        slowest_hz=SLOWEST_HZ / max(scale_of_time(plant), 1.0),
    )


NOISY = 2.0
"""A signal that changes by so many times its noise moves."""

UNLIKE = 100.0
"""Factor by which an input may be larger or smaller than the plant's declared sizes say. Origin: by choice, so that
millimetres taken for metres are seen and no declaration has to be exact."""


def _typical_sizes(plant: AbstractPlant | type[AbstractPlant]) -> tuple[tuple[str, str, float], ...]:
    """Name and unit of each input, and how large it typically is by the sizes of what it moves [unit].

    And of a reading of the one coordinate that has its unit.
    """
    sizes = {each.unit: each.size for each in plant.coordinates}
    alone = len(plant.coordinates) == 1
    found = [
        (each.name, each.unit, sizes[each.unit]) for each in plant.channels if alone and each.unit in sizes
    ]
    for each in plant.inputs:
        moved = [one.size / abs(by) for one, by in zip(plant.coordinates, each.moves, strict=False) if by]
        if moved:
            found.append((each.name, each.unit, float(np.median(moved))))
    return tuple(found)


def check_sizes(
    sizes: Sequence[tuple[str, str, float]], recordings: Sequence[Recording], source: str
) -> tuple[DataWarning, ...]:
    """Warnings ``implausible_unit`` of signals that are far from the ``sizes`` (name, unit, size) of a plant.

    One that stays where it is, as a current does, may be anything.
    """
    found = []
    for name, unit, size in sizes:
        values = {each.name: each.channels[name].values for each in recordings if name in each.channels}
        moving = {test: float(np.nanstd(each)) for test, each in values.items() if _moves(each)}
        test = max(moving, key=lambda each: moving[each], default="")
        if test and not size / UNLIKE < moving[test] < size * UNLIKE:
            found.append(
                DataLocation(source, test, name).warning(
                    "implausible_unit",
                    f"has an rms of {moving[test]:.2g} {unit}, where the sizes that the plant declares say about "
                    f"{size:.2g} {unit}",
                    "check its unit, in the header or in channels.toml, and the sizes of the plant's coordinates",
                )
            )
    return tuple(found)


def check_inputs(
    names: Sequence[str], recordings: Sequence[Recording], source: str
) -> tuple[DataWarning, ...]:
    """Warnings ``input_not_recorded`` of inputs that some tests have and others lack."""
    moving, found = [each for each in recordings if each.kind != "standstill"], []
    for name in names:
        # Nothing drives a plant in a decay.
        tests = [each for each in moving if each.kind != "decay" or name != names[0]]
        lack = [each.name for each in tests if name not in each.channels]
        if 0 < len(lack) < len(tests):
            also = f"and in {len(lack) - 1} more " if len(lack) > 1 else "alone "
            found.append(
                DataLocation(source, lack[0], name).warning(
                    "input_not_recorded",
                    f"was not recorded here {also}of {len(tests)} tests: left out",
                    "map its channel in channels.toml, or fill its column in where it stood still",
                )
            )
    return tuple(found)


def _moves(values: NDArray[np.float64]) -> bool:
    """Whether values (n,) of any unit change by more than their noise."""
    known = values[np.isfinite(values)]
    return known.size > 3 and float(np.std(known)) > NOISY * roughness(known)
