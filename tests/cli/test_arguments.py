"""Options that take several values at once."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from savgs_ident.cli.options import spread_values

from ..in_one_test import over

WORDS = st.lists(
    st.sampled_from(["--free", "--quiet", "mu_r", "c_sd", "run.csv", "2.5", "--frequency", "-h"])
)


@over(
    ("line", "expected"),
    [
        ("fit run.csv --free mu_r c_sd", "fit run.csv --free mu_r --free c_sd"),
        ("fit --free mu_r c_sd run.csv", "fit --free mu_r --free c_sd run.csv"),
        ("fit --free mu_r --free c_sd x.csv", "fit --free mu_r --free c_sd x.csv"),
        ("x --frequency 1 2e0 3 --json", "x --frequency 1 --frequency 2e0 --frequency 3 --json"),
        ("diagnose --without a b run.csv", "diagnose --without a --without b run.csv"),
        ("export --to json python-control m.toml", "export --to json --to python-control m.toml"),
        ("export m.toml --to c mat -h", "export m.toml --to c --to mat -h"),
        ("fit --free", "fit --free"),
        ("fit --free --quiet mu_r", "fit --free --quiet mu_r"),
        ("simulate --frequency 1 model", "simulate --frequency 1 model"),
    ],
)  # fmt: skip
def test_further_values_get_the_option_again(line: str, expected: str) -> None:
    assert " ".join(spread_values(line.split())) == expected


def test_a_folder_of_recordings_is_no_parameter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "afternoon").mkdir()
    monkeypatch.chdir(tmp_path)
    assert spread_values(["fit", "--free", "mu_r", "afternoon"]) == ["fit", "--free", "mu_r", "afternoon"]


@given(WORDS)
def test_words_are_only_added_and_a_second_pass_adds_none(words: list[str]) -> None:
    spread = spread_values(words)
    rest = iter(spread)
    assert all(word in rest for word in words)
    assert spread_values(spread) == spread
