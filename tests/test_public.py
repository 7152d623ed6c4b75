"""The public interface: complete, documented, loaded when it is used, and what the README does with it."""

import ast
import inspect
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from functools import partial
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

import savgs_ident as si
from savgs_ident.cli.app import app
from savgs_ident.core import presentation
from savgs_ident.fit.public import fit as fit_call
from savgs_ident.report import presenters

from .in_one_test import over
from .relaxed import with_kept_programs

REPOSITORY = Path(__file__).resolve().parents[1]
HEAVY = ("jax", "numpy", "scipy", "pandas", "matplotlib", "control", "casadi", "rich", "typer")

CALLS = {
    "demo": "demo",
    "inspect": "inspect",
    "fit": "fit",
    "bode": "compare",
    "simulate": "simulate",
    "posterior": "sample",
    "calibrate": "calibrate",
    "diagnose": "diagnose",
    "false-alarms": "false_alarms",
    "blind": "blind",
    "linearise": "linearise",
    "design": "design",
    "closed-loop": "close_loop",
    "export": "export",
    "campaign": "run_campaigns",
    "check-plant": "check_plant",
    "plan": "plan",
}
"""Each command and its public call."""


@over("name", si.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    assert inspect.getdoc(getattr(si, name))


def test_what_is_listed_is_what_there_is() -> None:
    assert len(set(si.__all__)) == len(si.__all__)
    assert set(dir(si)) == {*si.__all__, "__version__"}
    with pytest.raises(AttributeError, match="has no attribute 'magic'"):
        si.magic  # noqa: B018


def test_a_room_of_the_same_name_does_not_hide_a_call() -> None:
    assert si.fit is fit_call
    __import__("savgs_ident.simulate.periodic")
    __import__("savgs_ident.export.public")
    assert callable(si.simulate)
    assert callable(si.export)


def test_every_command_is_a_public_call() -> None:
    commands = {each.name or each.callback.__name__.replace("_", "-") for each in app.registered_commands}  # type: ignore[union-attr]
    assert commands == set(CALLS)
    assert set(CALLS.values()) <= set(si.__all__)


COMMAND_MAY_IMPORT = ("savgs_ident", "savgs_ident.cli", "savgs_ident.core.errors", "savgs_ident.core.files")
"""Besides the public interface: what commands share, errors, and the folder that is made before the work begins."""


@over("command", CALLS)
def test_a_command_is_thin_and_makes_that_call(command: str) -> None:
    text = _source_of(command).read_text()
    called = set(re.findall(r"\bsi\.([a-z_]+)\(", text))
    assert CALLS[command] in called
    assert called <= set(si.__all__)


@over("source", [*CALLS, "options"])
def test_a_command_imports_nothing_deeper(source: str) -> None:
    imported = set()
    for node in ast.walk(ast.parse(_source_of(source).read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0
            imported.add(str(node.module))
        elif isinstance(node, ast.Import):
            imported.update(each.name for each in node.names)
    own = {each for each in imported if each.split(".")[0] == "savgs_ident"}
    deeper = {each for each in own if not each.startswith("savgs_ident.cli.")} - set(COMMAND_MAY_IMPORT)
    assert not deeper


def _source_of(command: str) -> Path:
    return REPOSITORY / "savgs_ident/cli" / f"{command.replace('-', '_')}.py"


@over("name", [name for name in si.__all__ if inspect.isfunction(getattr(si, name))])
def test_what_a_call_takes_and_returns_is_public(name: str) -> None:
    """Classes of this package, also within unions and sequences."""
    public = {getattr(si, each) for each in si.__all__ if inspect.isclass(getattr(si, each))}
    hints = get_type_hints(getattr(si, name), localns={"Figure": object})
    private = {
        each
        for hint in hints.values()
        for each in _within(hint)
        if inspect.isclass(each) and each.__module__.startswith("savgs_ident") and each not in public
    }
    assert not private


def _within(hint: object) -> Iterator[object]:
    """A type and all that it is made of."""
    yield hint
    for inner in get_args(hint):
        yield from _within(inner)


@over("name", [name for name in si.__all__ if inspect.isclass(getattr(si, name))])
def test_every_result_has_a_presenter(name: str) -> None:
    kind = getattr(si, name)
    if (
        issubclass(kind, presentation.Result)
        and kind is not presentation.Result
        and not inspect.isabstract(kind)
    ):
        assert is_dataclass(kind)
        shown = getattr(presenters, kind.presenter)
        for method in ("record", "shown", "page", "doubts", "figures", "write"):
            assert callable(getattr(shown, method))


def test_importing_the_package_loads_nothing_and_takes_no_time() -> None:
    code = (
        "import sys, time\n"
        "began = time.perf_counter()\n"
        "import savgs_ident\n"
        "took = time.perf_counter() - began\n"
        f"print([name for name in {HEAVY!r} if name in sys.modules], took)\n"
    )
    times = []
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        loaded, _, took = done.stdout.strip().rpartition(" ")
        assert loaded == "[]"
        times.append(float(took))
    assert min(times) < 0.1


@pytest.mark.slow
def test_nothing_is_computed_before_the_compiler_is_set_up() -> None:
    """What is computed as a module is loaded has XLA read its flags, and programs of later runs differ."""
    code = (
        "import jax, savgs_ident as si\n"
        "from jax._src.xla_bridge import backends_are_initialized\n"
        "for name in si.__all__:\n"
        "    getattr(si, name)\n"
        "    assert not backends_are_initialized(), name\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_effects_are_added_by_name() -> None:
    model = si.QuarterCar(si.load_rig()) + "rail_coulomb" + "tyre_friction"
    assert model == si.load_model()
    assert (model + "rail_coulomb").effects == model.effects
    assert model.name == "simtr"
    assert model.free() == ("mu_r", "mu_t", "ydot_Hth", "c_sd")
    assert si.QuarterCar(si.load_rig()).free() == ("c_sd",)
    # What a further effect brings along is known from nowhere; what it shares with the sheet is known to a tolerance.
    assert (model + "rail_stribeck").free() == (*model.free(), "stribeck_rise", "stribeck_velocity")
    assert (model + "accel_lag").free(("c_sd",)) == ("c_sd",)
    with pytest.raises(si.InputError, match=r"there is no effect 'magic'\. Remedy: choose among"):
        model + "magic"


def test_a_result_shows_itself_and_writes_what_the_command_writes(tmp_path: Path) -> None:
    summary = si.inspect(si.load_campaign(si.default_campaign_path()), orders=3)
    assert str(summary).startswith(f"{si.default_campaign_path()}: ")
    assert summary._repr_html_().startswith("<pre")
    text = summary.to_json(tmp_path / "inspect.json")
    assert (tmp_path / "inspect.json").read_text() == text
    assert json.loads(text)["tests"] == len(summary.campaign.recordings)
    assert summary.doubts == ()
    assert summary.figure_names == ("inspect",)
    with pytest.raises(si.InputError, match="there is no report on a CampaignSummary"):
        summary.to_html(tmp_path / "inspect.html")
    with pytest.raises(si.InputError, match=r"there is no figure 'bode'\. Remedy: choose among: inspect"):
        summary.figure("bode")
    with pytest.raises(si.InputError, match="a CampaignSummary has no frequency response"):
        si.plot_bode(summary)


SHIPPED = {"mu_r": 0.03, "mu_t": 0.25, "ydot_Hth": 0.05, "c_sd": 0.93 * 5792.0}
"""What the shipped campaign was made with, in SI."""


@pytest.mark.slow
def test_the_ten_lines_of_the_readme_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With fewer draws than by default."""
    monkeypatch.setattr(si, "sample", partial(si.sample, target_ess=150.0, patience=0.0))
    section = (REPOSITORY / "README.md").read_text().split("## From Python")[1]
    code = section.split("```python\n")[1].split("```")[0]
    assert set(re.findall(r"^(?:import|from) .*$", code, re.M)) == {"import savgs_ident as si"}
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with with_kept_programs():
        exec(compile(code, "README.md", "exec"), names)
    fit, post, gap, loop = (names[name] for name in ("fit", "post", "gap", "loop"))
    assert isinstance(fit, si.Fit)
    assert isinstance(post, si.Posterior)
    assert isinstance(gap, si.Diagnosis)
    assert isinstance(loop, si.LoopStudy)
    assert fit.trusted
    assert (post.sampler, post.convergence.converged) == ("nuts", True)
    assert abs(post["mu_r"].median - fit["mu_r"].value) < fit["mu_r"].stderr
    for name, true in SHIPPED.items():
        assert post[name].q025 < true < post[name].q975, name
    assert (gap.verdict.kind, gap.verdict.effects, gap.converged) == ("none", (), True)
    assert loop.stable
    assert (tmp_path / "gap.html").stat().st_size > 100_000
    assert json.loads(fit.to_json())["parameters"]["mu_r"]["value"] == fit["mu_r"].value
    assert list((tmp_path / "out").iterdir())
