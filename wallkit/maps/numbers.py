"""Text of an attribute -> numbers by the format's grammar, or exactly what keeps it from being numbers.

    [+-]?(digits[.digits] | .digits)[e[+-]digits], ASCII digits, separated by spaces

This is what urdfdom reads; Python's float() would also take "1_0", "nan" and full-width digits.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Literal

LARGEST = 1e6
# a rounding error of an angle of less moves nothing by a millimetre within ten metres
ROUNDED_RAD = 1e-4

_EIGHTH_TURN_RAD = math.pi / 4
_ROUNDED_DECIMALS = 4

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf|infinity|1\.#.*)", re.IGNORECASE)
_UNITS = {
    "mm": 1e-3,
    "cm": 1e-2,
    "dm": 1e-1,
    "m": 1.0,
    "km": 1e3,
    "in": 0.0254,
    '"': 0.0254,
    "ft": 0.3048,
    "'": 0.3048,
    "rad": 1.0,
    "deg": math.pi / 180,
    "°": math.pi / 180,
}

Complaint = Literal["count", "not-finite", "comma", "unit", "too-large", "malformed"]


@dataclass(frozen=True, slots=True)
class Trouble:
    """Why a text is not the numbers asked for.

    Attributes:
        what: the kind of trouble; the first word that has one decides, the count only where all words are numbers.
        word: the offending word; empty for a wrong count.
        found: how many words there are.
        repaired: the text as it was probably meant, empty when that cannot be told.
    """

    what: Complaint
    word: str
    found: int
    repaired: str = ""


def number_from_text(text: str | None) -> float | None:
    """One number, or None where there is none."""
    numbers = numbers_from_text(text, 1)
    return numbers[0] if numbers else None


def numbers_from_text(
    text: str | None, count: int | None = None, *, largest: float = LARGEST
) -> tuple[float, ...] | None:
    """All numbers of a text, or None when it has trouble (see `trouble_in`)."""
    if text is None:
        return None
    words = text.split()
    if not words or (count is not None and len(words) != count):
        return None
    if not all(_NUMBER.fullmatch(word) for word in words):
        return None
    numbers = tuple(float(word) for word in words)
    return numbers if all(abs(number) <= largest for number in numbers) else None


def trouble_in(text: str, count: int | None = None, *, largest: float = LARGEST) -> Trouble | None:
    """What is wrong with a text that should hold `count` numbers (None: one or more); None if nothing is."""
    words = text.split()
    for word in words:
        what = _complaint(word, largest)
        if what is not None:
            return Trouble(what, word, len(words), _repaired(text, what))
    if not words or (count is not None and len(words) != count):
        return Trouble("count", "", len(words))
    return None


def text_from_number(value: float, digits: int = 9) -> str:
    """The shortest plain way to write a number with so many significant digits."""
    return f"{value:.{digits}g}"


def meant_angle(word: str) -> float | None:
    """The multiple of 45 degrees [rad] that a word of two to four decimals rounds or cuts off; None for all else.

    >>> meant_angle("1.57") == math.pi / 2, meant_angle("1.5"), meant_angle("1.5707963")
    (True, None, None)
    """
    decimals = len(word.partition(".")[2])
    if not 2 <= decimals <= _ROUNDED_DECIMALS or not word.lstrip("+-").replace(".", "", 1).isdigit():
        return None
    value = float(word)
    exact = round(value / _EIGHTH_TURN_RAD) * _EIGHTH_TURN_RAD
    cut_off = math.trunc(exact * 10**decimals) / 10**decimals
    is_rounded = abs(value - round(exact, decimals)) < 1e-9 or abs(value - cut_off) < 1e-9
    return exact if is_rounded and abs(value - exact) > ROUNDED_RAD else None


def _complaint(word: str, largest: float) -> Complaint | None:
    if _NUMBER.fullmatch(word):
        return None if abs(float(word)) <= largest else "too-large"
    if _NOT_FINITE.fullmatch(word):
        return "not-finite"
    if "," in word:
        return "comma"
    return "unit" if _in_unit(word) else "malformed"


def _in_unit(word: str) -> tuple[str, str] | None:
    match = _NUMBER.match(word)
    if match and word[match.end() :].lower() in _UNITS:
        return match[0], word[match.end() :].lower()
    return None


def _repaired(text: str, what: Complaint) -> str:
    """The text with commas as spaces, or with its unit suffixes worked in, if that leaves only numbers."""
    if what == "comma":
        text = " ".join(text.replace(",", " ").split())
    elif what == "unit":
        parts = [(word, _in_unit(word)) for word in text.split()]
        text = " ".join(text_from_number(float(unit[0]) * _UNITS[unit[1]]) if unit else word for word, unit in parts)
    else:
        return ""
    return text if numbers_from_text(text) else ""
