"""``savgs-ident bode``: a model against a campaign, without fitting."""

from pathlib import Path

from savgs_ident.cli.console import Reporter, ends_with_code
from savgs_ident.cli.options import (
    QUARTER_CAR,
    CampaignArgument,
    ChannelsOption,
    JsonOption,
    ModelArgument,
    OrdersOption,
    OutOption,
    PlantOption,
    QuietOption,
    identified_model,
    read_recorded,
)


@ends_with_code
def bode(
    model: ModelArgument,
    campaign: CampaignArgument,
    plant: PlantOption = QUARTER_CAR,
    channels: ChannelsOption = None,
    orders: OrdersOption = 9,
    out: OutOption = Path("out/bode"),
    json: JsonOption = False,
    quiet: QuietOption = False,
) -> int:
    """Draw the response of a model against a campaign: magnitude, phase, peak to peak, residuals. No fitting.

    A road of at least six seconds is cut into windows; without dwells so is a sweep or any other motion. As in
    `fit`, a plant may be held against the force of its drive along the measured motion.

    Writes bode.png, bode.pdf and bode.json; of windows spectra.png and spectra.pdf, of a drive's force drive.png
    and drive.pdf.

    Exit code 1 if a periodic motion was not found.

    Example: savgs-ident bode out/fit/model.toml campaign.csv.gz
    """
    import savgs_ident as si
    from savgs_ident.core.files import prepare_folder

    reporter = Reporter(json, quiet)
    prepare_folder(out)
    shown = identified_model(plant, model)
    with reporter.drawing() as progress:
        compared = si.compare(shown, read_recorded(campaign, channels, progress, shown), orders, progress)
        files = compared.save(out, progress)
    return reporter.conclude(compared, files)
