"""What people read of blind trials: the same numbers in the picture, on the page and in the terminal."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from rich.console import Console

from savgs_ident.diagnosis.thresholds import DEFAULTS
from savgs_ident.report.blind import blind_html, blind_record, blind_text
from savgs_ident.report.blind_figures import confusion_figure
from savgs_ident.validation.blind_marks import failed, score_of
from savgs_ident.validation.blind_score import Score
from savgs_ident.validation.varied_constants import FACTORS, KEY, VARIED, moved_marks

from .blind_answers import answer, diagnosis

SETTINGS = {"rig": "<b>rig.toml", "seed": 4}


@pytest.fixture(scope="module")
def scores() -> list[Score]:
    """Seven trials, four of them right."""
    pairs = [
        (answer("effect", "accel_lag", number=1), diagnosis("effect", "accel_lag")),
        (answer("effect", "accel_lag", number=2), diagnosis("effect", "accel_gain")),
        (answer("two", "accel_lag", "cam_scale", number=3), diagnosis("several", "accel_lag", "cam_scale")),
        (answer("none", number=4), diagnosis("none")),
        (answer("none", number=5), diagnosis("unknown", ports=["rail"])),
        (answer("unknown", "frame_mode", number=6), diagnosis("unknown", ports=["frame"])),
        (answer("effect", "cam_scale", number=7), failed("cannot be read")),
    ]
    return [score_of(truth, said) for truth, said in pairs]


def test_the_picture_counts_every_trial_once(scores: list[Score]) -> None:
    (axes,) = confusion_figure(scores).axes
    counts = {text.get_position(): int(text.get_text()) for text in axes.texts}
    assert sum(counts.values()) == len(scores)
    rows = [label.get_text() for label in axes.get_yticklabels()]
    columns = [label.get_text() for label in axes.get_xticklabels()]
    assert counts[(columns.index("accel_lag"), rows.index("accel_lag"))] == 1
    assert counts[(columns.index("accel_gain"), rows.index("accel_lag"))] == 1
    assert counts[(columns.index("failed"), rows.index("cam_scale"))] == 1


def test_right_and_wrong_are_reported_by_colour(scores: list[Score]) -> None:
    (axes,) = confusion_figure(scores).axes
    rows = [label.get_text() for label in axes.get_yticklabels()]
    columns = [label.get_text() for label in axes.get_xticklabels()]
    for cell in axes.patches:
        column, row = round(cell.get_x() + 0.5), round(cell.get_y() + 0.5)
        red, _, blue, _ = cell.get_facecolor()
        assert (blue > red) == (columns[column] == rows[row])


class _Cells(HTMLParser):
    """The text of all table rows, and the names of all elements."""

    def __init__(self) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.names: set[str] = set()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.names.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_data(self, data: str) -> None:
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip()


def test_the_page_says_every_trial_and_executes_nothing(scores: list[Score]) -> None:
    page = blind_html(scores, SETTINGS, ("savgs-ident", "blind"))
    assert page == blind_html(scores, SETTINGS, ("savgs-ident", "blind"))
    cells = _Cells()
    cells.feed(page)
    trials = {row[0]: row[1:] for row in cells.rows if row and re.fullmatch(r"\d+", row[0])}
    assert list(trials) == [str(number) for number in range(1, 8)]
    assert trials["2"][:4] == ["accel_lag", "10.0 %", "accel_gain", "wrong"]
    assert trials["3"][:4] == ["accel_lag + cam_scale", "10.0 % + 10.0 %", "accel_lag + cam_scale", "right"]
    assert trials["6"][0] == "frame_mode (not in the catalogue)"
    assert sum(row[3] == "right" for row in trials.values()) == 4
    assert "right in 4 of 7 blind campaigns" in page
    assert "script" not in cells.names
    assert "<b>rig.toml" not in page
    assert "Required rate missed" in page


def test_marks_by_other_constants_are_counted() -> None:
    """Two trials with an effect that is named; by twice the material share one of them is not, by half both are."""
    truth = answer("effect", "accel_lag")
    same, other = (
        diagnosis(kind, *named)["verdict"] for kind, named in (("effect", ["accel_lag"]), ("none", []))
    )
    varied = {name: {"0.5": same, "2.0": same} for name in VARIED}
    trials = []
    for number, doubled in enumerate((same, other)):
        said = diagnosis("effect", "accel_lag", intervals={"accel_lag_time": (0.0, 1.0)})
        said[KEY] = varied | {"material_share": {"0.5": same, "2.0": doubled}}
        drawn = replace(truth, number=number, parameters={"accel_lag_time": 0.5})
        trials.append((score_of(drawn, said), drawn, said))
    moved = {(each.constant, each.value): each for each in moved_marks(trials)}
    halved, doubled = (moved["material_share", factor * DEFAULTS.material_share] for factor in FACTORS)
    assert (halved.changed, halved.rates["named_right"].count) == (0, 2)
    assert (doubled.changed, doubled.rates["named_right"].count, doubled.rates["named_right"].total) == (
        1,
        1,
        2,
    )
    assert doubled.rates["intervals_hold"].total == 2
    page = blind_html([score for score, _, _ in trials], SETTINGS, (), list(moved.values()))
    cells = _Cells()
    cells.feed(page)
    assert [
        "material_share",
        "0.006",
        "1 of 2",
        "1 of 2",
        "1 of 2",
        "0 of 0",
        "0 of 0",
        "0 of 0",
    ] in cells.rows


def test_the_terminal_lists_what_was_wrong(scores: list[Score]) -> None:
    console = Console(width=110)
    with console.capture() as captured:
        console.print(blind_text(scores))
    wrong = captured.get().split("Wrong verdicts")[1]
    assert [line.split()[0] for line in wrong.splitlines()[2:] if line.strip()] == ["2", "5", "7"]
    assert str(scores[0]) == "trial 1: accel_lag; verdict accel_lag: right"


def test_the_record_has_rates_matrix_and_marks(scores: list[Score]) -> None:
    record = blind_record(scores, SETTINGS, ("savgs-ident", "blind"))
    assert record["trusted"] is False
    assert record["rates"]["named_right"]["count"] == 1
    assert record["rates"]["named_right"]["of"] == 3
    low, high = record["rates"]["named_right"]["interval"]
    assert 0.0 < low < 1.0 / 3.0 < high < 1.0
    assert record["confusion"]["counts"].sum() == 7
    assert [score["number"] for score in record["scores"]] == list(range(1, 8))
