"""A loader under test: a good file, how the package reads it, and which of its functions that exercises."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path


class Form(StrEnum):
    """What a file is made of: it decides how it is damaged beyond its bytes."""

    json = "JSON"
    lines = "JSON lines"
    toml = "TOML"
    table = "CSV"
    packed_table = "CSV, gzipped"
    mcap = "MCAP"
    hdf5 = "HDF5"
    matlab = "MATLAB"
    parquet = "Parquet"
    sqlite = "SQLite"


@dataclass(frozen=True)
class Original:
    """Good files: several that are as good (one is drawn), and what must stand ``beside`` them, by path."""

    contents: tuple[bytes, ...]
    beside: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Loader:
    """One way in which the package reads a file.

    Attributes:
        name: on the command line.
        about: what the file is.
        file: its path within a folder.
        form: what it is made of.
        original: good files of this kind.
        read: reads the file as the package does, and gives all that was read, so that it can be looked at; None
            where the package leaves a file alone that it does not take.
        covers: functions of the package that parse the file, ``module.function`` below savgs_ident.
    """

    name: str
    about: str
    file: str
    form: Form
    original: Callable[[], Original]
    read: Callable[[Path], object]
    covers: tuple[str, ...]
