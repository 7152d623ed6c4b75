"""Where the figures were taken: processor, cores, load, versions."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = (
    "savgs-ident",
    "jax",
    "numpy",
    "scipy",
    "diffrax",
    "harmonicbalance",
    "emcee",
    "blackjax",
    "casadi",
)


def describe_machine() -> dict[str, str | float]:
    """Flat facts for the record."""
    return {
        "machine_cpu": _processor(),
        "machine_cores": float(os.cpu_count() or 0),
        "machine_load_1min": os.getloadavg()[0],
        "machine_python": platform.python_version(),
        "machine_versions": ", ".join(f"{name} {_version(name)}" for name in _PACKAGES),
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def _processor() -> str:
    table = Path("/proc/cpuinfo")
    if table.is_file():
        for line in table.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
