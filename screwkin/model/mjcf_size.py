"""Numbers by which a short MJCF file asks MuJoCo for much memory, refused before MuJoCo reads it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from screwkin.errors import Fault, TableError
from screwkin.files import MOST_NAMES, MOST_SHAPES
from screwkin.model.toml import read_text

MOST = 1e6
"""Product of the counts of an element and of those around it; robots replicate nothing, or some dozens."""
MEMORY = 2**28
"""Bytes that a file may reserve for the simulation, which this package does not run from it."""
_COUNTS: Mapping[str, tuple[str, ...]] = {
    "replicate": ("count",),
    "composite": ("count",),
    "flexcomp": ("count",),
    "hfield": ("nrow", "ncol"),
    "numeric": ("size",),
    "user": ("dim",),
    "contact": ("num",),
}
_ELEMENTS: Mapping[str, int] = {"body": MOST_NAMES, "joint": 2 * MOST_NAMES, "geom": MOST_SHAPES}
_RESERVED = ("memory", "nstack")
_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}


def check_size(text: str, path: str) -> None:
    """Refuse a file, and those that it includes, if it asks for more than a robot needs.

    Args:
        text: XML; what is no XML is left to MuJoCo's message.
        path: where it comes from.

    Raises:
        TableError: it names the elements.
    """
    faults, seen = list[Fault](), {Path(path)}
    open_texts = [(text, path)]
    while open_texts and not faults:
        root = _root(*open_texts.pop())
        if root is None:
            continue
        faults += _excesses(root)
        for tag in ("include", "model"):
            for element in root.iter(tag):
                file = Path(path).parent / element.get("file", "")
                if element.get("file") and file not in seen and file.is_file() and len(seen) < MOST_NAMES:
                    seen.add(file)
                    open_texts.append((read_text(file, TableError), str(file)))
    if faults:
        raise TableError(path, faults)


def _root(text: str, path: str) -> Any:
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import ParseError, fromstring

    try:
        return fromstring(text.strip("\ufeff\0 \t\r\n").encode())
    except ParseError:
        return None
    except (DefusedXmlException, ValueError, LookupError) as wrong:
        found = f"holds what is never read ({type(wrong).__name__})"
        raise TableError(
            path, [Fault("file", "", found, "Remove entities and external references")]
        ) from None


def _excesses(root: Any) -> Iterator[Fault]:
    waiting, copies = [(root, 1.0)], Counter[str]()
    while waiting:
        element, around = waiting.pop()
        tag = str(element.tag)
        counts = [n for key in _COUNTS.get(tag, ()) for n in _numbers(element.get(key, ""))]
        around *= math.prod(max(n, 1.0) for n in counts)
        copies[tag] += math.ceil(around)
        reserved = element.attrib if tag == "size" else {}
        if around > MOST:
            yield Fault(f"<{tag}>", "", f"asks for {around:.3g} values or copies", f"Stay below {MOST:.3g}")
        for key, value in reserved.items():
            limit = MEMORY if key in _RESERVED else MOST
            if max(_numbers(value), default=0.0) > limit:
                fix = f"Stay below {limit:.3g}, or leave it out"
                yield Fault(f"<{tag}>", key, f"asks for {value}", fix)
        waiting += [(child, around) for child in element]
    for tag, most in _ELEMENTS.items():
        if copies[tag] > most:
            yield Fault(f"<{tag}>", "", f"is there {copies[tag]:,} times", f"At most {most:,} are read")


def _numbers(text: str) -> list[float]:
    """The numbers of an attribute, with the units of bytes that MuJoCo knows."""
    words = [re.fullmatch(r"([0-9.eE+]+)([KMGTPE]?)", word) for word in text.upper().split()]
    found = []
    for word in filter(None, words):
        try:
            found.append(float(word[1]) * _UNITS[word[2]])
        except ValueError:
            continue
    return found
