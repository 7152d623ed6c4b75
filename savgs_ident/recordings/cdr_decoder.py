"""ROS 2 CDR messages of one topic to numbers, any message type, many at a time (see ``cdr_layout``)."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from savgs_ident.core.errors import DataWarning
from savgs_ident.recordings.binding import Candidate
from savgs_ident.recordings.cdr_layout import Layout, layout_of
from savgs_ident.recordings.cdr_schema import Field, SchemaError, parse_definition
from savgs_ident.recordings.message_block import DecodeError, MessageBlock, gather
from savgs_ident.recordings.names import canonical_name
from savgs_ident.recordings.recording import CANONICAL_UNITS

_KEPT_LAYOUTS = 8
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_FOREIGN = ("sensor_msgs/", "geometry_msgs/", "nav_msgs/", "diagnostic_msgs/", "rcl_interfaces/")
"""Standard packages whose field names mean other things (the ``current`` of a battery, say)."""
_INDEXED = re.compile(r"^(?P<array>.+)\[(?P<index>[^\]]+)\]$")


class CdrDecoder:
    """Decoder of one topic. ROS numbers are SI by convention (REP 103), so no unit is asked for."""

    def __init__(self, topic: str, type_name: str, definition: str) -> None:
        self.topic = topic
        self.type_name = type_name.replace("/msg/", "/")
        self.notes: tuple[DataWarning, ...] = ()
        try:
            self._fields: tuple[Field, ...] = parse_definition(type_name, definition)
        except SchemaError as error:
            raise DecodeError(f"its schema is not understood: {error}") from error
        self._layouts: list[Layout] = []

    def candidates(self, first: bytes) -> tuple[Candidate, ...]:
        """The numbers in the first message as signals; usual message types are recognised."""
        layout = self._layout(first)
        foreign = self.type_name.startswith(_FOREIGN)
        names = {path: "" if foreign else _field_name(path, self.topic) for path in layout.spots}
        if self.type_name == "sensor_msgs/Imu":
            names["linear_acceleration.z"] = "accel_z"
        elif self.type_name == "sensor_msgs/JointState":
            names |= self._joint(layout)
        units = {path: CANONICAL_UNITS.get(canonical_name(name) or "") for path, name in names.items()}
        return tuple(
            Candidate(path, name, units[path], f"{self.topic} {path}") for path, name in names.items()
        )

    def find(self, field: str, first: bytes) -> str | None:
        """The path that the map's ``field`` means (``position[joint name]`` included), or None."""
        layout = self._layout(first)
        if field in layout.spots:
            return field
        match = _INDEXED.match(field)
        if match is None:
            return None
        for path, text in layout.texts.items():
            if text == match["index"] and path.startswith("name["):
                found = f"{match['array']}[{path[5:-1]}]"
                return found if found in layout.spots else None
        return None

    def decode(
        self, block: MessageBlock, keys: Sequence[str]
    ) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int64] | None]:
        """The numbers at ``keys``, each of shape (n,), and the header stamps [ns] if there is a header."""
        values = {key: np.full(block.log.size, np.nan) for key in keys}
        stamps = np.zeros(block.log.size, dtype=np.int64)
        has_stamp = False
        left = np.arange(block.log.size)
        while left.size:
            layout = self._layout(block.payload(int(left[0])), int(left[0]))
            same = self._fits(layout, block, left)
            here = left[same]
            starts = block.starts[here]
            for key in keys:
                if key in layout.spots:
                    offset, code = layout.spots[key]
                    values[key][here] = gather(block.data, starts + offset, code)
            if all(path in layout.spots for path in _STAMP):
                sec, nanosec = (
                    gather(block.data, starts + layout.spots[path].offset, layout.spots[path].code)
                    for path in _STAMP
                )
                stamps[here] = sec.astype(np.int64) * 1_000_000_000 + nanosec.astype(np.int64)
                has_stamp = True
            left = left[~same]
        return values, stamps if has_stamp else None

    def _layout(self, message: bytes, index: int = 0) -> Layout:
        for layout in self._layouts:
            if len(message) >= layout.size and all(
                np.frombuffer(message, spot.code, 1, spot.offset)[0] == value for spot, value in layout.guards
            ):
                return layout
        try:
            layout = layout_of(message, self._fields)
        except SchemaError as error:
            raise DecodeError(str(error), index) from error
        self._layouts = [layout, *self._layouts[: _KEPT_LAYOUTS - 1]]
        return layout

    def _fits(self, layout: Layout, block: MessageBlock, left: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Which messages have this layout; guards are compared only inside messages that are long enough."""
        fits = block.stops[left] - block.starts[left] >= layout.size
        for spot, value in layout.guards:
            where = np.flatnonzero(fits)
            fits[where] = gather(block.data, block.starts[left[where]] + spot.offset, spot.code) == value
        return fits

    def _joint(self, layout: Layout) -> dict[str, str]:
        """The joint that is the single link: the only one, or the only one with 'link' in its name."""
        joints = {path[5:-1]: text for path, text in layout.texts.items() if path.startswith("name[")}
        links = [index for index, text in joints.items() if "link" in text.lower()]
        if len(links) != 1 and len(joints) > 1:
            self.notes = (
                DataWarning(
                    "ambiguous_joint",
                    "which joint is the single link is not clear: " + ", ".join(joints.values()),
                    channel=self.topic,
                    remedy='name it in channels.toml: field = "position[joint name]"',
                ),
            )
            return {}
        index = links[0] if links else next(iter(joints), "0")
        if f"effort[{index}]" in layout.spots:
            self.notes = (
                DataWarning(
                    "effort_ignored",
                    "effort of a joint is a torque [N m], not the motor current, and is not used",
                    channel=self.topic,
                    remedy="log the motor current as its own topic",
                ),
            )
        wanted = {f"position[{index}]": "link_angle", f"velocity[{index}]": "link_velocity"}
        return {path: name for path, name in wanted.items() if path in layout.spots}


def _field_name(path: str, topic: str) -> str:
    """The name that tells what a field is: its own, or for ``data`` that of its topic."""
    if path != "data":
        return path
    parts = [part for part in topic.split("/") if part]
    joined = "_".join(parts)
    return joined if canonical_name(joined) else (parts[-1] if parts else topic)
