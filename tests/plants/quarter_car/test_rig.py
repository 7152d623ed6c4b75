"""The shipped rig against the data sheets, and the round trip of a rig file."""

import dataclasses
import hashlib
import json
import math
import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from savgs_ident.core.errors import InputError
from savgs_ident.core.parameter import Parameter, ParameterTable, merge_parameters
from savgs_ident.plants.quarter_car.rig import (
    Rig,
    default_campaign_path,
    read_rig,
    write_rig,
)
from savgs_ident.plants.quarter_car.rig_toml import UNIT_OF

TO_BE_IDENTIFIED = ("mu_r", "mu_t", "ydot_Hth")


def test_the_values_are_those_of_the_rig_sheet(rig: Rig, rig_sheet: dict[str, Any]) -> None:
    sheet, value = rig_sheet, rig.parameters.as_dict()
    for point, (y, z) in sheet["hardpoints"].items():
        assert (value[f"{point}_y"], value[f"{point}_z"]) == pytest.approx((y, z), rel=1e-14)
    masses = sheet["masses"]
    assert (value["m_s"], value["m_u"]) == (masses["S"]["m"], sheet["totals"]["m_u"])
    assert value["m_u"] - value["m_L"] - value["m_U"] == pytest.approx(masses["K"]["m"], rel=1e-14)
    for body in ("L", "U", "K"):
        assert value[f"J_{body}"] == masses[body]["J"]
        found = (value[f"cg_{body}_y"], value[f"cg_{body}_z"])
        assert found == pytest.approx(tuple(masses[body]["cg"]), rel=1e-14)
    link, strut, tyre, rail = (sheet[key] for key in ("single_link", "strut", "tyre", "rail"))
    expected = {
        "l_SL": link["l_SL"],
        "theta_0": link["theta0"],
        "psi_nominal": link["nominal_link_angle"],
        "k_sd": strut["k_sd"],
        "l_free": strut["free_length"],
        "c_sd": strut["c_sd_linearised"],
        "k_t": tyre["k_t"],
        "c_t": tyre["c_t"],
        "r_free": tyre["free_radius"],
        "tilt": tyre["static_wheel_tilt"],
        "mu_t": tyre["mu_t"],
        "ydot_Hth": tyre["y_dot_th"],
        "mu_r": rail["mu_r"],
        "l_tb": rail["l_tb"],
        "z_tb": rail["carriage_midpoint_z"],
        "k_pre": rail["presliding_stiffness_N_per_m"],
        "c_pre": rail["presliding_damping_Ns_per_m"],
        "cam_peak_to_peak": sheet["road"]["peak_to_peak"],
        "g": sheet["g"],
        "servo_inertia": sheet["servo"]["inertia_at_link_kgm2"],
        "servo_torque_constant": sheet["servo"]["torque_constant_Nm_per_A"],
    }
    assert {name: value[name] for name in expected} == pytest.approx(expected, rel=1e-15)
    assert list(rig.damper_velocity) == strut["damper_table"]["velocity"]
    assert list(rig.damper_force) == strut["damper_table"]["force"]


def test_the_tolerances_are_those_of_the_sheets(rig: Rig, shared_rig: Path) -> None:
    tolerance = {name: entry.tolerance for name, entry in rig.parameters.items()}
    relative = {name: tolerance[name] / rig.parameters[name].value for name in tolerance}
    assert all(tolerance[f"{point}_{axis}"] == 0.0003 for point in "ABCDEGW" for axis in "yz")
    assert (tolerance["theta_0"], tolerance["l_free"], tolerance["z_tb"]) == (0.005, 0.0005, 0.01)
    shares = {"l_SL": 0.003, "m_s": 0.005, "m_u": 0.01, "k_sd": 0.015, "c_sd": 0.08, "k_t": 0.05, "c_t": 0.5}
    shares |= {"l_tb": 0.01, "k_pre": 0.1, "c_pre": 0.1, "accel_gain": 0.005, "deflection_gain": 0.005}
    shares |= dict.fromkeys(("m_L", "m_U", "J_L", "J_U", "J_K"), 0.1) | {"servo_torque_constant": 0.03}
    assert {name: relative[name] for name in shares} == pytest.approx(shares, rel=1e-12)
    for name in ("psi_nominal", "g", "r_free", "tilt", "cam_peak_to_peak", *TO_BE_IDENTIFIED):
        assert tolerance[name] == 0.0
    motor = json.loads((shared_rig / "motor_sheet.json").read_text())
    assert rig.parameters["motor_speed_limit"].value == pytest.approx(
        motor["motor_speed_limit_rpm"] * 2.0 * math.pi / 60.0, rel=1e-14
    )
    assert relative["motor_torque_constant"] == pytest.approx(0.06)
    assert relative["motor_static_friction"] == pytest.approx(0.30)


def test_the_torque_constant_of_the_motor_is_that_of_its_flux(rig: Rig) -> None:
    value = rig.parameters.as_dict()
    torque_constant = 1.5 * value["motor_pole_pairs"] * value["motor_flux_linkage"]
    assert value["motor_torque_constant"] == pytest.approx(torque_constant, rel=2e-3)


def test_the_shipped_damper_has_the_linearised_damping_it_states(rig: Rig) -> None:
    """Energy over a cycle of 0.15 m/s amplitude, with straight lines between the points of the table."""
    amplitude, samples = 0.15, 20_000
    velocity = [amplitude * math.cos(2.0 * math.pi * (n + 0.5) / samples) for n in range(samples)]
    table = list(zip(rig.damper_velocity, rig.damper_force, strict=True))

    def force(v: float) -> float:
        (v0, f0), (v1, f1) = next(pair for pair in pairwise(table) if v <= pair[1][0])
        return f0 + (f1 - f0) * (v - v0) / (v1 - v0)

    power = sum(force(v) * v for v in velocity) / samples
    assert power / (amplitude**2 / 2.0) == pytest.approx(rig.parameters["c_sd"].value, rel=0.02)


def test_every_number_says_what_it_is_and_where_it_comes_from(rig: Rig) -> None:
    for entry in rig.parameters.entries:
        assert entry.about, entry.name
        assert entry.source, entry.name
        assert entry.unit == UNIT_OF[entry.name]
    for name in TO_BE_IDENTIFIED:
        assert 0.0 <= rig.parameters[name].lower < rig.parameters[name].upper < math.inf


def test_the_shipped_campaign_is_the_nominal_one(shared_rig: Path) -> None:
    digests = [
        hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (default_campaign_path(), shared_rig / "nominal" / "campaign.csv.gz")
    ]
    assert digests[0] == digests[1]


def test_reading_a_rig_does_not_import_jax() -> None:
    code = (
        "import sys, savgs_ident.plants.quarter_car.rig;"
        "sys.exit('jax' in sys.modules or 'matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_what_is_written_is_read_again(rig: Rig, tmp_path: Path) -> None:
    mount = Parameter("mount_compliance", 1.7e-6, "m/N", 1e-6, 0.0, about="top mount", source="fitted")
    identified = dataclasses.replace(
        rig,
        name='gt rear, identified \u2013 "quoted"',
        parameters=rig.parameters.with_values({"mu_r": 0.1 + 0.2}) + ParameterTable((mount,)),
        provenance={
            "data": {"sha256": "ab" * 32, "tests": ["dwell_0.5Hz", "dwell_0.8Hz"]},
            "free": ["mu_r", "c_sd"],
            "covariance": [[1.23456789e-9, -2e-5], [-2e-5, 12.5]],
            "chi2": 301.25,
            "converged": True,
        },
    )  # fmt: skip
    path = tmp_path / "model.toml"
    write_rig(identified, path)
    assert read_rig(path) == identified
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    assert document["rail"]["mu_r"]["value"] == 0.1 + 0.2
    assert document["effects"]["mount_compliance"]["unit"] == "m/N"
    assert list(document)[-1] == "provenance"


def test_writing_leaves_nothing_else_behind_and_replaces_whole(rig: Rig, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    write_rig(rig, path)
    before = path.read_text()
    for bad in ({"where": object()}, {"where": None}):
        with pytest.raises(InputError, match=r"provenance\.where cannot be written"):
            write_rig(dataclasses.replace(rig, provenance=bad), path)
    odd = ParameterTable((Parameter("length", 1.0, "mm"),))
    with pytest.raises(InputError, match="unknown unit 'mm'"):
        write_rig(dataclasses.replace(rig, parameters=rig.parameters + odd), path)
    part = ParameterTable(rig.parameters.entries[1:])
    with pytest.raises(InputError, match="no parameter 'A_y'"):
        write_rig(dataclasses.replace(rig, parameters=part), path)
    assert path.read_text() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["model.toml"]


def test_writing_where_one_cannot_is_said(rig: Rig, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        write_rig(rig, tmp_path / "no such folder" / "model.toml")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_rig(rig, tmp_path / "folder")
    assert [entry.name for entry in tmp_path.iterdir()] == ["folder"]


def test_the_rig_wins_over_what_effects_bring(rig: Rig) -> None:
    brought = ParameterTable(
        (Parameter("mu_r", 0.5, "1", lower=0.0, upper=1.0), Parameter("mount", 0.0, "m/N", lower=0.0))
    )
    merged = merge_parameters(rig.parameters, brought, brought)
    assert merged["mu_r"] == rig.parameters["mu_r"]
    assert list(merged) == [*rig.parameters, "mount"]
    assert merge_parameters(rig.parameters) == rig.parameters
    with pytest.raises(InputError, match="'mu_r' is given in '1' and in 'N'"):
        merge_parameters(rig.parameters, ParameterTable((Parameter("mu_r", 0.5, "N"),)))
