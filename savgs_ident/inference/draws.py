"""Draws of a posterior on file, read back by name: what an export or a controller goes on with."""

from collections.abc import Collection, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import TypeAlias

import h5py
import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.inference.result import Posterior

LARGEST = 2**28
"""Most bytes that all draws, or a piece of the file that has to be unpacked for them, may take in memory."""

FAR = 6.0
"""Standard deviations by which a parameter may be off the mean of its draws: its own posterior has it within 3."""

REMEDY = "give the posterior.nc that `savgs-ident posterior` wrote for this model"

Draws: TypeAlias = NDArray[np.float64]
"""Of one parameter, (n,), SI."""

DrawSource: TypeAlias = Path | Posterior
"""A ``posterior.nc``, or the posterior itself."""


def source_name(source: DrawSource) -> str:
    """What sentences call where draws come from."""
    return "the posterior" if isinstance(source, Posterior) else str(source)


def read_draws(path: DrawSource, names: Collection[str], count: int | None = None) -> dict[str, Draws]:
    """Draws by name, each (n,), SI, chains one after the other; of ``names``, those that the file holds.

    With a ``count``, at most so many, evenly spread over all. Raises :class:`InputError` if the file cannot be read
    or holds no finite draws of any.
    """
    if isinstance(path, Posterior):
        return thin_draws({name: np.ravel(path.draws[name]) for name in names if name in path.draws}, count)
    try:
        with h5py.File(path, "r") as file:
            group = file["posterior"]
            held = set(group.keys())
            _check_size(path, [group[name] for name in names if name in held])
            draws = {name: np.ravel(group[name][()]) for name in names if name in held}
    except OSError as error:
        raise InputError(f"cannot be read: {error}", source=path, remedy=REMEDY) from error
    except (KeyError, TypeError, AttributeError, ValueError, RuntimeError) as error:
        raise InputError("is no posterior", source=path, remedy=REMEDY) from error
    lengths = {values.size for values in draws.values()}
    finite = all(values.dtype.kind == "f" and np.isfinite(values).all() for values in draws.values())
    if len(lengths) != 1 or 0 in lengths or not finite:
        raise InputError("holds no finite draws of the model's parameters", source=path, remedy=REMEDY)
    return thin_draws({name: values.astype(np.float64) for name, values in draws.items()}, count)


def thin_draws(draws: Mapping[str, Draws], count: int | None) -> dict[str, Draws]:
    """At most ``count`` draws of each parameter, evenly spread over all, each (n,), SI; all without a count."""
    total = min((values.size for values in draws.values()), default=0)
    chosen = np.unique(np.linspace(0, total - 1, min(count or total, total)).astype(int))
    return {name: values[chosen] for name, values in draws.items()}


def far_from_draws(
    values: Mapping[str, float], draws: Mapping[str, Draws], limit: float = FAR
) -> tuple[str, ...]:
    """Names of the ``values`` [SI] that are more than ``limit`` standard deviations [1] off the mean of their draws.

    To be asked of all draws (n,), before they are thinned: few of them know no standard deviation, and one has none.
    """
    return tuple(
        name
        for name, each in draws.items()
        if each.size > 1 and abs(values[name] - float(np.mean(each))) > limit * float(np.std(each))
    )


def _check_size(path: Path, held: Sequence[h5py.Dataset]) -> None:
    """A file of some kilobytes can declare terabytes, and be read as so many zeros."""
    whole = sum(each.size * each.dtype.itemsize for each in held)
    pieces = [prod(each.chunks) * each.dtype.itemsize for each in held if each.chunks]
    if max([whole, *pieces]) > LARGEST:
        raise InputError(f"declares more than {LARGEST} bytes of draws", source=path, remedy=REMEDY)
