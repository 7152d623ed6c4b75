"""What a command reads of a campaign."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from savgs_ident.plants.quarter_car.plant import QuarterCar
from savgs_ident.plants.quarter_car.rig_recordings import load_campaign
from savgs_ident.simulate.compared_tests import first_sweep


def test_the_first_sweep_that_can_be_used_is_taken(nominal_campaign: Path) -> None:
    campaign = load_campaign(nominal_campaign)
    sweep, warnings = first_sweep(campaign, QuarterCar)
    assert sweep is not None
    assert warnings == ()
    assert sweep.test == campaign.of_kind("sweep")[0].name
    assert set(sweep.channels) >= {"sprung_accel", "susp_deflection"}
    assert sweep.frequency.max() > 2.5
    np.testing.assert_allclose(sweep.input_amplitude[sweep.frequency > 0.5], 0.01375, rtol=0.01)
    dwells = replace(campaign, recordings=campaign.of_kind("dwell"))
    assert first_sweep(dwells, QuarterCar) == (None, ())
    whole = campaign.of_kind("sweep")[0]
    blind = replace(
        whole, channels={name: each for name, each in whole.channels.items() if name != "road_height"}
    )
    sweep, refused = first_sweep(replace(campaign, recordings=(blind,)), QuarterCar)
    assert sweep is None
    assert [each.code for each in refused] == ["sweep_not_used"]
    sweep, warnings = first_sweep(replace(campaign, recordings=(blind, whole)), QuarterCar)
    assert sweep is not None
    assert warnings == refused


def test_spikes_of_a_sweep_are_warned_of(nominal_campaign: Path) -> None:
    campaign = load_campaign(nominal_campaign)
    (whole,) = campaign.of_kind("sweep")
    accel = whole.channels["sprung_accel"]
    values = accel.values.copy()
    values[[9000, 12000]] += 40.0
    spiked = replace(whole, channels={**whole.channels, "sprung_accel": replace(accel, values=values)})
    sweep, warnings = first_sweep(replace(campaign, recordings=(spiked,)), QuarterCar)
    assert sweep is not None
    assert [(each.code, each.test, each.channel) for each in warnings] == [
        ("outlying_samples", whole.name, "sprung_accel")
    ]
