"""``savgs-ident bode``: a model against a campaign, without fitting."""

from pathlib import Path
from typing import Annotated

import typer

from savgs_ident.cli.console import Voice, complain
from savgs_ident.cli.guard import NOT_TRUSTED, OK, ends_with_code
from savgs_ident.cli.options import CampaignArgument, ChannelsOption, JsonOption, ModelArgument, QuietOption


@ends_with_code
def bode(
    model: ModelArgument,
    campaign: CampaignArgument,
    channels: ChannelsOption = None,
    orders: Annotated[int, typer.Option("--orders", min=1, help="Highest harmonic order to compare.")] = 9,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the files.")] = Path(
        "out/bode"
    ),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Draw the response of a model against a campaign: magnitude, phase, peak to peak, residuals. No fitting.

    Writes bode.png, bode.pdf and bode.json.

    Exit code 1 if a periodic motion was not found.

    Example: savgs-ident bode out/fit/model.toml campaign.csv.gz
    """
    from savgs_ident.cli.compare import compare, draw_comparison
    from savgs_ident.cli.models import effects_in
    from savgs_ident.core.rig import read_rig
    from savgs_ident.recordings.read import read_campaign
    from savgs_ident.report.bode_record import bode_record
    from savgs_ident.report.bode_text import bode_text
    from savgs_ident.report.files import prepare_folder, write_json
    from savgs_ident.report.terminal import plain
    from savgs_ident.responses.estimate import estimate_response
    from savgs_ident.simulate.compilation import use_persistent_cache

    voice = Voice(json, quiet)
    prepare_folder(out)
    use_persistent_cache()
    rig = read_rig(model)
    effects = effects_in(rig, model)
    with voice.working() as progress:
        progress(f"reading {campaign}")
        recorded = read_campaign(campaign, channels, progress=progress.fraction(f"reading {campaign}"))
        progress("estimating responses")
        measured = estimate_response(recorded, orders)
        compared = compare(rig, effects, measured, progress)
        record = bode_record(compared, effects)
        files = [write_json(out / "bode.json", record)]
        files += draw_comparison(rig, effects, compared, recorded.source, out, progress)
    voice.show(bode_text(record), plain("Written: " + ", ".join(str(file) for file in files)))
    voice.hand_over(record)
    if record["converged"]:
        return OK
    complain("Not to be trusted: the model's periodic motion was not found in every dwell.")
    return NOT_TRUSTED
