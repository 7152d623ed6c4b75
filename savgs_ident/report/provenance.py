"""Where an identified rig comes from: data, program, options, and how well its numbers are known."""

from collections.abc import Sequence

from savgs_ident.core.files import spelled_out
from savgs_ident.fit.result import Fit
from savgs_ident.recordings.recording import Campaign
from savgs_ident.report.origin import versions_of

_PACKAGES = ("jax", "optimistix", "numpy", "scipy")


def provenance(fit: Fit, campaign: Campaign, command: Sequence[str]) -> dict[str, object]:
    """The table ``[provenance]`` of a ``model.toml``.

    ``before`` holds the values that the estimated parameters had before the fit, the centres of their priors;
    the covariance is in the order of its names. SI.
    """
    return {
        "command": spelled_out(" ".join(command)),
        "data": spelled_out(campaign.source),
        "data_sha256": campaign.sha256,
        "effects": list(fit.effects),
        "free": list(fit.free_names),
        "known_to_tolerance": [each.name for each in fit.estimates if not each.free],
        "quantity": fit.quantity,
        "orders": fit.orders,
        "chi2": float(fit.chi2),
        "dof": int(fit.dof),
        "status": fit.status.name.lower(),
        "trusted": bool(fit.trusted),
        "before": {each.name: each.prior for each in fit.estimates},
        "versions": versions_of(_PACKAGES),
        "covariance": {
            "names": [each.name for each in fit.estimates],
            "matrix": fit.covariance.tolist(),
        },
    }
