"""The installed program: its console script, as a process that is started as a test wants it."""

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SCRIPT = Path(sys.executable).with_name("savgs-ident")

_LIMIT = (
    "import os, resource, sys; "
    "resource.setrlimit(resource.RLIMIT_FSIZE, 2 * (int(sys.argv[1]),)); "
    "os.execv(sys.argv[2], sys.argv[2:])"
)


def on_a_disk_with(room: int) -> tuple[str, ...]:
    """What to start a program with, so that no file can grow beyond ``room`` [byte]."""
    return (sys.executable, "-c", _LIMIT, str(room))


@dataclass(frozen=True)
class Installed:
    """Runs the program in ``folder`` with ``environment``."""

    folder: Path
    environment: Mapping[str, str]

    def run(
        self, *words: object, before: Sequence[str] = (), **environment: str
    ) -> "subprocess.CompletedProcess[str]":
        """Run it to its end; ``before`` is a program that starts it, ``environment`` what it finds changed."""
        return subprocess.run(
            [*before, str(SCRIPT), *map(_word, words)],
            capture_output=True,
            timeout=600,
            check=False,
            **self._how(environment),
        )

    def start(self, *words: object, **environment: str) -> "subprocess.Popen[str]":
        """Start it; its output waits in pipes."""
        return subprocess.Popen(
            [str(SCRIPT), *map(_word, words)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            **self._how(environment),
        )

    def shell(self, line: str, *words: object, **environment: str) -> "subprocess.CompletedProcess[str]":
        """Run a line of bash in which ``"$@"`` is the program with its words."""
        return subprocess.run(
            ["bash", "-c", line, "bash", str(SCRIPT), *map(_word, words)],
            capture_output=True,
            timeout=600,
            check=False,
            **self._how(environment),
        )

    def _how(self, environment: Mapping[str, str]) -> dict[str, Any]:
        return {
            "cwd": self.folder,
            "env": {**self.environment, **environment},
            "encoding": "utf-8",
            "errors": "backslashreplace",
        }


def _word(word: object) -> str:
    return os.fsdecode(word) if isinstance(word, bytes) else str(word)


def files_in(folder: Path) -> list[str]:
    """All files below a folder, hidden ones among them."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
