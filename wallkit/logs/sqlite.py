"""A rosbag2 SQLite file (.db3) -> its serialised messages by record time, through rosbags."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from wallkit.errors import LogError
from wallkit.logs.loss import Damage, Loss
from wallkit.logs.message import Channel, RawMessage

if TYPE_CHECKING:
    from rosbags.interfaces import Connection

MAGIC = b"SQLite format 3\x00"


class SqliteFile:
    """One .db3 file of rosbag2, with or without message definitions in it."""

    format = "rosbag2 SQLite"

    def __init__(self, path: Path, loss: Loss) -> None:
        from rosbags.rosbag2.errors import ReaderError
        from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

        self._path, self._loss = path, loss
        self._reader = Sqlite3Reader(path)
        try:
            self._reader.open()
        except (ReaderError, KeyError) as error:
            hint = f"a damaged one may be saved: `sqlite3 {path.name} .recover | sqlite3 saved.db3`"
            raise LogError(f"no rosbag2 recording, or a damaged one: {error}", where=path, hint=hint) from error
        self._channels = {c.id: _channel(c) for c in self._reader.connections}
        self.channels: tuple[Channel, ...] = tuple(self._channels.values())

    def raw(self, topics: Collection[str] | None = None) -> Iterator[RawMessage]:
        """Serialised messages of the topics (None: of all) by record time; the database sorts."""
        import apsw

        wanted = [c for c in self._reader.connections if topics is None or c.topic in topics]
        messages = self._reader.messages(wanted)
        number = 0
        last_ns: int | None = None
        while True:
            try:
                found = next(messages, None)
            except apsw.Error as error:
                self._loss.add(Damage(str(self._path), 0, f"the database is damaged ({error})", None, last_ns))
                return
            if found is None:
                return
            connection, log_ns, data = found
            number += 1
            last_ns = log_ns
            yield log_ns, number, self._channels[connection.id], data


def _channel(connection: Connection) -> Channel:
    from rosbags.interfaces import ConnectionExtRosbag2, MessageDefinitionFormat

    schema_encodings = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}
    assert isinstance(connection.ext, ConnectionExtRosbag2)
    return Channel(
        connection.topic,
        connection.msgtype,
        connection.ext.serialization_format,
        schema_encodings.get(connection.msgdef.format, ""),
        connection.msgdef.data.encode(),
        connection.msgcount,
    )
