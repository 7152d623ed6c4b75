"""Whether a clock tells the date: one that counts from 1970 does, one that starts with the recorder does not.

>>> unix_time(1_763_820_000.0), unix_time(12.5)
(1763820000.0, None)
"""

_YEAR_2000 = 946_684_800.0
_YEAR_2100 = 4_102_444_800.0


def unix_time(seconds: float) -> float | None:
    """``seconds`` if they are a time of this century, counted from 1970 in UTC [s]; None for any other count."""
    return seconds if _YEAR_2000 <= seconds < _YEAR_2100 else None
