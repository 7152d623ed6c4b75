"""docs/plants.md: the file that it shows is the one that is shipped, and its commands are those of the program."""

import re
from itertools import product
from pathlib import Path

from savgs_ident.effects.base import Port, PortKind
from savgs_ident.effects.effect import LAWS
from savgs_ident.effects.laws.stribeck import Stribeck

from ..cli.command_rows import COMMANDS

REPOSITORY = Path(__file__).resolve().parents[2]
PAGE = (REPOSITORY / "docs/plants.md").read_text("utf-8")
HARDWARE = (REPOSITORY / "docs/hardware.md").read_text("utf-8")


def test_the_file_on_the_page_is_the_one_that_is_shipped_and_has_forty_lines() -> None:
    (shown,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
    assert shown == (REPOSITORY / "examples/servo/servo.py").read_text("utf-8")
    assert len([line for line in shown.splitlines() if line.strip()]) <= 40


def test_its_commands_are_those_of_the_program() -> None:
    typed = _commands(PAGE)
    of_any_plant = {"check-plant", "plan", "inspect", "fit", "diagnose", "posterior", "blind"}
    assert {words[1] for words in typed} == of_any_plant
    _are_known(typed)


def test_the_commands_of_the_page_on_hardware_are_those_of_the_program() -> None:
    typed = _commands(HARDWARE)
    assert {words[1] for words in typed} == {"fit", "diagnose"}
    _are_known(typed)


def test_its_table_of_laws_says_where_they_can_act() -> None:
    rows = re.findall(
        r"^\| (`viscous`.*|`friction`.*|`preload`.*|`breakaway`.*|`saturating.*|`coulomb`.*) \| (.*) \|$",
        PAGE,
        re.M,
    )
    by_where = {where: set(re.findall(r"`(\w+)`", laws)) for laws, where in rows}
    sticks = ("k_pre", "c_pre")
    for contact, loaded in product((None, sticks), (False, True)):
        port = Port("p", PortKind.FORCE, "p", contact=contact, loaded=loaded)
        said = set(by_where["any"])
        said |= by_where["with a `contact`"] if contact else by_where["without a `contact`"]
        said |= by_where["`loaded`"] if loaded else set()
        said |= by_where["with a `contact`, and `loaded`"] if contact and loaded else set()
        said |= by_where["with a `contact`, and not `loaded`"] if contact and not loaded else set()
        assert said == {law.name for law in LAWS if law.suits(port)}
    assert Stribeck().typical(Port("p", PortKind.FORCE, "p"))["coefficient"] == 0.03


def _commands(page: str) -> list[list[str]]:
    blocks = re.findall(r"^```sh\n(.*?)^```$", page, re.M | re.S)
    lines = (line for block in blocks for line in block.splitlines())
    return [line.split() for line in lines if line.startswith("savgs-ident ")]


def _are_known(typed: list[list[str]]) -> None:
    for words in typed:
        known = {name for each in COMMANDS[words[1]].params for name in each.opts}
        assert {word for word in words if word.startswith("--")} <= known
