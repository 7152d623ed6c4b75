"""``savgs-ident linearise``: the linear models of a rig, and how far each is from the rig."""

from pathlib import Path

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    EffectsOption,
    JsonOption,
    ModelArgument,
    OutOption,
    QuietOption,
    command_line,
    effects_of,
)


@ends_with_code
def linearise(
    model_file: ModelArgument,
    model: EffectsOption = None,
    out: OutOption = Path("out/linearise"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Linearise a model: stiffness, damping and link at the wheel, and how far linear models are from the rig.

    The linear equivalent over the link angle with the constants and parabolas that stand for it; equation (8) of
    the paper and the exact linearisation against the nonlinear model at small motions; friction and damper as
    describing functions at the size of the test.

    Writes linearise.json (with the state space of equation (8)), linearise.html (the report), and as .png and
    .pdf alpha, responses and, with friction, described.

    Exit code 1 if the exact linearisation is not the nonlinear model at small motions, or the rig file's own fit is
    not to be trusted.

    Example: savgs-ident linearise out/fit/model.toml
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    shown = si.load_model(model_file, effects_of(model))
    with reporter.working() as progress:
        study = si.linearise(shown, progress, command=command_line())
        files = study.save(out, progress)
    return reporter.conclude(study, files)
