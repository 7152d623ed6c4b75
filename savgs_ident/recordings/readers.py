"""The file formats that are read. A new one is a file with a :class:`Reader` and one line here."""

from pathlib import Path

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.csv_reader import CSV
from savgs_ident.recordings.mcap_reader import MCAP
from savgs_ident.recordings.reading import Reader

READERS: tuple[Reader, ...] = (
    CSV,
    MCAP,
)


def reader_for(path: Path) -> Reader:
    """The reader of ``path``: by its first bytes, else, for plain text, by its suffix.

    Raises :class:`InputError` where no reader takes the file, or its bytes are not what its suffix says.
    """
    with path.open("rb") as stream:
        head = stream.read(16)
    name = path.name.lower()
    for reader in READERS:
        if head.startswith(reader.magic):
            return reader
    for reader in READERS:
        if not name.endswith(reader.suffixes):
            continue
        if reader.plain_text:
            return reader
        what = "is empty" if not head else f"is not an {reader.name} file: its first bytes are {head[:8]!r}"
        raise InputError(what, source=path, remedy="copy the file again, or give another")
    raise InputError(
        f"has a suffix that no reader knows ('{path.suffix}')",
        source=path,
        remedy="give " + ", ".join(suffix for reader in READERS for suffix in reader.suffixes),
    )


def is_campaign_file(path: Path) -> bool:
    """Whether a file in a folder has the suffix of a recording."""
    return path.is_file() and path.name.lower().endswith(tuple(s for r in READERS for s in r.suffixes))
