"""Compiled programs, kept from one run to the next in the user's cache folder."""

import os
import sys
from pathlib import Path

import jax


def cache_folder() -> Path:
    """Where compiled programs are kept: ``SAVGS_IDENT_CACHE``, else the platform's cache folder."""
    chosen = os.environ.get("SAVGS_IDENT_CACHE")
    if chosen:
        return Path(chosen)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "savgs_ident" / "xla"


def use_persistent_cache() -> bool:
    """Keep compiled programs from now on; False where the folder cannot be written, and nothing is kept."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    if not os.access(folder, os.W_OK):
        return False
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    return True
