"""Virtual chains of a file: ``[[chain]]`` rows, beside ``[parameters]`` that their numbers may name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import Field

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.errors import Fault, InputError, TableError, near
from screwkin.mechanism.virtual_chain import VirtualChain
from screwkin.model.build import row_pose
from screwkin.model.expression import listed, resolve_parameters
from screwkin.model.records import FLOOR
from screwkin.model.rows import parameters_of
from screwkin.model.schema import FrameRow, Row, label, read_row
from screwkin.model.toml import read_text, read_toml
from screwkin.model.values import Name

TABLES = ("parameters", "chain")
"""Keys at the top of such a file."""
_FRAME = "{ xyz = [x, y, z], rpy = [roll, pitch, yaw] } in the frame it starts from"


class ChainRow(Row):
    """[[chain]]: the fields of a ``VirtualChain``."""

    name: Name = Field(description="name of the chain; its couplings are NAME.px and so on")
    couplings: str | list[str] = Field(description='"3P3R", or pairs from start to end: ["px", "ry"]')
    end: Name = Field(description='frame at its end: a link, a tip, a named frame, or "base"')
    start: Name = Field(FLOOR, description='frame at its start, likewise; default "floor"')
    end_frame: FrameRow | None = Field(None, description=_FRAME)
    start_frame: FrameRow | None = Field(None, description=_FRAME)


def load_chains(path: str | Path) -> tuple[VirtualChain, ...]:
    """The virtual chains of a TOML file, in its order.

    Args:
        path: of the file: rows ``[[chain]]`` with ``name couplings end`` and perhaps ``start end_frame
            start_frame``, as of ``VirtualChain``; numbers may be formulas over its ``[parameters]``.

    Raises:
        TableError: the file cannot be read, or has faults; it lists all of them.
    """
    data = read_toml(read_text(Path(path), TableError), str(path), TableError)
    faults = [
        Fault("file", key, "is unknown", f"{near(key, TABLES)}Keys: {listed(TABLES)}")
        for key in data
        if key not in TABLES
    ]
    numbers, wrong = resolve_parameters(parameters_of(data))
    faults += wrong
    rows = data.get("chain", [])
    if not isinstance(rows, list) or not rows:
        fix = "Write [[chain]] with name, couplings and end, once for every chain"
        raise TableError(str(path), [*faults, Fault("file", "chain", "no row stands there", fix)])
    chains: list[VirtualChain] = []
    for i, raw in enumerate(rows):
        where = label("chain", i, raw)
        row, bad = read_row(ChainRow, raw, where, numbers, numbers)
        faults += bad
        if row is None:
            continue
        if row.name in [chain.name for chain in chains]:
            faults.append(Fault(where, "name", "stands twice", "Give every chain a name of its own"))
        try:
            chains.append(_chain(row))
        except InputError as error:
            faults.append(Fault(where, "couplings", str(error), "See VirtualChain in docs/conventions.md"))
    if faults:
        raise TableError(str(path), faults)
    return tuple(chains)


def _chain(row: ChainRow) -> VirtualChain:
    couplings: Any = row.couplings if isinstance(row.couplings, str) else tuple(row.couplings)
    ends = (_matrix(row.end_frame), _matrix(row.start_frame))
    return VirtualChain(row.name, couplings, row.end, row.start, *ends)


def _matrix(row: FrameRow | None) -> Array | None:
    return None if row is None else as_array(row_pose(row)).astype(float)
