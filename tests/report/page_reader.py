"""How tests read a page, and a name that nobody should give to anything."""

from html.parser import HTMLParser

HOSTILE = "<script>x</script>\"'&[bold red]\x1b[2J\u202etxt"


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
