"""What is said of spoiled recordings: right all the same, or the cause is named, or they are refused at once.

Each is fitted; diagnoses read and compare the same way, so that of them those are tried that end at once.
"""

import json
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from . import mishaps
from .conftest import Invoke
from .mishaps import (
    ACCEL,
    CHANNELS,
    DEFLECTION,
    DWELLS,
    ROAD,
    TIME,
    TRUTH,
    Spoil,
    Table,
    as_bytes,
    as_text,
    at_random,
    delayed,
    headed,
    moved,
    only,
    renamed,
    retimed,
    scaled,
    stretched,
    with_values,
)

SLOWEST, FASTEST = f"dwell_{DWELLS[0]:g}Hz", f"dwell_{DWELLS[-1]:g}Hz"
MIDDLE = f"dwell_{DWELLS[3]:g}Hz"
ALL_DWELLS = tuple(f"dwell_{hertz:g}Hz" for hertz in DWELLS)


class Mishap(NamedTuple):
    """How the campaign was spoiled, and what has to be said; ``suffix`` of its file."""

    spoil: Spoil
    says: str
    suffix: str = ".csv"


RIGHT = {
    "nothing": Mishap(lambda table: table, ""),
    "an accelerometer without a cable": Mishap(lambda table: table.drop(columns=ACCEL), ""),
    "an empty channel": Mishap(lambda table: table.assign(**{DEFLECTION: np.nan}), r"\[empty_channel\]"),
    "a channel of words": Mishap(lambda table: table.assign(**{DEFLECTION: "n/a"}), r"\[empty_channel\]"),
    "a channel that lacks in one test": Mishap(
        lambda table: table.assign(**{DEFLECTION: table[DEFLECTION].where(table["test"] != MIDDLE)}),
        r"\[empty_channel\]",
    ),
    "missing samples": Mishap(stretched(MIDDLE, 50, 80, ACCEL, np.nan), r"\[test_left_out\].*missing"),
    "an infinite sample": Mishap(stretched(MIDDLE, 50, 1, ACCEL, np.inf), r"\[impossible_samples\]"),
    "an impossible sample": Mishap(stretched(MIDDLE, 50, 1, ACCEL, 1e300), r"\[impossible_samples\]"),
    "spikes": Mishap(
        with_values(ACCEL, at_random(0.002, lambda values: values + 50.0)), r"\[outlying_samples\]"
    ),
    "dropouts": Mishap(
        with_values(ACCEL, at_random(0.005, lambda values: 0.0 * values)), r"\[outlying_samples\]"
    ),
    "a sensor that froze": Mishap(mishaps.frozen, r"\[stuck_sensor\]"),
    "a sensor that drifts": Mishap(mishaps.drifting, ""),
    "a coarse converter": Mishap(
        with_values(DEFLECTION, lambda values, _: np.round(values)), r"\[noise_above_standstill\]"
    ),
    "mains": Mishap(mishaps.humming, ""),
    "ten times the noise": Mishap(lambda _: mishaps.sound(noise=10.0), ""),
    "a motion that had not settled": Mishap(mishaps.unsettled, r"\[noise_above_standstill\]"),
    "gravity in the accelerometer": Mishap(moved(ACCEL, 9.80665), ""),
    "channels at two rates": Mishap(mishaps.at_rates, ""),
    "a clock that jitters": Mishap(
        retimed(lambda time: np.sort(time + 3e-4 * np.random.default_rng(1).standard_normal(time.size))), ""
    ),
    "a test called by another frequency": Mishap(renamed(MIDDLE, "dwell_2.5Hz"), r"\[frequency_mismatch\]"),
    "a dwell without a frequency": Mishap(renamed(MIDDLE, "dwell"), ""),
    "tests with other names": Mishap(
        lambda table: table.assign(test=table["test"].str.replace("dwell_", "run").str.replace("Hz", "")),
        r"\[test_kind_unknown\]",
    ),
    "one dwell": Mishap(only(ALL_DWELLS[2], "standstill"), ""),
    "two dwells": Mishap(only(ALL_DWELLS[2], FASTEST, "standstill"), ""),
    "no standstill": Mishap(only(*ALL_DWELLS), ""),
    "a standstill in which it moves": Mishap(renamed(MIDDLE, "standstill"), r"\[repeated_test\]"),
    "semicolons": Mishap(as_text(lambda text: text.replace(",", ";")), ""),
    "tabs": Mishap(as_text(lambda text: text.replace(",", "\t")), ""),
    "decimal commas": Mishap(as_text(lambda text: text.replace(",", ";").replace(".", ",")), ""),
    "UTF-16": Mishap(as_bytes(lambda data: data.decode().encode("utf-16")), ""),
    "a mark of the byte order": Mishap(as_bytes(lambda data: b"\xef\xbb\xbf" + data), ""),
    "Latin 1": Mishap(as_bytes(lambda data: data.replace(b"m/s^2", "m/s²".encode("latin-1"))), ""),
    "lines of Windows": Mishap(as_text(lambda text: text.replace("\n", "\r\n")), ""),
    "a comment on top": Mishap(as_text(lambda text: "# rig 3\n# operator\n" + text), ""),
    "thousands with commas": Mishap(as_text(lambda text: re.sub(r",(\d)(\d\d\d\.)", r',"\1,\2"', text)), ""),
    "a last line that was cut": Mishap(as_text(lambda text: text[:-25]), r"\[unfinished_line\]"),
    "a download that was cut": Mishap(mishaps.compressed_in_part, r"\[truncated_file\]", ".csv.gz"),
}
"""Fitted all the same; of what was left out or is doubtful there is a warning."""

DOUBTED = {
    "g": Mishap(scaled(ACCEL, 1.0 / 9.80665), "body_accel is .* as if g had been taken for m/s\\^2"),
    "g without a unit": Mishap(
        lambda table: headed(ACCEL, "body_accel")(scaled(ACCEL, 1.0 / 9.80665)(table)),  # type: ignore[arg-type]
        r"(?s)body_accel is .* as if g had been taken for m/s\^2.*|\[unit_assumed\]",
    ),
    "inches": Mishap(
        scaled(DEFLECTION, 1.0 / 25.4), "susp_deflection is .* as if inches had been taken for millimetres"
    ),
    "metres": Mishap(
        scaled(DEFLECTION, 1e-3), "susp_deflection is .* as if metres had been taken for millimetres"
    ),
    "a road in centimetres": Mishap(
        scaled(ROAD, 0.1), "road_height is .* as if centimetres had been taken for millimetres"
    ),
    "a road in metres": Mishap(scaled(ROAD, 1e-3), "road_height is .* as if metres had been taken for mil"),
    "an accelerometer upside down": Mishap(scaled(ACCEL, -1.0), "body_accel goes the other way"),
    "a potentiometer the other way round": Mishap(
        scaled(DEFLECTION, -1.0), "susp_deflection goes the other way"
    ),
    "a road downwards": Mishap(scaled(ROAD, -1.0), "road_height goes the other way"),
    "exchanged cables": Mishap(mishaps.swapped, "as if the two had been exchanged"),
}
"""Told from what the model says: the fit is not trusted and leads with the cause, a diagnosis is refused."""

MISSING = {
    "an accelerometer that clips": Mishap(
        with_values(
            ACCEL, lambda values, _: np.clip(values, *(0.6 * np.array([values.min(), values.max()])))
        ),
        r"\[clipped_sensor\]",
    ),
    "a potentiometer at its end": Mishap(
        with_values(DEFLECTION, lambda values, _: np.clip(values, -4.0, 4.0)), r"\[clipped_sensor\]"
    ),
    "an accelerometer behind a filter": Mishap(lambda table: mishaps.lagging(table, 0.02), "diagnose"),
    "a delay": Mishap(delayed(ACCEL, 2), "diagnose"),
    "a clock that runs fast": Mishap(retimed(lambda time: 1.02 * time), "diagnose"),
    "a gap in time": Mishap(
        retimed(lambda time: np.where(np.arange(time.size) > time.size // 2, time + 0.37, time)),
        r"time jumps by 0\.37",
    ),
    "all tests in one": Mishap(mishaps.without_test_names, r"\[test_kind_unknown\]"),
}
"""Not trusted: something is missing in the model, or a warning says what is wrong with the recordings."""

REFUSED = {
    "no road": Mishap(lambda table: table.drop(columns=ROAD), "road_height.* is missing"),
    "a road by another name": Mishap(headed(ROAD, "road [mm]"), "road_height.* is missing"),
    "a road that is still": Mishap(scaled(ROAD, 0.0), "road_height.* unusable"),
    "no reading": Mishap(
        lambda table: table.drop(columns=[ACCEL, DEFLECTION]), "neither body_accel nor susp_deflection"
    ),
    "no time": Mishap(lambda table: table.drop(columns=TIME), "no column is the time"),
    "an unknown unit": Mishap(headed(DEFLECTION, "susp_deflection [zorch]"), "unknown unit 'zorch'"),
    "a unit of something else": Mishap(headed(DEFLECTION, "susp_deflection [V]"), "'V' is a voltage"),
    "an angle": Mishap(headed(DEFLECTION, "susp_deflection [rad]"), "'rad' is an angle"),
    "a column twice": Mishap(
        lambda table: table.to_csv(index=False).replace(DEFLECTION, ACCEL, 1), "is there twice"
    ),
    "milliseconds as seconds": Mishap(scaled(TIME, 1e3), "check the unit of the time"),
    "seconds as milliseconds": Mishap(headed(TIME, "time [ms]"), "check the unit of the time"),
    "time that runs backwards": Mishap(retimed(lambda time: time[::-1]), "time runs backwards"),
    "a clock that was set back": Mishap(
        retimed(lambda time: np.where(np.arange(time.size) > time.size // 2, time - 1.0, time)),
        "time runs backwards by 0.99",
    ),
    "stamps with too few digits": Mishap(
        retimed(lambda time: np.repeat(time[::2], 2)[: time.size]), "repeat the time stamp"
    ),
    "a clock that stands": Mishap(retimed(lambda time: 0.0 * time), "repeat the time stamp"),
    "one sample": Mishap(lambda table: table.groupby("test", sort=False).head(1), "fewer than two samples"),
    "half a period": Mishap(lambda _: mishaps.sound(periods=0.5), "0.5 periods"),
    "a period and a half": Mishap(lambda _: mishaps.sound(periods=1.5), "1.5 periods"),
    "standstill alone": Mishap(only("standstill"), "there is no harmonic dwell"),
    "rows in no order": Mishap(mishaps.shuffled, "sort the table"),
    "two files in one": Mishap(as_text(lambda text: text + text), "is not a number"),
    "nothing": Mishap(lambda _: "", "is empty"),
    "a header alone": Mishap(lambda table: table.head(0), "no data"),
    "no text": Mishap(lambda _: bytes(range(256)) * 40, "is not a text file"),
}
"""Exit code 2, and what is wrong."""

COUNT = sum(map(len, (RIGHT, DOUBTED, MISSING, REFUSED)))


def _written(mishap: Mishap, folder: Path) -> Path:
    file = folder / f"campaign{mishap.suffix}"
    made = mishap.spoil(mishaps.sound())
    if isinstance(made, Table):
        made = made.to_csv(index=False, float_format="%.9g")
    file.write_bytes(made if isinstance(made, bytes) else made.encode())
    return file


def _outcome(invoke: Invoke, command: str, file: Path) -> tuple[int, str]:
    done = invoke(command, file, "--plant", "two_mass")
    return done.exit_code, " ".join((done.stdout + done.stderr).split())


def test_there_are_enough_of_them() -> None:
    assert COUNT >= 60
    assert set(CHANNELS) == {ROAD, ACCEL, DEFLECTION}


@pytest.mark.slow
@pytest.mark.parametrize("name", RIGHT)
def test_a_fit_is_right_all_the_same(name: str, invoke: Invoke, tmp_path: Path) -> None:
    code, said = _outcome(invoke, "fit", _written(RIGHT[name], tmp_path))
    assert re.search(RIGHT[name].says, said), said
    assert code == 0, said
    found = json.loads((tmp_path / "out/fit/fit.json").read_text())["parameters"]
    for parameter, true in TRUTH.items():
        assert abs(found[parameter]["value"] - true) < 4.0 * found[parameter]["stderr"], parameter


@pytest.mark.slow
@pytest.mark.parametrize("command", ["fit", "diagnose"])
@pytest.mark.parametrize("name", DOUBTED)
def test_what_was_recorded_otherwise_is_named(
    name: str, command: str, invoke: Invoke, tmp_path: Path
) -> None:
    code, said = _outcome(invoke, command, _written(DOUBTED[name], tmp_path))
    assert re.search(DOUBTED[name].says, said), said
    assert code == (1 if command == "fit" else 2), said


@pytest.mark.slow
@pytest.mark.parametrize("name", MISSING)
def test_a_fit_that_misses_is_not_trusted(name: str, invoke: Invoke, tmp_path: Path) -> None:
    code, said = _outcome(invoke, "fit", _written(MISSING[name], tmp_path))
    assert re.search(MISSING[name].says, said), said
    assert code == 1, said


@pytest.mark.parametrize("command", ["fit", pytest.param("diagnose", marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_refused_with_its_cause(
    name: str, command: str, invoke: Invoke, tmp_path: Path
) -> None:
    code, said = _outcome(invoke, command, _written(REFUSED[name], tmp_path))
    assert re.search(REFUSED[name].says, said), said
    assert code == 2, said
