"""Every command of the program in a row: what it has to be given."""

from typer.main import get_command

from savgs_ident.cli.app import app

ROWS: dict[str, tuple[str, ...]] = {
    "demo": (),
    "inspect": ("{campaign}",),
    "fit": ("{campaign}",),
    "bode": ("{rig}", "{campaign}"),
    "simulate": ("{rig}",),
    "posterior": ("{rig}", "{campaign}"),
    "calibrate": ("{rig}", "{campaign}"),
    "diagnose": ("{campaign}",),
    "false-alarms": ("{campaign}",),
    "blind": ("--rig", "{rig}"),
    "linearise": ("{rig}",),
    "design": ("{rig}",),
    "closed-loop": ("{rig}",),
    "export": ("{rig}", "--to", "json"),
    "campaign": ("{campaign}",),
    "check-plant": ("two_mass",),
    "plan": ("--rig", "{rig}"),
}
"""The words of each; ``{campaign}`` and ``{rig}`` stand for files."""

READING = tuple(name for name, words in ROWS.items() if any("{" in word for word in words))
"""The commands that read a file."""

ASKING = tuple(name for name, words in ROWS.items() if words and words[0][0] == "{")
"""The commands that do nothing without an argument."""

COMMANDS = dict(get_command(app).commands)  # type: ignore[attr-defined]
"""The commands that there are, as the parser has them."""


def words_of(name: str, campaign: object, rig: object) -> list[str]:
    """The words of a command with these files."""
    return [word.format(campaign=campaign, rig=rig) for word in ROWS[name]]
