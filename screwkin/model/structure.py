"""Names and connections of a robot table: one tree of links, every name known and unique.

Works on the names alone, so that a row with a wrong number is not reported as missing too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from screwkin.errors import Fault, near
from screwkin.model.expression import listed
from screwkin.model.mirror import closes_within, is_sided, limb_part, swapped
from screwkin.model.records import FLOOR
from screwkin.model.rows import Rows, TableEntry

RESERVED = ("base", "waist", FLOOR, "world")
"""Frames and chains of every mechanism; no tip may have such a name."""


@dataclass(frozen=True)
class Mirrored:
    """A limb that is another one's reflection, and the links that are reflected for it."""

    where: str
    name: str
    of: str
    part: tuple[str, ...]


class Named(NamedTuple):
    """A name, what has it, and where the file says so."""

    kind: str
    name: str
    where: str
    key: str


def structure_faults(rows: Rows, mirrored: Iterable[Mirrored]) -> Iterator[Fault]:
    """All faults of names and connections, mirrored rows included."""
    named = _all_names(rows, list(mirrored))
    yield from _duplicates(named, rows.robot.text("base_link"))
    yield from _unknown(rows, named)
    yield from _tree_faults(rows)
    yield from _sole_faults(rows, named)
    yield from _closure_faults(rows)
    base = rows.robot.text("base_link")
    for entry in rows["link"]:
        if "spring" in entry.raw and entry.text("name") == base:
            fix = "Give springs to the links that it carries"
            yield Fault(entry.where, "spring", "is of the base link", fix)


def _closure_faults(rows: Rows) -> Iterator[Fault]:
    """Closures of one link with itself, and with the floor where the base is fixed to it."""
    fixed, base = rows.robot.text("base") == "fixed", rows.robot.text("base_link")
    for entry in rows["closure"]:
        if entry.text("link_a") and entry.text("link_a") == entry.text("link_b"):
            yield Fault(entry.where, "link_b", f"is {entry.text('link_b')!r} again", "Close two links")
        for key in ("link_a", "link_b"):
            if fixed and entry.text(key) == FLOOR:
                fix = f"Write {base!r}, with the frame in base axes"
                yield Fault(entry.where, key, "is the floor, to which the base is fixed", fix)


def carried_links(rows: Rows) -> dict[str, str]:
    """For every carried link, the link that its first joint stands on; names that are not links left out."""
    carried: dict[str, str] = {}
    for entry in rows["joint"]:
        if entry.text("child") and entry.text("parent"):
            carried.setdefault(entry.text("child"), entry.text("parent"))
    return carried


def mirrored_limbs(rows: Rows) -> tuple[list[Mirrored], list[Fault]]:
    """Every limb declared by reflection, with its links; and the faults of such declarations."""
    plain = {entry.text("name"): entry for entry in rows["limb"] if not _is_mirror(entry)}
    carried, done, faults = carried_links(rows), set[str](), list[Fault]()
    mirrored: list[Mirrored] = []
    for entry in rows["limb"]:
        name, of = entry.text("name"), entry.text("of")
        if not _is_mirror(entry) or not name or not of:
            continue
        if of not in plain:
            fix = f"{near(of, plain)}Limbs with rows of their own: {listed(plain)}"
            faults.append(Fault(entry.where, "of", f"{of!r} is not such a limb", fix))
            continue
        if swapped(of) != name or not is_sided(of):
            two = "Call the limbs right_... and left_..., or R_... and L_..."
            fix = f"Write name = {swapped(of)!r}" if is_sided(of) else two
            faults.append(Fault(entry.where, "name", f"{name!r} is not {of!r} on the other side", fix))
        part = limb_part(carried, plain[of].text("link"))
        mirrored.append(Mirrored(entry.where, name, of, tuple(link for link in part if link not in done)))
        done.update(part)
        faults += _sideless(rows, entry, plain[of], part)
    return mirrored, faults


def _is_mirror(entry: TableEntry) -> bool:
    return "mirror" in entry.raw or "of" in entry.raw


def _sideless(rows: Rows, entry: TableEntry, source: TableEntry, part: tuple[str, ...]) -> Iterator[Fault]:
    """Everything that is reflected needs right or left in its name, to have another one."""
    joints = [e.text("name") for e in rows["joint"] if e.text("child") in part]
    fix = "Put right or left into its name, as in right_knee, or R_ or L_ before it"
    if not part:
        link = source.text("link")
        yield Fault(entry.where, "of", f"no link on the way to {link!r} names a side", fix)
    for what, names in (("link", part), ("joint", joints), ("tip", [source.text("tip")])):
        for name in names:
            if name and not is_sided(name):
                yield Fault(entry.where, "of", f"{what} {name!r} is mirrored but names no side", fix)


def _all_names(rows: Rows, mirrored: list[Mirrored]) -> list[Named]:
    """Everything that has a name, mirrored things included, and what a faulty mirror was to bring."""
    named = list(_declared(rows, mirrored))
    good = {limb.name for limb in mirrored if swapped(limb.of) == limb.name}
    for entry in rows["limb"]:
        if _is_mirror(entry) and entry.text("name") not in good:
            there = {(one.kind, one.name) for one in named}
            other = (one._replace(name=swapped(one.name), where=entry.where, key="of") for one in named)
            return [*named, *(one for one in other if (one.kind, one.name) not in there)]
    return named


def _declared(rows: Rows, mirrored: list[Mirrored]) -> Iterator[Named]:
    """Everything that has a name, mirrored things included."""
    for table in ("link", "joint", "closure", "frame", "limb", "posture"):
        for entry in rows[table]:
            if entry.text("name"):
                yield Named(table, entry.text("name"), entry.where, "name")
    tips = {entry.text("name"): entry.text("tip") for entry in rows["limb"] if entry.text("tip")}
    for entry in rows["limb"]:
        if entry.text("tip"):
            yield Named("tip", entry.text("tip"), entry.where, "tip")
    for limb in mirrored:
        yield from (Named("link", swapped(name), limb.where, "of") for name in limb.part)
        for entry in rows["joint"]:
            if entry.text("child") in limb.part and entry.text("name"):
                yield Named("joint", swapped(entry.text("name")), limb.where, "of")
        for entry in rows["closure"]:
            if closes_within(entry.text("link_a"), entry.text("link_b"), limb.part):
                yield Named("closure", swapped(entry.text("name")), limb.where, "of")
        if limb.of in tips:
            yield Named("tip", swapped(tips[limb.of]), limb.where, "of")


def names_of(kind: str, named: Iterable[Named]) -> list[str]:
    """All names of one kind."""
    return [one.name for one in named if one.kind == kind]


def joint_names(rows: Rows, mirrored: list[Mirrored]) -> list[str]:
    """Names of all joints, mirrored ones included."""
    return names_of("joint", _all_names(rows, mirrored))


def _duplicates(named: list[Named], base: str) -> Iterator[Fault]:
    first: dict[tuple[str, str], str] = {}
    links, tips = names_of("link", named), names_of("tip", named)
    for kind, name, where, key in named:
        if (kind, name) in first:
            found = f"there is a {kind} {name!r} already, at {first[kind, name]}"
            yield Fault(where, key, found, f"Give each {kind} a name of its own")
        first.setdefault((kind, name), where)
        if kind == "link" and name == "base" and name != base:
            fix = 'Rename it: frame "base" is the base link\'s'
            yield Fault(where, key, "link 'base' is not base_link", fix)
        if kind == "link" and name == FLOOR:
            yield Fault(where, key, f"link {name!r} has the name of what robots stand on", "Rename the link")
        if kind in ("tip", "frame") and name in links:
            yield Fault(
                where, key, f"{kind} {name!r} has the name of a link", f"Rename the {kind} or the link"
            )
        if kind == "frame" and name in tips:
            yield Fault(where, key, f"frame {name!r} has the name of a tip", "Leave it out: a tip is a frame")
        if kind in ("tip", "frame") and name in RESERVED:
            yield Fault(where, key, f"{kind} {name!r} is a reserved name", f"Not allowed: {listed(RESERVED)}")


def _unknown(rows: Rows, named: list[Named]) -> Iterator[Fault]:
    """Names that are used but not declared."""
    links = names_of("link", named)
    uses = {
        "joint": ("parent", "child"),
        "closure": ("link_a", "link_b"),
        "limb": ("link",),
        "frame": ("link",),
    }
    places = [(rows.robot, "base_link", links)]
    places += [
        (entry, key, [*links, FLOOR] if table == "closure" else links)
        for table, keys in uses.items()
        for entry in rows[table]
        for key in keys
    ]
    for entry, key, known in places:
        name = entry.text(key)
        if name and name not in known:
            fix = f"{near(name, known)}Links: {listed(known)}"
            yield Fault(entry.where, key, f"there is no link {name!r}", fix)


def _tree_faults(rows: Rows) -> Iterator[Fault]:
    """Every link but the base hangs by exactly one joint from the base."""
    base, by = rows.robot.text("base_link"), dict[str, TableEntry]()
    for entry in rows["joint"]:
        child = entry.text("child")
        if child and child == base:
            yield Fault(entry.where, "child", f"carries the base link {base!r}", "Swap parent and child")
        elif child and child in by:
            found = f"link {child!r} is already carried by {by[child].where}"
            fix = "Keep one of the joints; close the loop with a [[closure]]"
            yield Fault(entry.where, "child", found, fix)
        by.setdefault(child, entry)
    links = {entry.text("name"): entry for entry in rows["link"]}
    complete = all(entry.text("parent") and entry.text("child") for entry in rows["joint"])
    if base not in links or not complete:
        return  # reported already; what follows would only echo it
    yield from _unreached(links, {child: joint for child, joint in by.items() if child != base}, base)


def _unreached(links: dict[str, TableEntry], by: dict[str, TableEntry], base: str) -> Iterator[Fault]:
    in_circle: set[str] = set()
    for name, entry in links.items():
        if name and name != base and name not in by:
            found = f"link {name!r} is carried by no joint: a second root beside base_link {base!r}"
            yield Fault(entry.where, "name", found, "Write a [[joint]] that has it as child")
        path = [name]
        while path[-1] in by and path[-1] not in path[:-1] and path[-1] not in in_circle:
            path.append(by[path[-1]].text("parent"))
        if path[-1] in path[:-1]:
            circle = list(reversed(path[path.index(path[-1]) :]))
            in_circle.update(circle)
            found = f"parents run in a circle: {' -> '.join(circle)}"
            yield Fault(by[circle[0]].where, "parent", found, f"Hang one of them on {base!r} or its children")


def _sole_faults(rows: Rows, named: list[Named]) -> Iterator[Fault]:
    limbs, seen = names_of("limb", named), dict[str, str]()
    source = {entry.text("name"): entry.text("of") or entry.text("name") for entry in rows["limb"]}
    kinds = {entry.text("name"): entry.text("kind") for entry in rows["limb"]}
    soled = {entry.text("limb") for entry in rows["sole"]}
    for entry in rows["sole"]:
        limb = entry.text("limb")
        if not limb:
            continue
        if limb not in limbs:
            fix = f"{near(limb, limbs)}Limbs: {listed(limbs)}"
            yield Fault(entry.where, "limb", f"there is no limb {limb!r}", fix)
        elif kinds.get(source.get(limb, swapped(limb))) not in ("leg", ""):
            yield Fault(entry.where, "limb", f"limb {limb!r} is no leg", 'Soles are for kind = "leg"')
        if limb in seen:
            yield Fault(entry.where, "limb", f"limb {limb!r} has a sole at {seen[limb]}", "Keep one of them")
        elif source.get(limb, limb) != limb and source[limb] in soled:
            found = f"limb {limb!r} has the mirrored sole of {source[limb]!r}"
            yield Fault(entry.where, "limb", found, "Leave one of them out")
        seen.setdefault(limb, entry.where)
