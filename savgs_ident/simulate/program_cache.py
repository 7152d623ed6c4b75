"""Programs, traced and compiled, kept from one run to the next in the user's cache folder.

The compilation cache of JAX spares a later run the compiler; but to ask for a compiled program, Python must still
trace the model through a few thousand operations, which takes longer than solving it. So what was traced is kept
beside what was compiled.

A traced program may serve again where nothing that shaped it has changed: the source of what is traced, the versions
of what traced it, and of its arguments everything but the numbers in arrays. Its :func:`fingerprint` says all of that
in one digest. What cannot be described with certainty, such as an effect that is defined outside this package, has
none, and is traced anew.
"""

import ctypes
import dataclasses
import enum
import gc
import hashlib
import os
import platform
import shutil
import sys
import threading
import warnings
from collections.abc import Callable, Hashable, Iterator
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, TypeVar, cast

import equinox as eqx
import jax
import numpy as np
from jax import export
from jaxtyping import Array

Value = TypeVar("Value")

_PACKAGE = "savgs_ident"
_TRACERS = ("jax", "jaxlib", "equinox", "numpy", "scipy")
_SETTINGS = (
    "jax_enable_x64",
    "jax_default_matmul_precision",
    "jax_numpy_dtype_promotion",
    "jax_numpy_rank_promotion",
)


class _UndescribedError(Exception):
    """Something of which no description is certain."""


def fingerprint(function: Callable[..., Any], args: tuple[Any, ...]) -> str | None:
    """A digest of ``function`` of this package and the structure of its arguments; None if it has none."""
    try:
        parts = [_origin(function), *_description(args)]
    except _UndescribedError:
        return None
    parts += [_SOURCE, jax.default_backend(), *map(version, _TRACERS)]
    parts += [f"{setting} {getattr(jax.config, setting)}" for setting in _SETTINGS]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


TRACED = (
    "core",
    "effects",
    "plants",
    "symbolic",
    "simulate",
    "inference",
    "fit",
    "diagnosis",
    "validation",
    "control",
    "export",
)
"""Folders of the package with code that shapes programs; readers, reports and commands shape none."""


def _sources(folder: Traversable) -> Iterator[Traversable]:
    for each in folder.iterdir():
        if each.is_dir():
            yield from _sources(each)
        elif each.name.endswith(".py"):
            yield each


def digest_of_sources(package: Traversable) -> str:
    """Digest of the source files of a package from which programs are traced, as hexadecimal digits."""
    digest = hashlib.sha256()
    for name in TRACED:
        for file in sorted(_sources(package / name), key=str):
            digest.update(file.read_bytes())
    return digest.hexdigest()


# Taken when this package is loaded: what is on disk later is not what runs.
_SOURCE = digest_of_sources(files(_PACKAGE))


def _origin(thing: Any) -> str:
    """Where a class or function is defined; a function within another sees more than its arguments."""
    name = f"{thing.__module__}.{thing.__qualname__}"
    if thing.__module__.partition(".")[0] != _PACKAGE or "<locals>" in name or "<lambda>" in name:
        raise _UndescribedError(name)
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
            raise _UndescribedError(type(value).__name__)


_DIGEST = hashlib.sha256().digest_size


def run_cached(function: Callable[..., tuple[Array, ...]], *args: Any) -> tuple[Array, ...]:
    """``function(*args)`` by its program in the cache folder; where there is none, it is traced and written there.

    ``function`` is pure, defined at the top of a module of this package, and gives a flat tuple of arrays
    of any shape and any units. A cached program can be compiled within a larger one, but neither
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


_WORKING: dict[Hashable, threading.Lock] = {}
_DONE: set[Hashable] = set()


def done_once(what: Hashable, work: Callable[[], object]) -> None:
    """Do the work that gets programs compiled, the first time that it is asked for.

    Threads that ask for the same while it is done wait for it: each would compile the same programs otherwise.
    """
    if what in _DONE:
        return
    with _WORKING.setdefault(what, threading.Lock()):
        if what not in _DONE:
            work()
            _DONE.add(what)


def compiled_quickly(function: Callable[..., Value]) -> Callable[..., Value]:
    """A program of few numbers that is asked for a few times: compiled in less than half the time, half as fast.

    It cannot be a part of another program.
    """
    # Equinox hands the options on, which its types do not say.
    compiled: Any = eqx.filter_jit
    return cast(Callable[..., Value], compiled(function, compiler_options={_EFFORT: 0}))


_EFFORT = "xla_backend_optimization_level"


def first_alone(program: Callable[..., Value], *args: Any) -> Value:
    """``program(*args)``; the first time for arguments of these shapes, threads that ask for it meanwhile wait."""
    key = program, signature(args)
    if key not in _DONE:
        with _WORKING.setdefault(key, threading.Lock()):
            if key not in _DONE:
                found = program(*args)
                _DONE.add(key)
                return found
    return program(*args)


def signature(tree: Any) -> Hashable:
    """What a program is compiled for: the structure of its arguments, the shapes of arrays, and all else as it is."""
    leaves, structure = jax.tree.flatten(tree)
    return structure, tuple((each.shape, each.dtype) if eqx.is_array(each) else each for each in leaves)


def placed(tree: Any) -> Any:
    """``tree`` with its arrays bound to the device.

    What a cached program gives is bound to a device. A program that takes such arrays together with others is
    compiled once for every combination in which they come; if all are bound there is only one.
    """
    leaves, structure = jax.tree.flatten(tree)
    free = [
        place
        for place, leaf in enumerate(leaves)
        if eqx.is_array(leaf) and not getattr(leaf, "committed", False)
    ]
    if free:
        for place, bound in zip(free, _binding()([leaves[place] for place in free]), strict=True):
            leaves[place] = bound
    return jax.tree.unflatten(structure, leaves)


@cache
def _binding() -> Callable[[list[Array]], list[Array]]:
    """A program that gives what it takes: to put many numbers somewhere one by one takes several times as long."""
    device = jax.sharding.SingleDeviceSharding(jax.devices()[0])
    return jax.jit(list, out_shardings=device)


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


MANY_REGIONS = 20_000
"""Mapped regions of memory above which compiled programs are let go; Linux ends a process at 65 530."""

MUCH_MEMORY = 2 * 2**30
"""Memory of a process [byte] above which compiled programs are let go: those of three diagnoses take 1.3 GB."""

LEAST_ROOM = 64 * 2**20
"""Space on the disk [byte] below which no programs are kept: half of one would be found in every later run."""

_QUICK = {"--xla_cpu_use_fusion_emitters=false": ("0.10.",)}
_QUICK_ON_X86 = {"--xla_cpu_max_isa=AVX2": ("0.10.", "0.11.", "0.12.")}
"""Flags, and how the versions of jaxlib begin on which they were tried: XLA ends the process for one it lacks."""


def spare_the_compiler() -> None:
    """Compile in half the time and memory, for the same speed of what is compiled.

    Wider registers than those of AVX2 are no gain where arrays come from memory, and take longer to compile for.
    """
    flags, compiler = os.environ.get("XLA_FLAGS", ""), version("jaxlib")
    quick = _QUICK | (_QUICK_ON_X86 if platform.machine() in ("x86_64", "AMD64") else {})
    asked = [
        flag
        for flag, tried in quick.items()
        if compiler.startswith(tried) and flag.split("=")[0].strip("-") not in flags
    ]
    os.environ["XLA_FLAGS"] = " ".join([*flags.split(), *asked])


def cache_folder() -> Path:
    """Where programs are kept: ``SAVGS_IDENT_CACHE``, else the platform's cache folder.

    Raises :class:`RuntimeError` where that is in a home folder and the user has none.
    """
    chosen = os.environ.get("SAVGS_IDENT_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "savgs_ident" / "xla"


def use_persistent_cache() -> bool:
    """Keep compiled programs from now on; False where there is no folder that can take them, and none is kept.

    To be called before anything is computed: the compiler is set up here too.
    """
    spare_the_compiler()
    try:
        folder = cache_folder()
        folder.mkdir(parents=True, exist_ok=True)
        room = shutil.disk_usage(folder).free
    except (OSError, RuntimeError):
        return False
    if not os.access(folder, os.W_OK) or room < LEAST_ROOM:
        return False
    # What cannot be kept, or read again, is compiled: slower, and no concern of the user's.
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache entry")
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    return True


def make_room_for_programs(most: int = MANY_REGIONS, most_memory: int = MUCH_MEMORY) -> None:
    """Let compiled programs go where they take more than ``most`` regions of the process's memory, some twenty each.

    Or where the process has more than ``most_memory`` [byte] of it. For processes that do one task after another.
    Beyond the bound of the system the next program, compiled or read from the cache, would end the process.
    """
    if mapped_regions() > most or memory_in_use() > most_memory:
        jax.clear_caches()
        _DONE.clear()
        _WORKING.clear()
        gc.collect()
        _give_back()


def _give_back() -> None:
    """Hand memory that was let go to the system: the C library of Linux keeps what may be asked for again."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


def memory_in_use() -> int:
    """Memory that this process has [byte]; 0 where the system does not say."""
    pages = Path("/proc/self/statm")
    return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if pages.exists() else 0


def mapped_regions() -> int:
    """Regions of memory [1] that this process has mapped; 0 where the system does not say."""
    maps = Path("/proc/self/maps")
    return maps.read_bytes().count(b"\n") if maps.exists() else 0
