"""How tests read what is said of a diagnosis: its page, its text, its record."""

import io
import json
from html.parser import HTMLParser
from typing import Any

from rich.console import Console

from savgs_ident.core.errors import DataWarning
from savgs_ident.diagnose.result import Diagnosis
from savgs_ident.report.diagnosis_record import diagnosis_record
from savgs_ident.report.diagnosis_text import diagnosis_text
from savgs_ident.report.files import to_json
from savgs_ident.report.origin import Origin

HOSTILE = "<script>x</script>\"'&[bold red]\x1b[2J\u202etxt"
SHOWN = HOSTILE.replace("\x1b", "\\x1b").replace("\u202e", "\\u202e")
ORIGIN = Origin(
    ("savgs-ident", "diagnose", "a & b.csv"), "runs/a<b>.csv", "ab" * 32, "m & m.toml", {"savgs-ident": "0.1.0"},
    (DataWarning("odd", "something", test="dwell_2"),),
)  # fmt: skip


class Reader(HTMLParser):
    """Texts and tags of a page, in order."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self._styling = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._styling = tag in ("style", "title")

    def handle_endtag(self, tag: str) -> None:
        self._styling = self._styling and tag not in ("style", "title")

    def handle_data(self, data: str) -> None:
        if data.strip() and not self._styling:
            self.texts.append(" ".join(data.split()))

    @property
    def pictures(self) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.tags if tag == "img"]


def rendered(diagnosis: Diagnosis, width: int = 100) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width, highlight=False).print(diagnosis_text(diagnosis))
    return stream.getvalue()


def record_of(diagnosis: Diagnosis) -> dict[str, Any]:
    return dict(json.loads(to_json(diagnosis_record(diagnosis, ORIGIN))))
