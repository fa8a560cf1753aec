"""Files written beside, then renamed: none is seen half-written; npz without pickles; motions as text."""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import secrets
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import numpy as np
from numpy.typing import NDArray

from screwkin.errors import InputError, OutputError, ScrewkinError

_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest a zip can tell; a true one would change the bytes
LARGEST = 2**28
"""Bytes that a file may unpack to; an hour of walking at 50 Hz takes about as many."""
LARGEST_TEXT = 2**22
"""Bytes of a text: tables of robots take some thousand, those of public robots at most some 100,000."""
LARGEST_RECORD = 2**24
"""Bytes of a text that holds a measurement."""
MOST_NAMES = 500
"""Links, joints or rows of one kind that a file may have; a humanoid with its fingers has a hundred."""
MOST_SHAPES = 5000
"""Shapes of a robot's bodies; meshes that were divided into convex ones have some hundred."""
DEEPEST = 64
"""Levels to which the JSON of a file may be nested; a walk's own data have seven."""
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, KeyError, tokenize.TokenError)


def _because(error: OSError) -> str:
    return error.strerror or str(error)


def make_folder(path: str | Path) -> Path:
    """The folder, created with its parents where absent.

    Raises:
        OutputError: it cannot be created, is a file, or cannot be written to.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(
            f"cannot write to folder {folder}: {_because(error)}. Name another folder."
        ) from None
    return folder


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """An empty file beside ``path``, renamed to it when the block ends well, and removed when it does not.

    For writers that want a path; its suffix is that of ``path``.

    Raises:
        OutputError: the file cannot be created, written or renamed.
    """
    target = Path(path)
    beside = target.with_name(f".{target.stem}-{secrets.token_hex(8)}{target.suffix}")
    try:
        beside.touch(exist_ok=False)
        yield beside
        beside.replace(target)
    except OSError as error:
        if isinstance(error, ScrewkinError):
            raise
        raise OutputError(f"cannot write {target}: {_because(error)}") from None
    finally:  # whatever came of it, as an interrupt may come right after any of these lines
        with suppress(OSError):
            beside.unlink()


@contextmanager
def atomic_write(path: str | Path) -> Iterator[TextIO]:
    """A text file (UTF-8, line feeds) that appears under its name only when completely written."""
    with atomic_path(path) as beside, beside.open("w", encoding="utf-8", newline="\n") as file:
        yield file


@contextmanager
def atomic_write_bytes(path: str | Path) -> Iterator[BinaryIO]:
    """A binary file that appears under its name only when completely written."""
    with atomic_path(path) as beside, beside.open("wb") as file:
        yield file


def npz_bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """An npz file whose bytes depend on the arrays alone.

    Stored, not deflated: compressors differ between versions.
    """
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", _DATE), member.getvalue())
    return buffer.getvalue()


def read_npz(data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file; pickled objects are refused.

    Raises:
        InputError: not an npz file, truncated, damaged, too large when unpacked, or holding pickles.
    """
    if not (data.startswith(b"PK") and zipfile.is_zipfile(io.BytesIO(data))):
        raise InputError("not an npz file, or a truncated one; make it again")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            _check_sizes(archive)
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except InputError:
        raise
    except (ValueError, SyntaxError) as error:
        raise InputError(f"not a plain npz file; damaged: {error}") from None
    except (*_DAMAGE, OSError, MemoryError, RuntimeError, TypeError) as error:
        raise InputError(f"a damaged npz file; make it again ({error})") from None


def _check_sizes(archive: zipfile.ZipFile) -> None:
    """Refuse what unpacks to too much, by what the archive and the headers of its arrays say."""
    members = archive.infolist()
    if len(members) > MOST_NAMES:
        raise InputError(f"it holds {len(members):,} arrays, at most {MOST_NAMES} are read")
    foreign = [member.filename for member in members if not member.filename.endswith(".npy")]
    if foreign:
        raise InputError(f"it holds files that are no arrays: {', '.join(foreign)}")
    unpacked = 0
    for member in members:
        shape, dtype = _header(archive, member)
        numbers = math.prod(shape)
        if dtype.hasobject:
            raise InputError("not a plain npz file; it holds pickled objects, which are never read")
        if dtype.kind not in "cfiubUS" or (dtype.kind in "US" and numbers > MOST_NAMES):
            found = f"{numbers:,} values of type {dtype}"
            raise InputError(
                f"{member.filename} holds {found}; expected numbers, or {MOST_NAMES} texts at most"
            )
        # Small integers become floats of eight bytes.
        unpacked += max(numbers * max(dtype.itemsize, 8), member.file_size)
    if unpacked > LARGEST:
        raise InputError(
            f"it unpacks to {unpacked / 1e6:.0f} MB, more than the {LARGEST / 1e6:.0f} MB that are read; "
            "split the motion, or take fewer samples per second"
        )


def _header(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array, without its values."""
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        if version not in ((1, 0), (2, 0)):
            raise ValueError(f"{member.filename} has version {version} of the format")
        read = (
            np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(file)
    if min(shape, default=0) < 0:
        raise ValueError(f"{member.filename} has shape {shape}")
    return shape, dtype


def read_file(path: str | Path, largest: int | None = None) -> bytes:
    """All bytes of a file.

    Args:
        path: of the file; a device or a pipe is read up to the limit.
        largest: bytes that are read at most; default: ``LARGEST``.

    Raises:
        OSError: it cannot be read. InputError: it holds more.
    """
    limit = LARGEST if largest is None else largest
    with Path(path).open("rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise InputError(f"{size_fault(limit)}; it is no file of screwkin")
    return data


def size_fault(largest: int) -> str:
    """What is wrong with a file that holds more than so many bytes."""
    return f"more than the {largest / 1e6:.0f} MB that are read"


def read_json(text: str) -> Any:
    """The JSON data of a text that came from a file.

    Raises:
        InputError: no JSON, longer than ``LARGEST_RECORD``, or nested deeper than ``DEEPEST``.
    """
    if len(text) > LARGEST_RECORD:
        raise InputError(f"JSON of {size_fault(LARGEST_RECORD)}")
    brackets = re.sub(r'"(?:[^"\\]|\\.)*+"?|[^\[\]{}"]++', "", text, flags=re.DOTALL).encode()
    opened = np.isin(np.frombuffer(brackets, np.uint8), list(b"[{"))
    deepest = int(np.cumsum(np.where(opened, 1, -1), dtype=np.int32).max(initial=0))
    if deepest > DEEPEST:
        raise InputError(f"JSON nested {deepest:,} deep, at most {DEEPEST} are read")
    try:
        return json.loads(text)
    except ValueError as error:
        raise InputError(f"no JSON: {error}") from None


def versions(*names: str) -> dict[str, str]:
    """Installed version of every distribution, by its name; ``unknown`` where there is none."""
    found = dict.fromkeys(names, "unknown")
    for name in names:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def text_sha256(text: str) -> str:
    """SHA-256 of a text in UTF-8, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def csv_text(time: NDArray[np.float64], joint_names: Sequence[str], q: NDArray[np.float64]) -> str:
    """Time [s], then one column per joint [rad or m], with every digit that distinguishes a float."""
    rows = [",".join(("time", *joint_names))]
    rows += [",".join(map(repr, (t, *here))) for t, here in zip(time.tolist(), q.tolist(), strict=True)]
    return "\n".join(rows) + "\n"


def ros_text(
    time: NDArray[np.float64],
    joint_names: Sequence[str],
    q: NDArray[np.float64],
    qd: NDArray[np.float64],
    qdd: NDArray[np.float64],
) -> str:
    """The message trajectory_msgs/JointTrajectory, times counted from its first sample."""

    def stamp(seconds: float) -> dict[str, int]:
        whole, nano = divmod(round(seconds * 1e9), 10**9)
        return {"sec": whole, "nanosec": nano}

    columns = (a.tolist() for a in (time, q, qd, qdd))
    start = float(time[0])
    points = [
        {
            "positions": positions,
            "velocities": velocities,
            "accelerations": accelerations,
            "effort": [],
            "time_from_start": stamp(t - start),
        }
        for t, positions, velocities, accelerations in zip(*columns, strict=True)
    ]
    header = {"stamp": stamp(0.0), "frame_id": ""}
    return json.dumps({"header": header, "joint_names": list(joint_names), "points": points}) + "\n"
