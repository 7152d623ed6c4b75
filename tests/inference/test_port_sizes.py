"""Typical sizes that recordings contradict are replaced, others are left; the unit of a force does not matter."""

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

import savgs_ident as si
from savgs_ident.inference.port_sizes import REACHED, SHARE, sized_to
from savgs_ident.plants.two_mass import GUIDE, MOUNT, SUSPENSION, TYRE

from ..relaxed import with_kept_programs

DWELLS = (1.0, 1.6, 3.0, 8.0)
NOISE = {"body_accel": 0.02, "susp_deflection": 5e-5}


class Undeclared(si.TwoMass):
    """The same plant with sizes that nobody looked at: far too small at the suspension, too large elsewhere."""

    ports: ClassVar[tuple[si.Port, ...]] = (
        replace(SUSPENSION, displacement=1e-6, velocity=1e-5),
        replace(GUIDE, force=1e6),
        replace(MOUNT, displacement=1.0, force=1.0),
        *(port for port in si.TwoMass.ports if port.name not in ("suspension", "guide", "mount")),
    )


@pytest.fixture(scope="module", autouse=True)
def _relaxed() -> Iterator[None]:
    with with_kept_programs():
        yield


@pytest.fixture(scope="module")
def measured() -> si.HarmonicResponse:
    model = si.PlantModel(si.TwoMass(), si.TwoMass.parameters)
    return si.simulate_dwells(model, DWELLS, {"road_height": 0.01}, NOISE, seed=1)


@pytest.mark.slow
def test_sizes_that_are_about_right_are_left(measured: si.HarmonicResponse) -> None:
    model = si.PlantModel(si.TwoMass(), si.TwoMass.parameters)
    same, warnings = sized_to(model, measured)
    assert same is model
    assert warnings == ()


@pytest.mark.slow
def test_sizes_that_are_far_off_are_those_of_the_motion(measured: si.HarmonicResponse) -> None:
    model = si.PlantModel(Undeclared(), Undeclared.parameters)
    found, warnings = sized_to(model, measured)
    assert isinstance(found, si.PlantModel)
    assert {each.code for each in warnings} == {"port_size"}
    assert sorted(each.what.split("'")[1] for each in warnings) == ["guide", "mount", "suspension"]
    deflection = np.abs(measured.harmonics[:, measured.channel("susp_deflection"), 1])
    port = found.catalogue["suspension_viscous"].port
    assert port.displacement == pytest.approx(np.max(deflection), rel=0.1)
    omega = 2.0 * np.pi * measured.frequency
    assert port.velocity == pytest.approx(np.max(omega * deflection), rel=0.1)
    stop = next(
        each for each in found.catalogue["suspension_upper_stop"].parameters if each.name.endswith("gap")
    )
    assert stop.upper == pytest.approx(REACHED * np.max(deflection), rel=0.01)
    assert found.catalogue["tyre_viscous"].port == TYRE


def test_a_force_that_matters_changes_the_readings_by_its_share(measured: si.HarmonicResponse) -> None:
    """By another way: the plant's own damping, whose force is known, is taken away."""
    model, _ = sized_to(si.PlantModel(Undeclared(), Undeclared.parameters), measured)
    assert isinstance(model, si.PlantModel)
    force = model.catalogue["guide_preload"].port.force
    p = si.TwoMass.parameters.as_dict()
    accel = np.abs(measured.harmonics[:, measured.channel("body_accel"), 1])
    assert 0.1 * SHARE < force / (p["m_s"] * np.max(accel)) < 3.0


@pytest.mark.slow
def test_what_gives_way_where_it_matters_changes_the_readings_by_their_share(
    measured: si.HarmonicResponse,
) -> None:
    """By another way: the rig is simulated with a compliance of the size that is found."""
    model, _ = sized_to(si.PlantModel(Undeclared(), Undeclared.parameters), measured)
    assert isinstance(model, si.PlantModel)
    port = model.catalogue["mount_compliance"].port
    deflection = measured.harmonics[:, measured.channel("susp_deflection"), 1]
    p = si.TwoMass.parameters.as_dict()
    load = np.abs((p["k"] + 2j * np.pi * measured.frequency * p["c"]) * deflection)
    assert port.force == pytest.approx(np.max(load), rel=0.2)
    yielding = model + "mount_compliance"
    there = {"mount_compliance_compliance": port.displacement / port.force}
    changed = si.simulate_dwells(yielding.with_values(there), DWELLS, {"road_height": 0.01}, NOISE, seed=1)
    change, whole = (
        np.linalg.norm(each[:, :, 1] / np.linalg.norm(measured.harmonics[:, :, 1], axis=0))
        for each in (changed.harmonics - measured.harmonics, measured.harmonics)
    )
    assert 0.5 * SHARE < change / whole < 2.0 * SHARE
