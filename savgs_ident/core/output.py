"""Results on disk: JSON and tables, each file whole or not at all."""

import csv
import io
import json
import tempfile
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path

from savgs_ident.core.errors import DataWarning
from savgs_ident.core.files import cannot_write, write_bytes

Json = dict[str, object] | list[object] | str | int | float | bool | None
"""What a JSON file can say."""


def prepare_folder(folder: Path) -> Path:
    """Make ``folder`` if need be and try to write there, so that a long run does not end in a refusal.

    Raises :class:`InputError` where it is not a folder or cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise cannot_write(folder, error) from error


def to_json(record: object) -> str:
    """``record`` as indented JSON; numpy becomes plain, a number that is not finite becomes null."""
    return json.dumps(_plain(record), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def json_bytes(record: object) -> bytes:
    """:func:`to_json` of a record as UTF-8; a byte of a file name that is no text is spelled out as JSON does."""
    return to_json(record).encode("utf-8", "backslashreplace")


def write_json(path: Path, record: object) -> Path:
    """Write :func:`json_bytes` of a record."""
    return write_bytes(path, json_bytes(record))


def write_table(path: Path, columns: Mapping[str, Sequence[object]]) -> Path:
    """Write columns, headed by their names with units, as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return write_bytes(path, text.getvalue().encode())


def warning_record(warning: DataWarning) -> dict[str, object]:
    """A warning as JSON has it."""
    return {
        "code": warning.code,
        "message": str(warning),
        "test": warning.test or None,
        "channel": warning.channel or None,
        "time_s": warning.time,
        "remedy": warning.remedy or None,
    }


def _plain(value: object) -> Json:
    if hasattr(value, "tolist"):  # Arrays and scalars of numpy, without loading it.
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not isfinite(value):
        return None
    if value is None or isinstance(value, str | int | float | bool):
        return value
    raise TypeError(f"{type(value).__name__} has no place in JSON")
