"""What a report follows from: data, model file, command and versions. No date: the same run gives the same bytes."""

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from savgs_ident import __version__
from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.recording import Campaign


@dataclass(frozen=True)
class Origin:
    """Where a result comes from.

    Attributes:
        command: the command line.
        data: the campaign's file or folder.
        data_sha256: digest of the bytes read.
        model: the rig file that the run started from.
        versions: of the packages that computed it.
        warnings: what the checks of the data found.
    """

    command: tuple[str, ...]
    data: str
    data_sha256: str
    model: str
    versions: Mapping[str, str]
    warnings: tuple[DataWarning, ...] = ()


def origin_of(
    campaign: Campaign,
    model: object,
    command: Sequence[str],
    packages: Sequence[str],
    warnings: Sequence[DataWarning] = (),
) -> Origin:
    """The origin of a result from ``campaign`` and the rig file ``model``.

    ``packages`` are those whose version matters besides Python's and this one's; ``warnings`` what was found
    after the campaign was read.
    """
    return Origin(
        command=tuple(command),
        data=campaign.source,
        data_sha256=campaign.sha256,
        model=str(model),
        versions=versions_of(packages),
        warnings=(*campaign.warnings, *warnings),
    )


def versions_of(packages: Sequence[str]) -> dict[str, str]:
    """The versions of this package, of Python and of ``packages``, by name."""
    found = {"savgs_ident": __version__, "python": platform.python_version()}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found
