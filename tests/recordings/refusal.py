"""How the program refuses a file that the reader refuses."""

from pathlib import Path

from typer.testing import CliRunner

from savgs_ident.cli.app import app
from savgs_ident.core.errors import InputError


def check_refusal(path: Path, error: InputError) -> None:
    """``savgs-ident inspect`` of ``path`` says ``error`` whole, with exit code 2 and nothing beside it."""
    words = ["inspect", str(path), "--out", str(path.parent / "out"), "--quiet"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 2
    assert "".join(f"Error: {error}".split()) == "".join(done.stderr.split())
    assert done.stdout == ""
