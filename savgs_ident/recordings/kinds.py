"""What kind of test a name tells of, and at which frequency.

>>> kind_of("dwell_2.35Hz")
('dwell', 2.35)
>>> kind_of("sweep_0_3Hz_60s")
('sweep', None)
"""

import re
from math import isfinite

from savgs_ident.recordings.recording import TestKind

_FREQUENCY = re.compile(r"(?<![\d.])(\d+(?:[.,p]\d+)?)\s*_?hz", re.IGNORECASE)
_SWEEP = re.compile(r"sweep|chirp", re.IGNORECASE)
_STANDSTILL = re.compile(r"stand_?still|at_?rest|idle", re.IGNORECASE)
_DWELL = re.compile(r"dwell|harmonic|sine|sinus", re.IGNORECASE)


def kind_of(name: str) -> tuple[TestKind, float | None]:
    """Kind and frequency [Hz] (None where the name does not tell one) of the test called ``name``."""
    if _SWEEP.search(name):
        return "sweep", None
    if _STANDSTILL.search(name):
        return "standstill", None
    found = _FREQUENCY.search(name)
    frequency = float(re.sub("[,p]", ".", found[1])) if found else None
    if frequency is not None and not (isfinite(frequency) and frequency > 0.0):
        frequency = None
    if _DWELL.search(name) or frequency is not None:
        return "dwell", frequency
    return "other", None
