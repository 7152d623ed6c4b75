"""What a traced program depends on, as one short text.

A traced program may serve again where nothing that shaped it has changed: the source of this package, the
versions of what traced it, and of its arguments everything but the numbers in arrays. Whatever cannot be
described with certainty, such as an effect that is defined outside this package, has no fingerprint.
"""

import dataclasses
import enum
import hashlib
from collections.abc import Callable, Iterator
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import jax
import numpy as np

_PACKAGE = "savgs_ident"
_TRACERS = ("jax", "jaxlib", "equinox", "numpy", "scipy")
_SETTINGS = (
    "jax_enable_x64",
    "jax_default_matmul_precision",
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
)


class _UntoldError(Exception):
    """Something of which no description is certain."""


def fingerprint(function: Callable[..., Any], args: tuple[Any, ...]) -> str | None:
    """A digest of ``function`` of this package and the structure of its arguments; None if it has none."""
    try:
        told = [_origin(function), *_description(args)]
    except _UntoldError:
        return None
    told += [_SOURCE, jax.default_backend(), *map(version, _TRACERS)]
    told += [f"{setting} {getattr(jax.config, setting)}" for setting in _SETTINGS]
    return hashlib.sha256("\n".join(told).encode()).hexdigest()


def _sources(folder: Traversable) -> Iterator[Traversable]:
    for each in folder.iterdir():
        if each.is_dir():
            yield from _sources(each)
        elif each.name.endswith(".py"):
            yield each


def _digest_of_source() -> str:
    digest = hashlib.sha256()
    for file in sorted(_sources(files(_PACKAGE)), key=str):
        digest.update(file.read_bytes())
    return digest.hexdigest()


# Taken when this package is loaded: what is on disk later is not what runs.
_SOURCE = _digest_of_source()


def _origin(thing: Any) -> str:
    """Where a class or function is defined; a function within another sees more than its arguments."""
    name = f"{thing.__module__}.{thing.__qualname__}"
    if thing.__module__.partition(".")[0] != _PACKAGE or "<locals>" in name or "<lambda>" in name:
        raise _UntoldError(name)
    return name


def _description(value: Any) -> Iterator[str]:
    match value:
        case jax.Array():
            yield f"array {value.dtype} {value.shape}"
        case np.ndarray():
            yield f"numbers {value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
        case enum.Enum():
            yield f"{_origin(type(value))}.{value.name}"
        case None | bool() | int() | float() | str():
            yield f"{type(value).__name__} {value!r}"
        case dict():
            yield f"dict {len(value)}"
            for key in sorted(value):
                yield from _description(key)
                yield from _description(value[key])
        case tuple() | list():
            yield type(value).__name__ if type(value) in (tuple, list) else _origin(type(value))
            yield str(len(value))
            for each in value:
                yield from _description(each)
        case _ if dataclasses.is_dataclass(value) and not isinstance(value, type):
            yield _origin(type(value))
            for field in dataclasses.fields(value):
                yield field.name
                yield from _description(getattr(value, field.name))
        case _:
            raise _UntoldError(type(value).__name__)
