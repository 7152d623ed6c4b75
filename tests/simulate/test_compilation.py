"""Where compiled programs are kept, and that nothing is where they cannot be."""

from pathlib import Path

import pytest

from savgs_ident.simulate import program_cache as compilation
from savgs_ident.simulate.program_cache import cache_folder, use_persistent_cache


def _homeless() -> Path:
    raise RuntimeError("Could not determine home directory.")


@pytest.mark.skipif("sys.platform != 'linux'")
def test_a_folder_that_is_named_needs_no_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(Path, "home", _homeless)
    monkeypatch.delenv("SAVGS_IDENT_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "savgs_ident" / "xla"
    monkeypatch.setenv("SAVGS_IDENT_CACHE", str(tmp_path / "mine"))
    assert cache_folder() == tmp_path / "mine"


@pytest.mark.parametrize("reported", [None, ""])
def test_a_user_without_a_home_keeps_nothing(monkeypatch: pytest.MonkeyPatch, reported: str | None) -> None:
    monkeypatch.setattr(Path, "home", _homeless)
    for name in ("SAVGS_IDENT_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
        if reported is not None:
            monkeypatch.setenv(name, reported)
    assert not use_persistent_cache()


def test_a_disk_that_is_nearly_full_keeps_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("SAVGS_IDENT_CACHE", str(tmp_path))
    monkeypatch.setattr(compilation, "LEAST_ROOM", 1 << 62)
    assert not use_persistent_cache()
