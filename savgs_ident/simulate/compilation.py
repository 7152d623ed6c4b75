"""Programs, traced and compiled, kept from one run to the next in the user's cache folder."""

import gc
import os
import shutil
import sys
import warnings
from importlib.metadata import version
from pathlib import Path

import jax

MANY_REGIONS = 20_000
"""Mapped regions of memory above which compiled programs are let go; Linux ends a process at 65 530."""

LEAST_ROOM = 64 * 2**20
"""Space on the disk [byte] below which no programs are kept: half of one would be found in every later run."""

_QUICK = "--xla_cpu_use_fusion_emitters=false"
_QUICK_IS_KNOWN_TO = "0.10."


def spare_the_compiler() -> None:
    """Compile in half the time and memory, for the same speed of what is compiled.

    A flag that XLA does not know ends the process, hence only for versions on which it was tried.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if version("jaxlib").startswith(_QUICK_IS_KNOWN_TO) and "fusion_emitters" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {_QUICK}".strip()


def compute_on_one_core() -> None:
    """Have programs of this process use one core: for processes of which there are as many as cores.

    Threads beyond the cores only get in each other's way. To be called before anything is computed.
    """
    # The variable from which XLA takes the size of its pool of threads.
    os.environ["NPROC"] = "1"


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


def make_room_for_programs() -> None:
    """Let compiled programs go where they are many: each takes some twenty regions of the process's memory.

    For processes that do one task after another. Beyond the bound of the system the next program, compiled or read
    from the cache, would end the process.
    """
    if mapped_regions() > MANY_REGIONS:
        jax.clear_caches()
        gc.collect()


def mapped_regions() -> int:
    """Regions of memory [1] that this process has mapped; 0 where the system does not tell."""
    maps = Path("/proc/self/maps")
    return maps.read_bytes().count(b"\n") if maps.exists() else 0
