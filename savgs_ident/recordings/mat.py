"""MATLAB campaigns: one test a file, its vectors as signals; versions 5 to 7, and 7.3, which is HDF5.

The time is the vector ``t`` or ``time``; a matrix with as many rows as the time has samples is one signal a column,
``y_1``, ``y_2``. Units stand in ``channels.toml``, for MATLAB's variables have none. Nothing but named numeric arrays
is read: no objects, no functions, no structures.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.axis_recording import LARGEST, array_names, read_arrays
from savgs_ident.recordings.channels import ChannelMap, Progress, Reader, Reading
from savgs_ident.recordings.signals import Signal, reading_of, test_of

_HDF5 = b"\x89HDF\r\n\x1a\n"
_USER_BLOCK = 512
_VERSION_7_3 = b"MATLAB 7.3"
_FEW = 64
"""A matrix with more columns than that is no set of signals."""


def read_mat(path: Path, channel_map: ChannelMap, progress: Progress) -> Reading:
    """Read one MATLAB file; raises :class:`InputError` where it cannot be read or has no vectors."""
    source = str(path)
    with path.open("rb") as stream:
        head = stream.read(_USER_BLOCK + len(_HDF5))
    new = head.startswith((_HDF5, _VERSION_7_3)) or head[_USER_BLOCK:] == _HDF5
    arrays = _of_hdf5(path) if new else read_arrays(path, array_names(path))
    progress(1.0)
    signals = [each for name, array in arrays.items() for each in _signals(name, array)]
    if not signals:
        raise InputError(
            "has no numeric vector",
            source=source,
            remedy="save each signal as a vector of its own: save('run.mat', 't', 'position', 'force')",
        )
    return reading_of([(test_of(path), signals)], channel_map, source)


def _of_hdf5(path: Path) -> dict[str, NDArray[np.float64]]:
    """The real numeric arrays at the top of a file of version 7.3."""
    import h5py

    found = {}
    try:
        with h5py.File(path, "r") as file:
            for name, item in file.items():
                numeric = isinstance(item, h5py.Dataset) and item.dtype.kind in "fiub"
                # An empty one has no shape, and a name that is no text comes as bytes.
                if not numeric or item.shape is None or item.ndim > 2 or not isinstance(name, str):
                    continue
                if 8 * item.size > LARGEST:
                    raise InputError(
                        f"has the shape {item.shape}",
                        source=path,
                        channel=name,
                        remedy="record a shorter test",
                    )
                # MATLAB writes by columns.
                found[name] = np.asarray(item, dtype=np.float64).T
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        # What h5py raises of a damaged file.
        raise InputError(f"cannot be read: {error}", source=path, remedy="copy the file again") from error
    return found


def _signals(name: str, array: NDArray[np.float64]) -> Iterator[Signal]:
    if array.ndim < 2 or min(array.shape) == 1:
        if array.size > 1:
            yield Signal(name, None, None, array.ravel())
        return
    columns = array if array.shape[0] >= array.shape[1] else array.T
    if columns.shape[1] <= _FEW:
        for place in range(columns.shape[1]):
            yield Signal(f"{name}_{place + 1}", None, None, np.ascontiguousarray(columns[:, place]))


MAT = Reader(
    name="MATLAB",
    suffixes=(".mat",),
    magic=(b"MATLAB 5.0", _VERSION_7_3, _HDF5),
    plain_text=False,
    read=read_mat,
)
