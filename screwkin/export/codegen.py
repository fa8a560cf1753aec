"""C files of a robot for other programs and microcontrollers: source, header, and a driver that tests."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from screwkin.algebra.arrays import Array
from screwkin.algebra.se3 import as_array
from screwkin.compiler.emit_c import Real, argument, header, source
from screwkin.compiler.program import Group, Program
from screwkin.compiler.records import identifier
from screwkin.compiler.run import run
from screwkin.compliance import deflection
from screwkin.dynamics.margin import margin
from screwkin.errors import InputError, UnknownNameError
from screwkin.export.quantities import QUANTITIES, programs
from screwkin.ik import programs as limbs
from screwkin.ik.closed import recognised
from screwkin.kinematics.mass import GRAVITY
from screwkin.kinematics.positions import link_displacements, pose_in_base
from screwkin.kinematics.serial_chain import SerialChain
from screwkin.mechanism.tip_motion import motion_program
from screwkin.model.robot import Robot
from screwkin.stabiliser.walk import cycle_in_a_step, stabiliser_of

TOLERANCE: Mapping[Real, float] = {"double": 1e-12, "float": 1e-5}
"""Largest difference that the driver accepts, relative to the largest entry of a result (at least 1)."""


def _closed_limbs(robot: Robot) -> list[Program]:
    solved = [x.name for x in robot.limbs if recognised(SerialChain.of(robot, x.name))]
    return [limbs.limb_nearest(robot, name) for name in solved]


def _deflections(robot: Robot) -> list[Program]:
    """On either leg; a robot without legs is held by its base."""
    if robot.closures or not (robot.mass > 0 and robot.joints):
        raise InputError(f"{robot.name} has closures, or no mass or joints; deflections are those of trees")
    legs = [limb.tip for limb in robot.limbs if limb.kind == "leg"]
    return [deflection.linear(robot, support) for support in legs or ["base"]]


SHORT = {
    "tips": "tip_poses",
    "links": "link_poses",
    "com": "center_of_mass",
    "jacobian": "limb_jacobian",
    "zmp": "balance",
}
"""Short names of quantities."""
KINDS: Mapping[str, Callable[[Robot], list[Program]]] = {
    **{name: partial(programs, name=name) for name in QUANTITIES if name not in SHORT.values()},
    **{short: partial(programs, name=name) for short, name in SHORT.items()},
    "rates": lambda robot: [motion_program(robot)],
    "motion": lambda robot: [motion_program(robot, True)],
    "ik": _closed_limbs,
    "margin": lambda robot: [margin(robot)],
    "deflection": _deflections,
    "stabiliser": lambda robot: [stabiliser_of(robot)],
}
"""What can be asked for: quantities, and what algorithms are made of."""


def programs_of(robot: Robot, kinds: Sequence[str]) -> list[Program]:
    """The programs of some kinds, each once.

    Raises:
        UnknownNameError: there is no such kind. InputError: the robot has no such program.
    """
    found: dict[str, Program] = {}
    for kind in kinds:
        if kind not in KINDS:
            raise UnknownNameError("kind of program", kind, tuple(KINDS))
        made = KINDS[kind](robot)
        if not made:
            limb = "limb with a closed form" if kind == "ik" else "limb"
            raise InputError(f"{robot.name} has no {limb}, which {kind} needs")
        for program in made:
            if found.setdefault(program.name, program) is not program:
                raise InputError(
                    f"{robot.name} has two functions {program.name!r}; names of limbs must differ in their "
                    "letters and digits"
                )
    if not found:
        raise InputError(f"nothing is asked for; valid: {', '.join(KINDS)}")
    return list(found.values())


def c_files(robot: Robot, programs: Sequence[Program], real: Real = "double") -> dict[str, str]:
    """Text by file name: ``NAME.h``, ``NAME.c``, the driver ``test_NAME.c`` and a README."""
    name = identifier(robot.name)
    return {
        f"{name}.h": header(programs, f"{name.upper()}_H", real),
        f"{name}.c": source(programs, f"{name}.h", real),
        f"test_{name}.c": _driver(robot, programs, name, TOLERANCE[real]),
        "README.md": _readme(robot, programs, name, real),
    }


def example(robot: Robot, program: Program) -> dict[str, Array]:
    """One sample of inputs near the first posture, the same at every call."""
    rng = np.random.default_rng(0)
    posture = robot.posture("home") if any(p.name == "home" for p in robot.postures) else None
    home = np.array(posture.q if posture else [0.1] * len(robot.joints), dtype=float)
    q, T = home + rng.uniform(-0.1, 0.1, len(home)), np.eye(4)
    T[2, 3] = posture.base_height if posture else 0.0
    sample: dict[str, Array] = {
        "T_world_base": T,
        "q": q,
        "gravity": np.array([GRAVITY]),
        "zmp": T[:2, 3] + 0.01,
    }
    sample["stiffness"] = np.linspace(40.0, 80.0, len(home))
    sample["contact"] = np.ones(len({sole.limb for sole in robot.soles}))
    if program.name == identifier(robot.name, "stabiliser"):
        return cycle_in_a_step(robot)
    D = link_displacements(robot, q.tolist())
    for limb in robot.limbs:
        pose = as_array(pose_in_base(robot, D, limb.tip))
        sample[identifier("T_world", limb.tip)] = T @ pose
        if program.name == identifier(robot.name, limb.name, "nearest"):
            sample |= {"T_base_tip": pose, "guess": home[list(SerialChain.of(robot, limb.name).joints)]}
    return {
        g.name: sample[g.name] if g.name in sample else rng.uniform(-1, 1, g.shape) for g in program.inputs
    }


def _array(name: str, values: Array) -> str:
    return f"static const screwkin_real {name}[] = {{{', '.join(map(repr, np.ravel(values).tolist()))}}};"


def _driver(robot: Robot, programs: Sequence[Program], name: str, tolerance: float) -> str:
    """A program that runs every function on one sample and on nineteen, against numbers from Python."""
    parts = []
    for program in programs:
        given = example(robot, program)
        wanted = run(program, given, path="numpy")
        parts += [_array(f"{program.name}_{g.name}", given[g.name]) for g in program.inputs]
        parts += [_array(f"{program.name}_{g.name}_wanted", wanted[g.name]) for g in program.outputs]
        parts.append(_trial(program))
    calls = "\n".join(f"    failed += try_{p.name}(1) + try_{p.name}(SAMPLES);" for p in programs)
    return f"""#include "{name}.h"
#include <stdio.h>

#define SAMPLES 19

static int differs(const char *what, const screwkin_real *found, const screwkin_real *wanted,
    size_t n, size_t m)
{{
    double scale = 1.0, worst = 0.0;
    for (size_t k = 0; k < n; ++k)
        if (wanted[k] > scale || -wanted[k] > scale)
            scale = wanted[k] < 0 ? -wanted[k] : wanted[k];
    for (size_t k = 0; k < n * m; ++k) {{
        const double gap = (double)found[k] - (double)wanted[k % n];
        if (!(gap <= worst && -gap <= worst))
            worst = gap < 0 ? -gap : gap;
    }}
    printf("%-40s %3d samples: largest difference %.2g\\n", what, (int)m, worst / scale);
    return !(worst <= {tolerance!r} * scale);
}}

{chr(10).join(parts)}

int main(void)
{{
    int failed = 0;
{calls}
    return failed ? 1 : 0;
}}
"""


def _trial(program: Program) -> str:
    def buffer(group: Group) -> str:
        return f"    static screwkin_real {argument(group)}[{group.size} * SAMPLES];"

    loads = "\n".join(
        f"        for (size_t k = 0; k < {g.size}; ++k)\n"
        f"            {argument(g)}[i * {g.size} + k] = {program.name}_{g.name}[k];"
        for g in program.inputs
    )
    name = program.name
    checks = " + ".join(
        f'differs("{name}: {g.name}", {argument(g)}, {name}_{g.name}_wanted, {g.size}, samples)'
        for g in program.outputs
    )
    arguments = ", ".join(["samples", *(argument(g) for g in (*program.inputs, *program.outputs))])
    buffers = "\n".join(buffer(g) for g in (*program.inputs, *program.outputs))
    return f"""
static int try_{program.name}(size_t samples)
{{
{buffers}
    for (size_t i = 0; i < samples; ++i) {{
{loads}
    }}
    {program.name}({arguments});
    return {checks};
}}
"""


def _readme(robot: Robot, programs: Sequence[Program], name: str, real: Real) -> str:
    rows = "\n".join(f"- `{p.name}`: {p.about} {p.operations} operations a sample." for p in programs)
    return f"""# {robot.name} in C

Made by screwkin from the screw table of `{robot.name}`; numbers are of type `{real}`, units SI, angles in
rad. No allocation; the square root of the C library is all that is needed. `{name}.h` tells the
arguments: arrays hold sample after sample, row by row.

{rows}

For wide vectors over the samples and fused multiply-adds: `-O2 -march=native -ffp-contract=fast
-fno-math-errno -fno-trapping-math`; GCC gains another fifth by `-fschedule-insns -fsched-pressure`.
`-DSCREWKIN_SCALAR` computes one sample at a time. The driver compares with numbers from Python and exits with
1 if one differs:

```sh
cc -std=c99 -O2 -o test_{name} test_{name}.c {name}.c -lm && ./test_{name}
```
"""
