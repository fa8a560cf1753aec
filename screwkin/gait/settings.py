"""Values set over a gait's document, by flat or dotted key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

_LISTS = {"channel": 2, "waist": 1}  # tables of lists, and how many names lead to a list


def valid_keys(document: Mapping[str, Any], optional: Iterable[str] = ()) -> list[str]:
    """Keys that may be set: flat parameters, the file's own ones, then its lists of numbers."""
    keys = [*dict.fromkeys([*document["gait"], *optional, *document["parameters"]])]
    keys += [f"channel.{name}.{part}" for name in document["channel"] for part in ("at", "value")]
    return keys + [f"waist.{name}" for name in document["waist"]]


def place(document: dict[str, Any], key: str, value: Any, optional: Iterable[str] = ()) -> bool:
    """Set a value in the document, in place; False if the key names nothing in it, nor is optional.

    Keys: a parameter; ``channel.NAME.at`` or ``.value`` and ``waist.NAME``, with a list or its text
    ``"[0, lift/2, lift]"``; or one entry of such a list, by its number from 0: ``channel.NAME.value.2``.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    for table in ("gait", "parameters"):
        if key in document[table]:
            document[table][key] = value
            return True
    if key in optional:
        document["gait"][key] = value
        return True
    first, *names = key.split(".")
    depth = _LISTS.get(first, 0)
    if not depth or len(names) not in (depth, depth + 1):
        return False
    holder: Any = document[first]
    for name in names[: depth - 1]:
        holder = holder.get(name, {})
    last = names[depth - 1]
    if last not in holder:
        return False
    if len(names) == depth:
        holder[last] = items_of(value) if isinstance(value, str) else value
        return True
    index = names[depth]
    if not index.isdecimal() or int(index) >= len(holder[last]):
        return False
    holder[last] = [value if i == int(index) else item for i, item in enumerate(holder[last])]
    return True


def items_of(text: str) -> list[str]:
    """Entries of a list written as text, divided at commas outside parentheses."""
    items, depth = [""], 0
    for character in text.strip().removeprefix("[").removesuffix("]"):
        depth += (character == "(") - (character == ")")
        if character == "," and depth == 0:
            items.append("")
        else:
            items[-1] += character
    return [item.strip() for item in items]
