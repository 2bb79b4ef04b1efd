'''A rule's docstring -> its documentation, and its examples -> files.

    """Two links have the same name.

    Readers keep one of them, and not all the same one.

    Bad: <link name="a"/><link name="a"/>
    Good: <link name="a"/><link name="b"/>
    """

First the title, then why, then an example that raises the rule and one that does not; an example may run over several
indented lines. It stands inside <robot name="t" xmlns:wk="..."><link name="map"/>...</robot>, unless it is a whole document
itself; one that is no XML at all is told in words.
'''

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass

from wallkit.maps.document import WK_NAMESPACE
from wallkit.maps.rules.base import Rule

_SECTION = re.compile(r"^(Bad|Good):", re.MULTILINE)
_WHOLE = re.compile(r"<\?xml|<!DOCTYPE|<(\w+:)?robot[\s>/]|<!--")


@dataclass(frozen=True, slots=True)
class RuleDoc:
    """The documentation of a rule; bad and good are examples, or "" where it has none."""

    title: str
    why: str
    bad: str
    good: str


def doc_of(rule: Rule) -> RuleDoc:
    """A rule's documentation."""
    text = inspect.getdoc(rule.check) or ""
    title, _, rest = text.partition("\n")
    why, *sections = _SECTION.split(rest)
    examples = dict(zip(sections[::2], sections[1::2], strict=True))
    return RuleDoc(title, why.strip(), *(inspect.cleandoc(examples.get(name, "")) for name in ("Bad", "Good")))


def is_file(example: str) -> bool:
    """Whether an example can be turned into a file, rather than being told in words."""
    return example.startswith("<")


def file_from_example(example: str) -> bytes:
    """The file an example stands for."""
    if _WHOLE.match(example):
        return example.encode()
    head = f'<robot name="t" xmlns:wk="{WK_NAMESPACE}">'
    return f'{head}\n<link name="map"/>\n{example}\n</robot>\n'.encode()


def text_from_doc(rule: Rule) -> str:
    """What `wallkit map explain` prints about a rule."""
    doc = doc_of(rule)
    fix = f", fix: {rule.fix}" if rule.fix else ""
    pieces = [f"{rule.code} {doc.title}", f"{rule.severity}{fix}", doc.why]
    pieces += [f"{word}:\n{_indented(text)}" for word, text in (("Bad", doc.bad), ("Good", doc.good)) if text]
    return "\n\n".join(piece for piece in pieces if piece) + "\n"


def _indented(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines())
