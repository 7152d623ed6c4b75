"""Traced programs, kept from one run to the next beside the compiled ones.

The compilation cache spares a later run the compiler; to ask for a compiled program, Python must still trace
the model through a few thousand operations, which takes longer than solving it. Where a persistent cache is
in use (:mod:`savgs_ident.simulate.compilation`), what was traced is kept too.
"""

import hashlib
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
from jax import export
from jaxtyping import Array

from savgs_ident.simulate.fingerprint import fingerprint

_DIGEST = hashlib.sha256().digest_size


def stored(function: Callable[..., tuple[Array, ...]], *args: Any) -> tuple[Array, ...]:
    """``function(*args)`` from its stored program, if one was kept; else trace it, and keep it.

    ``function`` is pure, defined at the top of a module of this package, and gives a flat tuple of arrays
    of any shape and any units. A stored program can be compiled within a larger one, but neither
    differentiated nor batched.
    """
    folder = jax.config.values["jax_compilation_cache_dir"]
    key = fingerprint(function, args) if folder else None
    if key is None:
        return function(*args)
    leaves, structure = jax.tree.flatten(args, is_leaf=lambda each: each is None)
    places = [place for place, leaf in enumerate(leaves) if isinstance(leaf, jax.Array)]

    def of_arrays(*arrays: Array) -> tuple[Array, ...]:
        every = list(leaves)
        for place, array in zip(places, arrays, strict=True):
            every[place] = array
        return function(*jax.tree.unflatten(structure, every))

    file = Path(folder) / f"traced-{key}"
    arrays = [leaves[place] for place in places]
    program = _read(file)
    if program is None:
        shapes = [jax.ShapeDtypeStruct(array.shape, array.dtype) for array in arrays]
        program = export.export(jax.jit(of_arrays))(*shapes)
        _write(file, program)
    return tuple(program.call(*arrays))


def placed(tree: Any) -> Any:
    """``tree`` with its arrays bound to the device.

    What a stored program gives is bound to a device. A program that takes such arrays together with others is
    compiled once for every combination in which they come; if all are bound there is only one.
    """
    arrays, rest = eqx.partition(tree, eqx.is_array)
    return eqx.combine(jax.device_put(arrays, jax.devices()[0]), rest)


def _read(file: Path) -> export.Exported | None:
    """The program in a file; None if there is none or it is not whole."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    digest, program = content[:_DIGEST], content[_DIGEST:]
    if hashlib.sha256(program).digest() != digest:
        return None
    return export.deserialize(bytearray(program))


def _write(file: Path, program: export.Exported) -> None:
    """Keep a program, whole or not at all; a folder that cannot be written keeps nothing."""
    content = bytes(program.serialize())
    part = file.with_name(f"{file.name}-{os.getpid()}")
    try:
        part.write_bytes(hashlib.sha256(content).digest() + content)
        part.replace(file)
    except OSError:
        return
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)
