"""Input files of at most 10 MB that ask for much memory or time, and what reading them takes.

    python -m tests.hostile FOLDER [NAMES]

Each is written and read in a process of its own, and what it took is printed. A reading may end with an
answer or with an ``InputError``. It has 1 GB of memory, enforced on its whole address
space, and 10 s of processor time.
"""

from __future__ import annotations

import io
import json
import os
import random
import resource
import struct
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

LARGEST = 10**7
MEMORY = 2**30
SECONDS = 10
Content = Callable[[], bytes | str]
HEADER = b"\x93NUMPY\x01\x00"


def npz(arrays: dict[str, Any], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An archive of arrays, or of the bytes of what claims to be one."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method, compresslevel=9) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            if isinstance(array, bytes):
                member.write(array)
            else:
                np.lib.format.write_array(member, np.asarray(array))
            archive.writestr(f"{name}.npy", member.getvalue())
    return out.getvalue()


def zipped(name: str, content: bytes) -> bytes:
    """An archive of one file."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return out.getvalue()


def claimed(shape: tuple[int, ...], dtype: str = "<f8", values: bytes = b"") -> bytes:
    """An array's file that claims a shape."""
    text = repr({"descr": dtype, "fortran_order": False, "shape": shape}).encode() + b"\n"
    return HEADER + struct.pack("<H", len(text)) + text + values


def motion(T: int, n: int, dtype: Any = float) -> dict[str, Any]:
    """A motion at rest, of T samples and n joints."""
    poses = np.tile(np.eye(4), (T, 1, 1))
    zeros = {name: np.zeros((T, n), dtype) for name in ("q", "qd", "qdd")}
    return {
        "time": np.arange(T) * (3000.0 / T), "joint_names": np.array([f"j{k}" for k in range(n)]), **zeros,
        "T_world_base": poses, "base_twist": np.zeros((T, 6), dtype),
        "base_acceleration": np.zeros((T, 6), dtype), "com": np.zeros((T, 3), dtype),
        "zmp": np.zeros((T, 2), dtype), "margin": np.zeros(T, dtype), "T_world_foot": poses,
        "contact": np.ones((T, 1), bool), "feet": np.array(["foot"]), "meta": np.array("{}"),
    }  # fmt: skip


def archives() -> Iterator[tuple[str, Content]]:
    """Trajectories and logs."""
    large = claimed((30_000_000, 8))
    yield "zeros-400-MB.npz", lambda: npz({"q": bytes(400_000_000)})
    yield "claimed-shape.npz", lambda: npz({"q": large + bytes(100)})
    yield "claimed-exabytes.npz", lambda: npz({"q": claimed((2**60, 2**60)) + bytes(100)})
    yield "claimed-negative.npz", lambda: npz({"q": claimed((-1, -8)) + bytes(100)})
    yield "claimed-text.npz", lambda: npz({"meta": claimed((), "<U200000000") + bytes(100)})
    yield "small-integers.npz", lambda: npz(motion(200_000, 200, np.int8))
    yield "largest.npz", lambda: npz(motion(190_000, 30))
    yield "many-names.npz", lambda: npz({**motion(2, 3), "joint_names": np.zeros(2_000_000, "U1")})
    yield "members.npz", lambda: npz({f"a{k}": b"" for k in range(60_000)}, zipfile.ZIP_STORED)
    yield "deep-header.npz", lambda: npz({"q": HEADER + struct.pack("<H", 60_000) + b"[" * 60_000})
    for depth in (3000, 10**6):
        deep = "[" * depth + "]" * depth
        yield f"deep-meta-{depth}.npz", lambda deep=deep: npz({**motion(2, 3), "meta": np.array(deep)})
    yield (
        "wide-meta.npz",
        lambda: npz({**motion(2, 3), "meta": np.array('{"a":[' + "[]," * 2_000_000 + "1]}")}),
    )
    gap = motion(2000, 18)
    gap["time"] = np.append(np.arange(1999.0) / 50, 1e6)
    yield "gap.npz", lambda: npz(gap)


def tables() -> Iterator[tuple[str, Content]]:
    """TOML: of robots, gaits, motors, papers."""
    yield "deep-arrays.toml", lambda: "a = " + "[" * 5_000_000 + "]" * 4_000_000
    yield "deep-tables.toml", lambda: "a = " + "{a=" * 300_000
    yield "long-key.toml", lambda: ".".join("a" * 220_000) + " = 1\n"
    yield "long-keys.toml", lambda: "".join(".".join([f"k{k}", *"a" * 28]) + " = 1\n" for k in range(2300))
    yield "long-quoted-key.toml", lambda: ".".join(['"a"'] * 125_000) + " = 1\n"
    yield (
        "long-headers.toml",
        lambda: "".join("[" + ".".join([f"k{k}", *"a" * 28]) + "]\n" for k in range(2300)),
    )
    yield "many-links.toml", lambda: "".join(f'[[link]]\nname = "l{k}"\n' for k in range(20_000))
    yield "few-links.toml", lambda: "".join(f'[[link]]\nname = "l{k}"\n' for k in range(500))
    joints = (f'[[joint]]\nname = "j{k}"\nparent = "x{k}"\nchild = "l{k}"\n' for k in range(500))
    yield (
        "few-joints.toml",
        lambda: "".join(f'[[link]]\nname = "l{k}"\n' for k in range(500)) + "".join(joints),
    )
    yield "parameters.toml", lambda: "[parameters]\n" + "".join(f"p{k} = 1\n" for k in range(45_000))
    chain = "".join(f'p{k} = "p{k + 1} + p{k + 2}"\n' for k in range(490))
    yield "chained-parameters.toml", lambda: "[parameters]\n" + chain
    circle = "".join(
        f'p{k} = "{" + ".join(f"p{(7 * k + i) % 490}" for i in range(40))}"\n' for k in range(490)
    )
    yield "circling-parameters.toml", lambda: "[parameters]\n" + circle
    yield "power.toml", lambda: '[parameters]\na = "9**9**9**9**9"\nb = "' + "(" * 900 + '1"\n'
    yield "digits.toml", lambda: "a = " + "9" * 500_000
    yield "floats.toml", lambda: "a = [" + "1.5," * 125_000 + "]\n"
    yield "keys.toml", lambda: "".join(f"k{k}=1\n" for k in range(50_000))
    yield "comment.toml", lambda: "#" * LARGEST
    yield "text.toml", lambda: '[gait]\nkind = "' + "a" * 500_000 + '"\n'
    yield "words.toml", lambda: '[gait]\nkind = "' + "walk " * 100_000 + '"\n'
    yield "channels.toml", lambda: "[gait]\n" + "".join(f'"c{k}" = [[0, 1]]\n' for k in range(25_000))
    yield (
        "footsteps.toml",
        lambda: '[gait]\nkind = "footsteps"\nsteps = [' + "[0.1, 0.1, 0]," * 35_000 + "]\n",
    )


def markup() -> Iterator[tuple[str, Content]]:
    """URDF, SRDF's like, MJCF."""
    yield "elements.urdf", lambda: "<robot name='a'>" + "<a/>" * 2_400_000 + "</robot>"
    yield "half-elements.urdf", lambda: "<robot name='a'><link name='a'/>" + "<a/>" * 1_000_000 + "</robot>"
    yield "deep.urdf", lambda: "<robot name='a'>" + "<a>" * 500_000 + "</a>" * 500_000 + "</robot>"
    yield "attributes.urdf", lambda: "<robot " + " ".join(f"a{k}=''" for k in range(350_000)) + "/>"
    yield (
        "links.urdf",
        lambda: "<robot name='a'>" + "".join(f"<link name='l{k}'/>" for k in range(150_000)) + "</robot>",
    )
    joint = "<joint name='j{}' type='revolute'><parent link='l0'/><child link='l{}'/></joint>"
    few = "".join(f"<link name='l{k}'/>" for k in range(500))
    yield (
        "star.urdf",
        lambda: f"<robot name='a'>{few}{''.join(joint.format(k, k) for k in range(1, 500))}</robot>",
    )
    visual = "<visual><geometry><box size='1 1 1'/></geometry></visual>"
    boxes = visual.replace("visual", "collision") * 30_000
    yield "boxes.urdf", lambda: f"<robot name='a'><link name='a'>{boxes}</link></robot>"
    yield (
        "wrong-boxes.urdf",
        lambda: f"<robot name='a'><link name='a'>{boxes.replace('1 1 1', 'x')}</link></robot>",
    )
    yield (
        "number.urdf",
        lambda: (
            "<robot name='a'><link name='a'><inertial><mass value='"
            + "1 " * 2_000_000
            + "'/></inertial></link></robot>"
        ),
    )
    entity = "".join(f"<!ENTITY e{k} '{f'&e{k - 1};' * 10}'>" for k in range(1, 10))
    yield "entities.urdf", lambda: f"<!DOCTYPE robot [<!ENTITY e0 'aaaa'>{entity}]><robot name='&e9;'/>"
    yield "comments.urdf", lambda: "<!--" * 1_000_000
    yield "open.urdf", lambda: "<" * 4_000_000
    yield "blank.urdf", lambda: "< " * 2_000_000
    yield "declarations.urdf", lambda: "<?xml " * 600_000
    world = "<mujoco><worldbody>{}</worldbody></mujoco>"
    body = "<body><joint/><geom size='1'/></body>"
    yield (
        "replicate.xml",
        lambda: world.format(
            f"<replicate count='1000'><replicate count='10000'>{body}</replicate></replicate>"
        ),
    )
    yield (
        "composite.xml",
        lambda: world.format("<composite type='cable' count='10000000 1 1' size='1' offset='0 0 1'/>"),
    )
    yield (
        "flexcomp.xml",
        lambda: world.format("<flexcomp name='a' type='grid' count='2000 2000 200' dim='3'/>"),
    )
    yield (
        "field.xml",
        lambda: "<mujoco><asset><hfield name='a' nrow='60000' ncol='60000' size='1 1 1 1'/></asset></mujoco>",
    )
    yield (
        "texture.xml",
        lambda: "<mujoco><asset><texture builtin='flat' width='90000' height='90000'/></asset></mujoco>",
    )
    yield "memory.xml", lambda: "<mujoco><size memory='900G'/></mujoco>"
    yield "keys.xml", lambda: "<mujoco><size nkey='900000000' nuserdata='900000000'/></mujoco>"
    yield (
        "numeric.xml",
        lambda: "<mujoco><custom><numeric name='a' size='900000000' data='1'/></custom></mujoco>",
    )
    yield "bodies.xml", lambda: world.format(body * 100_000)
    yield "deep-bodies.xml", lambda: world.format("<body>" * 300_000 + "</body>" * 300_000)


def others() -> Iterator[tuple[str, Content]]:
    """DH tables, records, verdicts, meshes."""
    head = "convention,joint,alpha_deg,a_mm,d_mm,offset_deg\n"
    yield "rows.csv", lambda: head + "".join(f"modified,j{k},0,0,0,0\n" for k in range(150_000))
    yield "few-rows.csv", lambda: head + "".join(f"modified,j{k},90,1,0,0\n" for k in range(400))
    yield "columns.csv", lambda: ",".join(f"c{k}" for k in range(500_000)) + "\n1\n"
    yield "quote.csv", lambda: head + '"' * 4_000_000
    yield "lines.csv", lambda: head + "\n" * 4_000_000
    yield "cells.csv", lambda: head + "," * 4_000_000
    yield "deep.json", lambda: "[" * LARGEST
    yield "wide.json", lambda: "[" + "[]," * 3_300_000 + "1]"
    yield "objects.json", lambda: "[" + "{}," * 3_300_000 + "1]"
    yield "keys.json", lambda: json.dumps({f"k{k}": 0 for k in range(600_000)})
    yield "escapes.json", lambda: '"' + '\\"' * 4_900_000
    yield "digits.json", lambda: "9" * LARGEST
    entries = '{"timestamp":0,"goal_position":0,"position":0},' * 200_000
    yield "entries.json", lambda: '{"mass":1,"length":1,"kp":1,"vin":1,"entries":[' + entries + "1]}"
    yield "count.stl", lambda: bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(10_000)
    yield (
        "triangles.stl",
        lambda: bytes(80) + struct.pack("<I", 199_000) + random.Random(0).randbytes(50 * 199_000),
    )
    yield (
        "ascii.stl",
        lambda: (
            "solid a\n"
            + "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
            * 90_000
            + "endsolid a\n"
        ),
    )
    yield "faces.obj", lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 1_200_000
    yield (
        "objects.obj",
        lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "".join(f"o a{k}\nf 1 2 3\n" for k in range(500_000)),
    )
    yield (
        "materials.obj",
        lambda: "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "".join(f"usemtl a{k}\nf 1 2 3\n" for k in range(400_000)),
    )
    yield "fan.obj", lambda: "v 0 0 0\n" * 10 + "f " + "1 " * 4_000_000 + "\n"
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    faces = "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
    ply = "ply\nformat {} 1.0\nelement vertex {}\n" + axes + faces
    yield (
        "count.ply",
        lambda: ply.format("binary_little_endian", 900_000_000, 900_000_000).encode() + bytes(10_000),
    )
    yield "text-count.ply", lambda: ply.format("ascii", 900_000_000, 900_000_000) + "0 0 0\n" * 1000
    gltf = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"componentType": 5126, "count": 900_000_000, "type": "VEC3"}],
    }  # fmt: skip
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    size = struct.pack("<I", len(text))
    yield "sparse.glb", lambda: b"glTF" + struct.pack("<II", 2, 20 + len(text)) + size + b"JSON" + text
    yield "sparse.gltf", lambda: text
    yield "bomb.zip", lambda: zipped("a.stl", bytes(300_000_000))
    yield "bomb.3mf", lambda: zipped("a.model", bytes(300_000_000))
    yield "deep.dae", lambda: "<COLLADA>" + "<a>" * 1_000_000 + "</a>" * 1_000_000 + "</COLLADA>"
    entity = "".join(f"<!ENTITY e{k} '{f'&e{k - 1};' * 10}'>" for k in range(1, 10))
    yield "entities.dae", lambda: f"<!DOCTYPE a [<!ENTITY e0 'aaaa'>{entity}]><COLLADA>&e9;</COLLADA>"


def readers(suffix: str) -> list[Callable[[Path], object]]:
    """Whatever reads files of a kind."""
    import screwkin as sk
    from screwkin.analysis.verdict import verdict_from_json
    from screwkin.files import LARGEST_TEXT, read_file
    from screwkin.model.meshes import load_mesh
    from screwkin.motors.bench import load_bench_log
    from screwkin.motors.library import load_motor
    from screwkin.papers.claims import load_paper
    from screwkin.servo.log import load_log

    def verdict(path: Path) -> object:
        return verdict_from_json(read_file(path, LARGEST_TEXT).decode())

    known: dict[str, list[Callable[[Path], object]]] = {
        ".npz": [sk.load_trajectory, load_log],
        ".toml": [sk.load_robot, sk.load_gait, load_motor, load_paper],
        ".urdf": [sk.load_robot],
        ".xml": [sk.load_robot],
        ".csv": [sk.load_robot],
        ".json": [verdict, load_bench_log],
    }
    return known.get(suffix, [load_mesh])


def files(kinds: str = "") -> Iterator[tuple[str, bytes]]:
    """Name and content of every file whose name begins with one of these, separated by commas."""
    for source in (archives, tables, markup, others):
        for name, made in source():
            if name.startswith(tuple(kinds.split(", "))):
                content = made()
                data = content.encode() if isinstance(content, str) else content
                assert len(data) <= LARGEST + 100, (name, len(data))
                yield name, data


def read(path: Path, reader: Callable[[Path], object]) -> tuple[str, float, int]:
    """What became of reading a file in a process of its own; its processor time [s] and memory [MB]."""
    from screwkin.errors import InputError

    told, tell = os.pipe()
    child = os.fork()
    if not child:
        warnings.simplefilter("ignore")
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
        try:
            reader(path)
            outcome = "read"
        except InputError as error:
            outcome = f"refused: {str(error)[:300]}"
        except BaseException as error:
            outcome = f"FAILED: {type(error).__name__}: {str(error)[:300]}"
        os.write(tell, outcome.encode())
        os._exit(0)
    os.close(tell)
    text = b""
    while more := os.read(told, 65536):
        text += more
    os.close(told)
    _, status, used = os.wait4(child, 0)
    outcome = text.decode(errors="replace") if not status else f"FAILED: ended with {status}"
    return outcome, used.ru_utime + used.ru_stime, used.ru_maxrss // 1024


def main(folder: Path, kinds: str = "") -> int:
    """Write and read all; the number of failures."""
    readers("")
    import mujoco  # noqa: F401
    import trimesh  # noqa: F401

    failures = 0
    for name, data in files(kinds):
        path = folder / name
        path.write_bytes(data)
        for reader in readers(path.suffix):
            outcome, seconds, memory = read(path, reader)
            failures += "FAILED" in outcome
            about = f"{name} ({len(data) / 1e6:.1f} MB), {reader.__name__}"
            print(f"{about}: {seconds:.1f} s, {memory} MB; {outcome}", flush=True)
        path.unlink()
    print(f"{failures} failed")
    return failures


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), *sys.argv[2:]) > 0)
