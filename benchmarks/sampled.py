"""Run a command of the package and write where its wall time went, by looking at its threads now and then (POSIX).

    python -m benchmarks.sampled FILE fit data/campaigns/nominal.csv.gz --out out

Every few milliseconds the frames of all threads are looked at. The time since the last look belongs to the phase of
the innermost frame that says one; while the first thread waits, to those of the threads that do not.
"""

import json
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

INTERVAL_S = 0.004
"""Between two looks [s]."""

_WAITING = ("/threading.py", "/concurrent/futures/", "/queue.py", "/selectors.py", "/multiprocessing/")
"""Files in whose functions a thread waits for others."""

_PHASES = (
    ("imports", ("<frozen importlib", "<frozen zipimport"), ()),
    ("compiling", ("/jax/_src/compiler.py",), ("backend_compile", "backend_compile_and_load")),
    ("loading programs", ("/jax/_src/compilation_cache.py", "/jax/_src/export/serialization.py"), ()),
    ("loading programs", ("/jax/_src/export/_export.py",), ("mlir_module",)),
    ("loading programs", ("/jax/_src/compiler.py",), ("_cache_read",)),
    ("loading programs", ("/savgs_ident/simulate/program_cache.py",), ("_read", "fingerprint", "_description")),
    ("solving", ("/jax/_src/array.py", "/jax/_src/interpreters/pxla.py"), ("_value", "__array__", "__call__")),
    ("solving", ("/equinox/_jit.py",), ("_call",)),
    ("linear algebra", ("/numpy/linalg/", "/scipy/linalg/"), ()),
    ("pictures", ("/matplotlib/", "/PIL/", "/savgs_ident/report/"), ()),
    ("reading", ("/savgs_ident/recordings/", "/pandas/", "/pyarrow/"), ()),
    ("responses", ("/savgs_ident/responses/",), ()),
    ("writing", ("/savgs_ident/core/files.py", "/json/", "/h5py/"), ()),
    ("tracing", ("/jax/", "/equinox/"), ()),
    ("solving", ("/savgs_ident/simulate/", "/savgs_ident/plants/", "/savgs_ident/effects/"), ()),
    ("searching", ("/savgs_ident/",), ()),
)  # fmt: skip
"""Phases with the files of their frames, and functions in them where not all count; the first that fits."""

PHASES = (*dict.fromkeys(each[0] for each in _PHASES), "other")


def _frames(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def phase_of(frame: FrameType | None) -> str:
    """The phase of the innermost frame that says one."""
    for each in _frames(frame):
        code = each.f_code
        if code.co_name == "<module>" and each.f_globals.get("__name__") != "__main__":
            return "imports"
        for phase, files, functions in _PHASES:
            fits = any(file in code.co_filename for file in files)
            if fits and (not functions or code.co_name in functions):
                return phase
    return "other"


def _waits(frame: FrameType) -> bool:
    return any(file in frame.f_code.co_filename for file in _WAITING)


class Sampler(threading.Thread):
    """A thread that looks at all others until it is told to stop; ``spent`` is the time of each phase [s]."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.spent: defaultdict[str, float] = defaultdict(float)
        self._stopping = threading.Event()

    def run(self) -> None:
        """Look until it is told to stop."""
        last = time.perf_counter()
        while not self._stopping.wait(INTERVAL_S):
            now = time.perf_counter()
            self._share(now - last)
            last = now

    def stop(self) -> None:
        """Look no more."""
        self._stopping.set()
        self.join()

    def _share(self, seconds: float) -> None:
        frames: dict[int, FrameType] = dict(sys._current_frames())
        first = frames.pop(threading.main_thread().ident or 0)
        frames.pop(threading.get_ident(), None)
        busy = [first] if not _waits(first) else [each for each in frames.values() if not _waits(each)]
        for each in busy or [first]:
            self.spent[phase_of(each) if busy else "other"] += seconds / max(len(busy), 1)


def main(arguments: list[str]) -> int:
    """Command line: the file to write, the command and its arguments."""
    target, *command = arguments
    sampler = Sampler()
    sampler.start()
    code = 0
    try:
        from savgs_ident.cli.app import run

        sys.argv = ["savgs-ident", *command]
        run()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    sampler.stop()
    Path(target).write_text(json.dumps(sampler.spent))
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
