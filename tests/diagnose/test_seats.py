"""Where the parameters of the sheet sit."""

from savgs_ident.core.rig import Rig
from savgs_ident.diagnose.rig.seats import SEATS


def test_all_that_is_known_to_a_tolerance_has_a_seat_but_hardpoints_and_the_drives(rig: Rig) -> None:
    known = {each.name for each in rig.parameters.entries if each.tolerance}
    assert set(SEATS) <= {each.name for each in rig.parameters.entries}
    homeless = {name for name in known - set(SEATS) if not name.startswith(("motor_", "servo_"))}
    assert {name for name in homeless if name[1:] not in ("_y", "_z")} == set()
