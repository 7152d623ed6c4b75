"""Options that take several values at once: ``--free mu_r c_sd`` for ``--free mu_r --free c_sd``."""

from collections.abc import Callable, Sequence
from pathlib import Path


def _is_name(word: str) -> bool:
    return word.isidentifier() and not Path(word).exists()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_format(word: str) -> bool:
    return word[:1] != "-" and word.replace("-", "_").isidentifier() and not Path(word).exists()


SEVERAL: dict[str, Callable[[str], bool]] = {
    "--free": _is_name,
    "--without": _is_name,
    "--frequency": _is_number,
    "--to": _is_format,
}
"""The options, and what a further value of each looks like; a word that does not is an argument."""


def spread_values(words: Sequence[str]) -> list[str]:
    """The command line with the option repeated before each of its further values.

    >>> spread_values(["fit", "--free", "mu_r", "c_sd", "--quiet", "run.csv"])
    ['fit', '--free', 'mu_r', '--free', 'c_sd', '--quiet', 'run.csv']
    """
    out: list[str] = []
    option, first = "", False
    for word in words:
        if word in SEVERAL:
            option, first = word, True
        elif option and first and not word.startswith("--"):
            first = False
        elif option and not first and SEVERAL[option](word):
            out.append(option)
        else:
            option = ""
        out.append(word)
    return out
