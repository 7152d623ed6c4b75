"""A text file, plain or gzipped, as blocks of whole lines: bounded memory, and what is whole of a cut file.

gzip is undone here with ``zlib`` itself, because Python's ``gzip`` throws away the last part of a file that
ends too early, and that part is good data.
"""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from savgs_ident.core.errors import InputError
from savgs_ident.recordings.reading import Progress

GZIP_MAGIC = b"\x1f\x8b"
_RAW_BLOCK = 1 << 18
_TEXT_BLOCK = 1 << 22
_LONGEST_LINE = 1 << 20


class TextBlocks:
    """Iterate to get blocks of whole lines (bytes, each block ends with a newline).

    After the last block, ``cut`` says why the file ended early (empty if it did not) and ``tail`` is the
    line without a newline that was left over.
    """

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path = path
        self.progress = progress
        self.cut = ""
        self.tail = b""

    def __iter__(self) -> Iterator[bytes]:
        with self.path.open("rb") as stream:
            zipped = stream.read(2) == GZIP_MAGIC
            stream.seek(0)
            parts = self._inflated(stream) if zipped else self._raw(stream)
            waiting, size = [], 0
            for part in parts:
                waiting.append(part)
                size += len(part)
                if size >= _TEXT_BLOCK:
                    block, rest = self._split(b"".join(waiting))
                    waiting, size = [rest], len(rest)
                    if block:
                        yield block
            block, self.tail = self._split(b"".join(waiting))
            if block:
                yield block

    def _split(self, text: bytes) -> tuple[bytes, bytes]:
        end = text.rfind(b"\n") + 1
        if len(text) - end > _LONGEST_LINE:
            raise InputError(
                f"has a line longer than {_LONGEST_LINE} bytes",
                source=self.path,
                remedy="this is not a table of measurements: give a CSV or MCAP file",
            )
        return text[:end], text[end:]

    def _raw(self, stream: BinaryIO) -> Iterator[bytes]:
        total = max(self.path.stat().st_size, 1)
        read = 0
        while part := stream.read(_RAW_BLOCK):
            read += len(part)
            self.progress(min(read / total, 1.0))
            yield part

    def _inflated(self, stream: BinaryIO) -> Iterator[bytes]:
        inflater = zlib.decompressobj(wbits=31)
        try:
            for raw in self._raw(stream):
                pending = raw
                while pending:
                    if inflater.eof:
                        if not pending.startswith(GZIP_MAGIC):
                            return
                        inflater = zlib.decompressobj(wbits=31)
                    text = inflater.decompress(pending, _TEXT_BLOCK)
                    pending = inflater.unused_data if inflater.eof else inflater.unconsumed_tail
                    if text:
                        yield text
        except zlib.error as error:
            self.cut = f"its compressed data is damaged ({error})"
        else:
            if not inflater.eof:
                self.cut = "its compressed data ends too early"
