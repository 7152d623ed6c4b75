"""What all results have in common: where they come from, and how they show themselves.

    print(fit)                  # the table that the command prints
    fit                         # the same in a notebook
    fit.to_json("fit.json")     # the file that the command writes, to the letter
    fit.save("out/fit")         # all files of the command

Texts, pages and pictures are made in ``report``, which is above the rooms of the results in the order of imports,
and loads matplotlib. So a result only says the name of its presenter (:attr:`Result.presenter`), a function of
``savgs_ident.report.presenters``, which is loaded when something is to be shown. The command line shows and writes
results in no other way.
"""

import importlib
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import python_version
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from savgs_ident import __version__
from savgs_ident.core.errors import DataWarning, InputError
from savgs_ident.core.files import json_bytes, prepare_folder, to_json, write_bytes, write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.console import RenderableType

Progress = Callable[[str], None]
"""Is given a line about what is being done."""

_PRESENTERS = "savgs_ident.report.presenters"

_WIDTH = 110
"""Characters of a line where a result is printed."""


def no_progress(line: str) -> None:
    """Say nothing of what is being done."""
    del line


@dataclass(frozen=True)
class Origin:
    """Where a result comes from; empty where it does not come from a file.

    Attributes:
        command: the command line.
        data: the campaign's file or folder.
        data_sha256: digest of the bytes read.
        model: the rig file that the run started from.
        versions: of the packages that computed it.
        warnings: what the checks of the data found.
        rig: the rig's name.
        effects: what acts in the model besides the frictionless rig.
    """

    command: tuple[str, ...] = ()
    data: str = ""
    data_sha256: str = ""
    model: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[DataWarning, ...] = ()
    rig: str = ""
    effects: tuple[str, ...] = ()

    @property
    def with_effects(self) -> str:
        """The effects in words."""
        return ", ".join(self.effects) or "no friction"

    @property
    def command_line(self) -> str:
        """The command as it was typed, quotes left out."""
        return " ".join(self.command)

    @property
    def record(self) -> dict[str, object]:
        """From which command, data and model a result comes, as JSON has it."""
        return {
            "command": self.command,
            "data": self.data,
            "data_sha256": self.data_sha256,
            "model": self.model,
            "versions": self.versions,
        }

    def with_command(self, command: Sequence[str]) -> "Origin":
        """The same of a result that this command line made."""
        return replace(self, command=tuple(command))

    def with_versions(self, packages: Sequence[str]) -> "Origin":
        """The same with the versions of what is installed: of this package, Python and ``packages``."""
        return replace(self, versions=package_versions(packages))


def percent(share: float) -> str:
    """A share [1] in a sentence, to two digits where it is below one.

    >>> percent(0.00123), percent(1.13)
    ('0.12 %', '113 %')
    """
    return f"{100.0 * share:.2g} %" if share < 0.995 else f"{100.0 * share:.0f} %"


def package_versions(packages: Sequence[str]) -> dict[str, str]:
    """The versions of this package, of Python and of ``packages``, by name."""
    found = {"savgs_ident": __version__, "python": python_version()}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


NO_ORIGIN = Origin()
"""Of a result that comes from no file."""


class Presenter(Protocol):
    """How results of one class are shown."""

    def record(self, result: Any, /) -> Mapping[str, Any]:
        """The JSON object of the result."""

    def shown(self, result: Any, /) -> "RenderableType":
        """Tables and sentences for a terminal, and what the checks of the data found."""

    def page(self, result: Any, /) -> str | None:
        """The report as HTML; None where there is none."""

    def doubts(self, result: Any, /) -> tuple[str, ...]:
        """Why the result is not to be trusted, a sentence each; empty if it is."""

    def figures(self, result: Any, /) -> "Mapping[str, Callable[[], Figure]]":
        """What draws its figures, by name."""

    def write(self, result: Any, folder: Path, progress: Progress, /) -> Iterator[Path]:
        """Write the files of the result, the numbers first, each as soon as it is there."""


@dataclass(frozen=True)
class Result:
    """What a public call returns: a record that shows and writes itself."""

    presenter: ClassVar[str]
    """The name of its presenter in :mod:`savgs_ident.report.presenters`."""

    origin: Origin = field(default_factory=Origin, kw_only=True)
    """Where it comes from."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the result is not to be trusted, a sentence each; empty if it is."""
        return tuple(self._presenter().doubts(self))

    def rendered(self) -> "RenderableType":
        """Tables and sentences for a terminal that rich prints to."""
        return self._presenter().shown(self)

    def __str__(self) -> str:
        from rich.console import Console

        stream = io.StringIO()
        Console(file=stream, width=_WIDTH, color_system=None, highlight=False).print(self.rendered())
        return "\n".join(line.rstrip() for line in stream.getvalue().rstrip().splitlines())

    def _repr_html_(self) -> str:
        return f'<pre style="line-height: 1.2">{escape(str(self))}</pre>'

    def to_dict(self) -> dict[str, Any]:
        """The JSON object that the command writes, SI; it may hold arrays where JSON has lists."""
        return dict(self._presenter().record(self))

    def to_json(self, path: str | Path | None = None) -> str:
        """The JSON text that the command writes, also written to ``path`` if that is given.

        Raises :class:`InputError` if the file cannot be written.
        """
        record = self._presenter().record(self)
        if path is not None:
            write_json(Path(path), record)
        return to_json(record)

    def json_bytes(self) -> bytes:
        """What :meth:`to_json` writes."""
        return json_bytes(self._presenter().record(self))

    def to_html(self, path: str | Path) -> Path:
        """Write the report: one page, one file, nothing fetched.

        Raises :class:`InputError` if there is none for such a result or the file cannot be written.
        """
        page = self._presenter().page(self)
        if page is None:
            raise InputError(
                f"there is no report on a {type(self).__name__}",
                remedy="save(folder) writes its files",
            )
        return write_bytes(Path(path), page.encode())

    @property
    def figure_names(self) -> tuple[str, ...]:
        """The figures that there are of this result."""
        return tuple(self._presenter().figures(self))

    def figure(self, name: str) -> "Figure":
        """One of its figures, as matplotlib has it.

        Raises :class:`InputError` for a name that is not among :attr:`figure_names`.
        """
        figures = self._presenter().figures(self)
        if name not in figures:
            raise InputError(f"there is no figure '{name}'", remedy="choose among: " + ", ".join(figures))
        return figures[name]()

    def save(self, folder: str | Path, progress: Progress = no_progress) -> tuple[Path, ...]:
        """Write all files that the command writes to ``folder``; their paths.

        What is written stays if the rest is interrupted. Raises :class:`InputError` if a file cannot be written.
        """
        return tuple(self._presenter().write(self, prepare_folder(Path(folder)), progress))

    def _presenter(self) -> Presenter:
        found: Presenter = getattr(importlib.import_module(_PRESENTERS), self.presenter)
        return found
