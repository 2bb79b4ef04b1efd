"""What of a recording could not be read: damages with their place, and counts, as sentences for the user."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Damage:
    """A piece of a file that had to be left out.

    Attributes:
        file, offset: where it begins [byte].
        reason: what is wrong with it.
        messages: how many messages are missing; None when nobody can tell.
        last_ns: record time of the last message before it; None when there is none.
    """

    file: str
    offset: int
    reason: str
    messages: int | None = None
    last_ns: int | None = None

    def __str__(self) -> str:
        lost = {None: "an unknown number of messages", 1: "1 message"}.get(self.messages, f"{self.messages} messages")
        when = "" if self.last_ns is None else f", last good record time {self.last_ns / 1e9:.3f} s"
        return f"{self.file}: byte {self.offset}: {self.reason}; {lost} left out{when}"


@dataclass
class Loss:
    """Everything that was left out while a log was read. Reading it again reports nothing twice.

    Attributes:
        damages: by (file, byte offset).
        undecodable: topic -> messages that could not be decoded, with the reason of the first.
        skipped: topic -> why its messages are not decoded at all (an encoding or a type wallkit does not know).
            That is no loss: most logs hold topics that nobody needs here.
        notes: things worth saying that cost no data.
        recovered: damaged file -> messages that are readable in it.
    """

    damages: dict[tuple[str, int], Damage] = field(default_factory=dict)
    undecodable: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    skipped: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    recovered: dict[str, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Whether any data was lost."""
        return bool(self.damages or self.undecodable)

    def add(self, damage: Damage) -> None:
        """Remember a damage once, however often its place is read."""
        self.damages.setdefault((damage.file, damage.offset), damage)

    def note(self, text: str) -> None:
        """Remember a remark once."""
        if text not in self.notes:
            self.notes.append(text)

    def count_undecodable(self, topic: str, so_far: int, reason: str) -> None:
        """Remember that this pass over the log has met so many undecodable messages on a topic."""
        self.undecodable[topic] = max(self.undecodable[topic], so_far)
        self.reasons.setdefault(topic, reason)

    def add_all(self, other: Loss) -> None:
        """Remember what another reading of the same log has lost, once."""
        for damage in other.damages.values():
            self.add(damage)
        for topic, count in other.undecodable.items():
            self.count_undecodable(topic, count, other.reasons[topic])
        for topic, reason in other.skipped.items():
            self.skipped.setdefault(topic, reason)
        for text in other.notes:
            self.note(text)
        self.recovered.update(other.recovered)

    def lines(self) -> list[str]:
        """One sentence for each thing that was lost."""
        lines = [str(d) for d in self.damages.values()]
        lines += [
            f"{topic}: {n} message{'s' if n > 1 else ''} could not be decoded: {self.reasons[topic]}"
            for topic, n in sorted(self.undecodable.items())
        ]
        lines += [f"{file}: {n} messages recovered" for file, n in self.recovered.items()]
        return lines
