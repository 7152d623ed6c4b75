"""HDF5 files whose groups, arrays and attributes are not what they were."""

from collections.abc import Callable
from io import BytesIO

import h5py
import numpy as np
from numpy.random import Generator

HUGE = 1 << 40
"""Numbers that a file may declare without holding them."""


def damage_hdf5(content: bytes, random: Generator) -> bytes:
    """A file with one to three entries that are not what they were."""
    stream = BytesIO(content)
    with h5py.File(stream, "r+") as file:
        for _ in range(int(random.choice([1, 1, 2, 3]))):
            _WAYS[int(random.integers(len(_WAYS)))](file, random)
    return stream.getvalue()


def _array(file: h5py.File, random: Generator) -> str:
    """The path of one of the arrays; of the file itself where there is none."""
    found: list[str] = []
    file.visititems(lambda name, each: found.append(name) if isinstance(each, h5py.Dataset) else None)
    return found[int(random.integers(len(found)))] if found else ""


def _replaced(file: h5py.File, random: Generator) -> None:
    """Another array in its place."""
    name = _array(file, random)
    if not name:
        return
    whole = _shape(file, name)
    values = (
        np.full(whole, np.nan), np.full(whole, np.inf), np.zeros(whole, int), np.zeros(whole, np.float32),
        np.zeros(whole, complex), np.zeros(whole, bool), np.zeros((0, 3)), np.float64(1.0), "a text",
        np.zeros((3, 1, 2)),
        np.array([b"a", b"b"]), np.zeros(whole, ">f8"), np.zeros(whole, np.float16), np.full(whole, 1e308),
        np.zeros(whole, [("a", float), ("b", int)]), h5py.Empty("f8"), np.zeros((2,) * 12),
        np.zeros(whole, np.longdouble),
    )  # fmt: skip
    del file[name]
    file[name] = values[int(random.integers(len(values)))]


def _shape(file: h5py.File, name: str) -> tuple[int, ...]:
    shape = file[name].shape
    return () if shape is None else tuple(min(extent, 100) for extent in shape)


def _some_lost(file: h5py.File, random: Generator) -> None:
    """Numbers of an array that are none."""
    name = _array(file, random)
    if not name or file[name].dtype.kind != "f" or not file[name].shape:
        return
    values = np.ravel(file[name][()]) if file[name].size and file[name].size < 10**6 else np.zeros(0)
    if values.size:
        values[int(random.integers(values.size))] = random.choice([np.nan, np.inf, -np.inf, 1e308])
        file[name][...] = values.reshape(file[name].shape)


def _huge(file: h5py.File, random: Generator) -> None:
    """An array that declares terabytes and holds nothing, or whose pieces do."""
    name = _array(file, random)
    if not name:
        return
    del file[name]
    match int(random.integers(3)):
        case 0:
            file.create_dataset(name, (HUGE,), "f8", chunks=(1 << 16,))
        case 1:
            file.create_dataset(name, (1 << 15, 1 << 15), "f8", chunks=(64, 64), fillvalue=1.0)
        case _:
            packed = file.create_dataset(name, (1 << 25,), "f8", chunks=(1 << 16,), compression="gzip")
            packed[: 1 << 16] = 0.0


def _dropped(file: h5py.File, random: Generator) -> None:
    name = _array(file, random)
    if name:
        del file[name]


def _renamed(file: h5py.File, random: Generator) -> None:
    name = _array(file, random)
    if name:
        file.move(
            name,
            ("x", "posterior/x", "mcmc/y", f"{name}_")[int(random.integers(4))] + str(random.integers(99)),
        )


def _linked(file: h5py.File, random: Generator) -> None:
    """A link in its place: into a circle, to another file, to a group, to nothing."""
    name = _array(file, random)
    if not name:
        return
    del file[name]
    links = (
        h5py.SoftLink(f"/{name}"),
        h5py.ExternalLink("/nowhere.h5", "/x"),
        h5py.SoftLink("/"),
        h5py.SoftLink("/x"),
    )
    file[name] = links[int(random.integers(len(links)))]


def _grouped(file: h5py.File, random: Generator) -> None:
    name = _array(file, random)
    if name:
        del file[name]
        file.create_group(name)


def _attribute(file: h5py.File, random: Generator) -> None:
    names = list(file.attrs)
    if not names:
        return
    name = names[int(random.integers(len(names)))]
    values = (
        1,
        "case",
        np.zeros((0,)),
        np.nan,
        np.arange(3.0),
        "é" * 5000,
        b"\xff",
        np.array([1, 2]),
        h5py.Empty("f8"),
    )
    chosen = int(random.integers(len(values) + 1))
    del file.attrs[name]
    if chosen < len(values):
        file.attrs[name] = values[chosen]


_WAYS: tuple[Callable[[h5py.File, Generator], None], ...] = (
    _replaced, _replaced, _replaced, _some_lost, _some_lost, _huge, _dropped, _renamed, _linked, _grouped, _attribute,
    _attribute,
)  # fmt: skip
