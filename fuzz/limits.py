"""What one input may take: time of the processor, and memory of the process (where the system reports it)."""

import resource
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

SECONDS = 10.0
"""Most time of the processor for one input [s]."""

MEMORY = 1 << 30
"""Most memory by which one input may make the process grow [bytes]."""

_ROOM = 8 << 30
_STATUS, _RESET = Path("/proc/self/status"), Path("/proc/self/clear_refs")


class TooLongError(BaseException):
    """Time is up. No :class:`Exception`: nothing that is read may catch it."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise :class:`TooLongError` after so much time of the processor; without effect beside the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(number: int, frame: FrameType | None) -> None:
        raise TooLongError

    before = signal.signal(signal.SIGPROF, ring)
    # It rings again where the first ring was lost: Python drops what is raised while an object goes away.
    signal.setitimer(signal.ITIMER_PROF, seconds, 0.2)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def begin_peak() -> int:
    """Forget the peak so far; the resident memory now [bytes], 0 where it is not known."""
    try:
        _RESET.write_text("5")
    except OSError:
        return 0
    return _resident("VmRSS")


def grown(begin: int) -> int:
    """By how much the peak exceeds what was resident at the beginning [bytes]; 0 where it is not known."""
    return max(_resident("VmHWM") - begin, 0) if begin else 0


def limit_memory() -> None:
    """Whatever a file declares, this process gets no more than some gigabytes beyond what it has."""
    now = _resident("VmSize")
    if now:
        resource.setrlimit(resource.RLIMIT_AS, (now + _ROOM, resource.RLIM_INFINITY))


def _resident(what: str) -> int:
    if not _STATUS.exists():
        return 0
    for line in _STATUS.read_text().splitlines():
        if line.startswith(f"{what}:"):
            return 1024 * int(line.split()[1])
    return 0
