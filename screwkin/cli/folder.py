"""Where a verb's files go."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path

from screwkin.files import make_folder


@contextmanager
def output_folder(out: Path | None, verb: str, robot: str) -> Iterator[Path]:
    """The folder ``out``, or a new one ``runs/<time>-<verb>-<robot>``; writable, or nothing is computed.

    Folders created for a block that fails are removed again while they are empty.

    Raises:
        OutputError: it cannot be created or written to.
    """
    folder = _fresh(verb, robot) if out is None else out
    created = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        yield make_folder(folder)
    except BaseException:
        for path in created:
            try:
                path.rmdir()
            except OSError:  # it holds something, or was never created
                break
        raise


def _fresh(verb: str, robot: str) -> Path:
    """A folder name that does not exist yet."""
    name = re.sub(r"[^\w.-]+", "-", robot)
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{verb}-{name}"
    folder, again = Path("runs") / stem, 1
    while folder.exists():
        again += 1
        folder = Path("runs") / f"{stem}-{again}"
    return folder
