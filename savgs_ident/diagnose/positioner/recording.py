"""A recording of the positioner: a carriage on a ball screw, driven by a motor under closed loop.

The file has, in MATLAB's format, column vectors ``t`` [s], ``qm`` (measured position [m]), ``qg`` (reference [m])
and ``vir`` (controller output [V]), and the scalar ``gtau`` (force of the drive per volt [N/V]). Pulses that were
added to the controller's output are in ``vir`` already, so that nothing else is read.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import InputError
from savgs_ident.diagnose.positioner.mat_file import read_arrays

SIGNALS = {"t": 1e6, "qm": 1e2, "qg": 1e2, "vir": 1e4}
"""Vectors that a file must have, and sizes [s, m, m, V] beyond which they are in another unit or broken."""

GAIN = "gtau"
"""Scalar that a file must have."""

LARGEST_GAIN = 1e6
"""Largest gain that is believed [N/V]."""

JITTER = 0.01
"""Largest departure of a time from an even grid, in steps."""


@dataclass(frozen=True)
class PositionerRecording:
    """One test of n evenly spaced samples.

    Attributes:
        source: file it came from.
        time: [s], (n,).
        position: of the carriage, [m], (n,).
        reference: where the carriage was told to be, [m], (n,).
        force: of the drive, [N], (n,).
    """

    source: str
    time: NDArray[np.float64]
    position: NDArray[np.float64]
    reference: NDArray[np.float64]
    force: NDArray[np.float64]

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float(self.time[-1] - self.time[0]) / (self.time.size - 1)


def read_positioner(path: Path) -> PositionerRecording:
    """A recording from a MATLAB file.

    Raises :class:`InputError` for a file that cannot be read, a signal that is missing, of another length or not
    finite, a gain that is no positive number, or times that are not even.
    """
    arrays = read_arrays(path, (*SIGNALS, GAIN))
    gain = arrays[GAIN]
    if gain.size != 1 or not 0.0 < gain.ravel()[0] < LARGEST_GAIN:
        raise InputError("must be one positive number", source=path, channel=GAIN, remedy="give it in N/V")
    signals = {name: _vector(path, name, arrays[name]) for name in SIGNALS}
    _check_times(path, signals["t"])
    for name, signal in signals.items():
        _check_signal(path, name, signal, signals["t"])
    return PositionerRecording(
        str(path), signals["t"], signals["qm"], signals["qg"], float(gain.ravel()[0]) * signals["vir"]
    )


def _vector(path: Path, name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    if array.ndim > 2 or array.size < 2 or max(array.shape) != array.size:
        raise InputError(
            f"has the shape {array.shape}", source=path, channel=name, remedy="save it as one column"
        )
    return array.ravel()


def _check_times(path: Path, time: NDArray[np.float64]) -> None:
    if not np.isfinite(time).all():
        raise InputError("has a sample that is not a number", source=path, channel="t")
    step = (time[-1] - time[0]) / (time.size - 1)
    uneven = np.abs(time - time[0] - step * np.arange(time.size)) > JITTER * abs(step)
    if step <= 0.0 or uneven.any():
        place = float(time[int(np.argmax(uneven))])
        raise InputError(
            "times are not even and rising",
            source=path,
            channel="t",
            time=place,
            remedy="resample the recording",
        )


def _check_signal(path: Path, name: str, signal: NDArray[np.float64], time: NDArray[np.float64]) -> None:
    if signal.size != time.size:
        raise InputError(f"has {signal.size} samples, but t has {time.size}", source=path, channel=name)
    lost = ~np.isfinite(signal)
    if lost.any():
        place = float(time[int(np.argmax(lost))])
        raise InputError("has a sample that is not a number", source=path, channel=name, time=place)
    if np.max(np.abs(signal)) > SIGNALS[name]:
        raise InputError(
            f"exceeds {SIGNALS[name]:g}", source=path, channel=name, remedy="give it in SI units, and in V"
        )
