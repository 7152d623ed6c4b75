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


SEVERAL: dict[str, Callable[[str], bool]] = {"--free": _is_name, "--frequency": _is_number}
"""The options, and what a further value of each looks like; a word that does not is an argument."""


def spread_values(words: Sequence[str]) -> list[str]:
    """The command line with the option repeated before each of its further values.

    >>> spread_values(["fit", "--free", "mu_r", "c_sd", "--quiet", "run.csv"])
    ['fit', '--free', 'mu_r', '--free', 'c_sd', '--quiet', 'run.csv']
    """
    out: list[str] = []
    option, given = "", 0
    for word in words:
        if word in SEVERAL:
            option, given = word, 0
        elif option and given and SEVERAL[option](word):
            out.append(option)
        elif option and given:
            option = ""
        given += bool(option) and word != option
        out.append(word)
    return out
