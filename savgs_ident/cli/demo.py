"""``savgs-ident demo``: the main job on the campaign that comes with the program."""

from pathlib import Path

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import JsonOption, OutOption, QuietOption, command_line


@ends_with_code
def demo(out: OutOption = Path("out/demo"), json: JsonOption = False, quiet: QuietOption = False) -> int:
    """Do the main job on the campaign that comes with the program: identify the rig and draw its response.

    Writes fit.json, model.toml, bode.png and bode.pdf.

    Exit code 1 if the fit did not converge, the model does not explain the data, or they do not identify every
    parameter.

    Example: savgs-ident demo
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    with reporter.working() as progress:
        found = si.demo(progress, command=command_line())
        files = found.save(out, progress)
    return reporter.conclude(found, files)
