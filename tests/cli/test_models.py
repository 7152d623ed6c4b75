"""What a rig file says of itself, and what is told of it."""

from dataclasses import replace
from pathlib import Path

import pytest

from savgs_ident.cli.models import ModelName, rig_and_effects
from savgs_ident.core.rig import Rig, rig_text

IDENTIFIED = {"effects": ["rail_coulomb"], "status": "stalled", "trusted": False}


@pytest.mark.parametrize(("trusted", "told"), [(True, False), (False, True)])
def test_a_rig_whose_fit_is_doubtful_is_told_of(
    rig: Rig, tmp_path: Path, capsys: pytest.CaptureFixture[str], trusted: bool, told: bool
) -> None:
    path = tmp_path / "model.toml"
    path.write_text(rig_text(replace(rig, provenance=IDENTIFIED | {"trusted": trusted})), encoding="utf-8")
    assert rig_and_effects(path, None)[1] == ("rail_coulomb",)
    said = capsys.readouterr().err
    assert ("its own fit is not to be trusted (stalled)" in said) is told
    assert rig_and_effects(path, ModelName.simqc)[1] == ()
