"""What is recorded in a trial: the programme of dwells, and the sensors of the rig's sheet."""

from dataclasses import dataclass
from math import ceil

DWELLS = (
    0.5, 0.8, 1.1, 1.4, 1.6, 1.75, 1.85, 1.95, 2.0, 2.05, 2.15, 2.25, 2.3, 2.35, 2.4, 2.45, 2.55, 2.65, 2.75,
    2.85, 3.0, 3.25, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0,
)  # fmt: skip
"""The frequencies of the shipped campaign's dwells [Hz]."""


@dataclass(frozen=True)
class Programme:
    """The tests of a campaign.

    Attributes:
        dwells: frequencies [Hz], increasing.
        periods: a dwell holds at least so many whole periods,
        least: and lasts at least so long [s].
        standstill: length of the standstill [s].
        sweep: length of the sweep from 0 to ``sweep_end`` Hz [s]; 0 for none.
        sweep_end: its last frequency [Hz].
    """

    dwells: tuple[float, ...] = DWELLS
    periods: int = 8
    least: float = 6.0
    standstill: float = 10.0
    sweep: float = 0.0
    sweep_end: float = 3.0

    def periods_at(self, frequency: float) -> int:
        """Whole periods of a dwell [Hz]."""
        return max(self.periods, ceil(self.least * frequency - 1e-9))


@dataclass(frozen=True)
class Sensors:
    """What the sensors add to the truth, as the rig's sheet says.

    Attributes:
        rate: sampling rate [Hz].
        jitter: rms error of the sampling instants [s]; the stamps tell the true ones.
        accel: rms noise of the acceleration [m/s^2].
        deflection: of the deflection [m].
        road: of the road's height [m].
        hunting: rms by which a drive that holds the link moves it to and fro [rad].
        counts: of the link's encoder per turn of the link [1].
    """

    rate: float = 500.0
    jitter: float = 4e-5
    accel: float = 0.05
    deflection: float = 1e-4
    road: float = 1e-5
    hunting: float = 2.5e-6
    counts: float = 65536.0 * 40.0
