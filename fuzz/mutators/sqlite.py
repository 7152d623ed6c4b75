"""Damage to a bag in SQLite: its cells are others, its tables lack something, and its pages are still sound."""

import sqlite3

from numpy.random import Generator

_TOPICS = ("id", "name", "type", "serialization_format")
_MESSAGES = ("topic_id", "timestamp", "data")
_STRANGE = (None, -1, 2**62, 1e300, "", "x" * 3000, b"", b"\x00\x01\x00\x00\xff\xff\xff\xff", b"\xff" * 40)
_WHOLE = (
    "DELETE FROM messages",
    "DELETE FROM topics",
    "DROP TABLE topics",
    "DROP TABLE messages",
    "ALTER TABLE messages RENAME COLUMN data TO payload",
    "CREATE TABLE message_definitions (topic_type TEXT, encoding TEXT, encoded_message_definition TEXT)",
    "CREATE TABLE message_definitions (nothing TEXT)",
    "UPDATE messages SET timestamp = timestamp % 7",
    "UPDATE messages SET timestamp = -timestamp",
    "UPDATE topics SET name = 'same'",
    "UPDATE topics SET type = 'std_msgs/msg/Float32'",
)


def damage_sqlite(content: bytes, random: Generator) -> bytes:
    """One to three changes; the same bytes where the file is no database any more."""
    bag = sqlite3.connect(":memory:")
    try:
        bag.deserialize(content)
        for _ in range(int(random.integers(1, 4))):
            _change(bag, random)
        bag.commit()
        return bag.serialize()
    except sqlite3.Error:
        return content
    finally:
        bag.close()


def _change(bag: sqlite3.Connection, random: Generator) -> None:
    if random.random() < 0.4:
        bag.execute(_WHOLE[int(random.integers(len(_WHOLE)))])
        return
    table, columns = (("topics", _TOPICS), ("messages", _MESSAGES))[int(random.integers(2))]
    column = columns[int(random.integers(len(columns)))]
    value = _STRANGE[int(random.integers(len(_STRANGE)))]
    rows = [row for (row,) in bag.execute(f"SELECT rowid FROM {table}")]
    if rows:
        row = rows[int(random.integers(len(rows)))]
        bag.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (value, row))
