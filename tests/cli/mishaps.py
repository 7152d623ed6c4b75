"""What goes wrong with recordings before anybody fits a model to them: one small campaign, spoiled in many ways.

The plant is the linear quarter car, whose responses are known in closed form. What is said of each is in
``test_mishaps.py``.
"""

import gzip
from collections.abc import Callable

import numpy as np
import pandas as pd

from savgs_ident.plants.two_mass import PARAMETERS, closed_form

TRUTH = {"k": 5.5e4, "c": 2.5e3}
DWELLS = (1.03, 1.41, 2.03, 3.07, 5.1, 8.3)
RATE, PERIODS = 200.0, 10
ROAD_MM = 8.0
NOISE = {"body_accel [m/s^2]": 0.01, "susp_deflection [mm]": 0.02}

TIME, ROAD, ACCEL, DEFLECTION = "time [s]", "road_height [mm]", "body_accel [m/s^2]", "susp_deflection [mm]"
CHANNELS = (ROAD, ACCEL, DEFLECTION)

Table = pd.DataFrame
Spoil = Callable[[Table], Table | str | bytes]


def sound(
    dwells: tuple[float, ...] = DWELLS, periods: float = PERIODS, rate: float = RATE, noise: float = 1.0
) -> Table:
    """The campaign as it should be: dwells, and two seconds at rest."""
    random = np.random.default_rng(3)
    accel, deflection = closed_form(PARAMETERS.with_values(TRUTH).as_dict(), np.array(dwells)).T
    tests = []
    for d, hertz in enumerate(dwells):
        time = np.arange(round(periods / hertz * rate)) / rate
        turn = np.exp(2j * np.pi * hertz * time)
        exact = (
            ROAD_MM * turn.real,
            (1e-3 * ROAD_MM * accel[d] * turn).real,
            (ROAD_MM * deflection[d] * turn).real,
        )
        tests.append(_test(f"dwell_{hertz:g}Hz", time, exact, noise, random))
    still = np.arange(round(2.0 * rate)) / rate
    tests.append(_test("standstill", still, (np.zeros(still.size),) * 3, noise, random))
    return pd.concat(tests, ignore_index=True)


def _test(
    name: str, time: np.ndarray, exact: tuple[np.ndarray, ...], noise: float, random: np.random.Generator
) -> Table:
    values = dict(zip(CHANNELS, exact, strict=True))
    for channel, size in NOISE.items():
        values[channel] = values[channel] + noise * size * random.standard_normal(time.size)
    return pd.DataFrame({"test": name, TIME: time} | values)


def _of_dwells(table: Table) -> "pd.Series[bool]":
    return table["test"] != "standstill"


def scaled(column: str, factor: float) -> Spoil:
    """A unit that is not the header's, or a sign."""
    return lambda table: table.assign(**{column: table[column] * factor})


def headed(column: str, other: str) -> Spoil:
    """Another header."""
    return lambda table: table.rename(columns={column: other})


def moved(column: str, offset: float) -> Spoil:
    """An offset, the same at all times."""
    return lambda table: table.assign(**{column: table[column] + offset})


def with_values(column: str, change: Callable[[np.ndarray, np.random.Generator], np.ndarray]) -> Spoil:
    """Other values in the dwells."""

    def spoil(table: Table) -> Table:
        table, random = table.copy(), np.random.default_rng(11)
        for name, rows in table.groupby("test", sort=False).groups.items():
            if name != "standstill":
                table.loc[rows, column] = change(table.loc[rows, column].to_numpy().copy(), random)
        return table

    return spoil


def retimed(change: Callable[[np.ndarray], np.ndarray]) -> Spoil:
    """Another clock in the dwells."""

    def spoil(table: Table) -> Table:
        table = table.copy()
        for name, rows in table.groupby("test", sort=False).groups.items():
            if name != "standstill":
                table.loc[rows, TIME] = change(table.loc[rows, TIME].to_numpy())
        return table

    return spoil


def as_text(change: Callable[[str], str]) -> Spoil:
    """Another text."""
    return lambda table: change(table.to_csv(index=False, float_format="%.9g"))


def as_bytes(change: Callable[[bytes], bytes]) -> Spoil:
    """Other bytes."""
    return lambda table: change(table.to_csv(index=False, float_format="%.9g").encode())


def at_random(share: float, change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., np.ndarray]:
    """Some samples changed."""

    def spoil(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
        some = random.random(values.size) < share
        values[some] = change(values[some])
        return values

    return spoil


def lagging(table: Table, seconds: float) -> Table:
    """An accelerometer behind a filter of first order."""
    table = table.copy()
    for name, rows in table.groupby("test", sort=False).groups.items():
        if name != "standstill":
            values = table.loc[rows, ACCEL].to_numpy()
            hertz = float(str(name).removeprefix("dwell_").removesuffix("Hz"))
            turn = 2j * np.pi * hertz
            amplitude = 2.0 * np.mean(values * np.exp(-turn * table.loc[rows, TIME].to_numpy()))
            change = amplitude * (1.0 / (1.0 + turn * seconds) - 1.0)
            table.loc[rows, ACCEL] = values + (change * np.exp(turn * table.loc[rows, TIME].to_numpy())).real
    return table


def delayed(column: str, samples: int) -> Spoil:
    """A channel that comes late, round the dwell, which repeats."""
    return with_values(column, lambda values, _: np.roll(values, samples))


def unsettled(table: Table) -> Table:
    """A body that swings out in each test."""
    table = table.copy()
    swing = np.exp(-0.4 * table[TIME]) * np.cos(2.0 * np.pi * 1.9 * table[TIME])
    table.loc[_of_dwells(table), DEFLECTION] += 3.0 * swing
    return table


def at_rates(table: Table) -> Table:
    """The deflection was recorded at half the rate: every other cell is empty."""
    return table.assign(**{DEFLECTION: table[DEFLECTION].where(np.arange(len(table)) % 2 == 0)})


def humming(table: Table) -> Table:
    """Mains in the accelerometer."""
    return table.assign(**{ACCEL: table[ACCEL] + 0.3 * np.sin(2.0 * np.pi * 50.0 * table[TIME])})


def drifting(table: Table) -> Table:
    """A sensor that warms."""
    return table.assign(**{DEFLECTION: table[DEFLECTION] + 0.3 * table[TIME]})


def without_test_names(table: Table) -> Table:
    """All tests in one table, one after the other."""
    time = np.arange(len(table)) / RATE
    return table.drop(columns="test").assign(**{TIME: time})


def renamed(old: str, new: str) -> Spoil:
    """Another name of a test."""
    return lambda table: table.assign(test=table["test"].replace(old, new))


def only(*tests: str) -> Spoil:
    """Fewer tests."""
    return lambda table: table[table["test"].isin(tests)]


def stretched(name: str, first: int, count: int, column: str, value: float) -> Spoil:
    """A value for a while in one test."""

    def spoil(table: Table) -> Table:
        table = table.copy()
        rows = table.index[table["test"] == name][first : first + count]
        table.loc[rows, column] = value
        return table

    return spoil


def frozen(table: Table) -> Table:
    """A sensor that stops in the middle of a test and repeats its last value."""
    table = table.copy()
    rows = table.index[table["test"] == "dwell_3.07Hz"]
    half = rows[len(rows) // 2 :]
    table.loc[half, ACCEL] = table.loc[half[0], ACCEL]
    return table


def shuffled(table: Table) -> Table:
    """Rows in no order."""
    return table.sample(frac=1.0, random_state=1)


def swapped(table: Table) -> Table:
    """The cables of two sensors exchanged."""
    return table.rename(columns={ACCEL: DEFLECTION, DEFLECTION: ACCEL})


def compressed_in_part(table: Table) -> bytes:
    """A download that was cut off."""
    whole = gzip.compress(table.to_csv(index=False).encode())
    return whole[: len(whole) // 2]
