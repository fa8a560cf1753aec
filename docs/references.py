"""Pages of reference, written from the code itself: keys of tables and gaits, commands, functions."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import gallery  # beside this file
import typer

import screwkin as sk
from screwkin import errors
from screwkin.analysis.verdict import Criteria, Measured, Verdict
from screwkin.cli import OPTIONS, VERBS, verb_app
from screwkin.files import atomic_write
from screwkin.gait.keypoints import CHANNELS
from screwkin.gait.keys import KEYS
from screwkin.gait.preview_plan import SETTINGS
from screwkin.gait.relative import NOMINAL
from screwkin.model import schema, servo_section
from screwkin.motors.records import Friction, Motor, MotorModel
from screwkin.servo import model_file, servo_map
from screwkin.sim.perturbation import Perturbation

TABLES_BEGIN = """\
A table is a TOML file. All points, axes and frames are those of the zero pose, in base axes from the base
origin. Any number may be arithmetic over `[parameters]`, such as `"thigh + 2*mm"`; `pi`, `deg` and `mm`
are known. Unknown keys are errors. `[waist]` is the frame that gaits steer, by default midway between the
hips."""
WAIST = """\
The frame that gaits steer, fixed to the base link: its origin is what `waist_height` is the height of, x is
ahead and z up at `home`. Without this table it lies midway between the hips, its axes those of the feet at
`home`."""
MIRRORED = """\
Links, joints, closures, tips and soles of the limb are reflected, from the first link on whose name has a
side; their names and that of the limb must say `right` or `left` (`right_knee`), or begin with `R_` or `L_`.
A joint whose axis lies in the xz plane keeps its axis, and its limits change sign and places (0 to 2 becomes
-2 to 0), as those of a prismatic joint along y; every other joint has the mirrored axis and the same limits.
Postures and `[servos]` are not reflected: give the positions, ids, directions and zeros of both sides."""
GAITS_BEGIN = """\
A gait is a TOML file. `screwkin gaits` lists the bundled ones, `screwkin walk ROBOT --gait FILE` walks
it, and `--set key=value` changes any key for one walk."""
CHANNELS_BEGIN = """\
Key points: `at` in steps, and the `value` there. A gait of kind `geometric` needs all channels, others
the two of the feet. `swing` holds for the swinging foot only, `advance` gains one a step, `alternate`
changes its sign with every step, `repeat` does not."""
ERRORS_BEGIN = """\
All that is raised on purpose is a `screwkin.ScrewkinError`; the classes stand in `screwkin.errors`. Most are
also the built-in error that one would expect, so `except ValueError` holds for wrong input."""
COMMANDS_BEGIN = """\
Exit codes: 0 good; 1 unexpected; 2 bad input or usage; 3 the answer is no; 4 refused for safety; 130
interrupted. `--json` prints one JSON object and nothing else; `-o DIR` says where files go. Tables and texts
fold at blanks in narrow terminals; a name that is nearly right is answered by the right one; Ctrl-C leaves
whole files only. Options that stand alone, or anywhere in a line:"""

CHANNEL_MEANINGS = {
    "foot_progress": "share of the way from foothold to foothold",
    "foot_height": "height of the sole above the floor [m]",
    "waist_progress": "share of the way between the waist's places at the ends of a step",
    "waist_side": "towards the supporting foot [m]",
    "hand_forward": "forward of the shoulder, of the hand on the side of the swinging foot [m]",
    "hand_raise": "above hand_drop below the shoulder, both hands [m]",
}
LENGTH_MEANINGS = {
    "leg": "from hip to sole: greatest height of the hips above the floor, stretched straight down from "
    "`home` as far as joints and limits allow",
    "hip": "distance of the hips from each other; a hip is the point of the leg's first own axis nearest to "
    "the next one that is not parallel to it",
    "sole": "length of the shorter sole, along the foot's x axis",
    "waist": "height of the steered frame above the hips; 0 without `[waist]`",
    "arm": "how far the hand of the shorter arm hangs below its shoulder at `home`; half a `leg` "
    "where none does",
}
PREVIEW_MEANINGS = {
    "dsp": ("share of Tc with both feet on the floor", "must be given; 0.2"),
    "horizon": ("how far the controller looks ahead [s]", "must be given; 1.6"),
    "Qe": ("weight of the ZMP error", "must be given; 1"),
    "Qx": ("weight of changes of the state", "must be given; 0"),
    "R": ("weight of changes of the jerk", "must be given; 1e-6"),
    "ahead": ("how far the ZMP lies ahead of the ankle, as a share of the sole's middle", "`1`"),
    "inward": ("share of the way from the sole's middle to its inner edge", "`0`"),
    "stand": ("steps during which the robot stands before the first step and after the last", "`1`"),
}
"""Parameters of gaits of kind preview: meaning, and default or usual value."""
SMALL_GAIT = """\
[gait]
name = "small"
kind = "preview"
Tc = 0.8
stride = "0.15*leg"
lift = "0.06*leg"
waist_height = "0.92*leg + waist"
hand_drop = "arm"

[parameters]
dsp = 0.2
horizon = 1.6
Qe = 1
Qx = 0
R = 1e-6

[channel.foot_progress]
at = ["dsp", 1]
value = [0, 1]

[channel.foot_height]
at = ["dsp", "(1 + dsp)/2", 1]
value = [0, "lift", 0]
"""
"""A whole gait; a test lets bundled bipeds walk it."""


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table; bars in cells are escaped."""
    signs = {"|": "\\|", "\n": " ", "<": "\\<"}
    cells = [[str(cell).translate(str.maketrans(signs)) for cell in row] for row in (head, *rows)]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return "\n".join([lines[0], "|" + "---|" * len(head), *lines[1:]])


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names) + "."


def code(value: object) -> str:
    """A value as code; a dash for none."""
    return "-" if value is None or value in ("", ()) else f"`{value}`"


def robot_tables() -> str:
    """Every key of a robot's table."""
    parts = ["# Robot and mechanism tables", TABLES_BEGIN, "Keys at the top: " + _listed(schema.TABLES)]
    parts += [
        _row_model(f"[{'[' * (name != 'robot')}{name}{']' * (name != 'robot')}]", kind)
        for name, kind in {"robot": schema.RobotRow, **schema.ROWS}.items()
    ]
    parts += [_row_model("[[limb]] with mirror", schema.MirrorRow), MIRRORED]
    parts.append(_row_model("[waist]", schema.FrameRow).replace("A frame in", WAIST + " A frame in", 1))
    inline = {
        "frame": schema.FrameRow,
        "inertia": schema.InertiaRow,
        "boxes": schema.BoxRow,
        "shapes": schema.ShapeRow,
        "mimic": schema.MimicRow,
        "spring": schema.SpringRow,
    }
    parts += [_row_model(f"inline: {name}", kind) for name, kind in inline.items()]
    parts += [
        "## [servos]",
        _doc(servo_map),
        "Keys: " + _listed(servo_section.KEYS),
    ]
    return "\n\n".join(parts)


def _row_model(title: str, kind: type[schema.Row]) -> str:
    rows = [
        (
            f"`{name}`",
            field.description,
            "must be given" if field.is_required() else code(_shown(field.default)),
        )
        for name, field in kind.model_fields.items()
    ]
    text = _doc(kind).partition(": ")[2] if _doc(kind).startswith("[") else _doc(kind)
    return f"## {title}\n\n{text[:1].upper()}{text[1:]}\n\n{table(('key', 'what', 'default'), rows)}"


def _shown(value: object) -> object:
    triple = [getattr(value, name, None) for name in "xyz"]
    return triple if None not in triple else value


def gaits() -> str:
    """Every key of a gait's file."""
    rows = [
        (
            f"`{name}`",
            key.meaning + (f": {', '.join(f'`{c}`' for c in key.choices)}" if key.choices else ""),
            key.unit or "-",
            "must be given" if key.default is None else code(key.default),
        )
        for name, key in KEYS.items()
    ]
    channels = [(f"`{name}`", CHANNEL_MEANINGS[name], kind) for name, kind in CHANNELS.items()]
    lengths = [(f"`{name}`", LENGTH_MEANINGS[name]) for name in NOMINAL]
    preview = [
        (f"`{name}`", *PREVIEW_MEANINGS[name]) for name in dict.fromkeys([*SETTINGS, *PREVIEW_MEANINGS])
    ]
    return "\n\n".join(
        [
            "# Gait files",
            GAITS_BEGIN,
            f"A whole gait file, for any biped:\n\n```toml\n{SMALL_GAIT}```",
            "## [gait]",
            table(("key", "what", "unit", "default"), rows),
            "## [parameters]",
            "Numbers of your own, for formulas anywhere in the file. Gaits of kind `preview` and "
            "`footsteps` read these:",
            table(("parameter", "what", "default, or usual"), preview),
            "## Lengths of the robot",
            "Formulas may use lengths of the robot at hand, so that one gait fits many: "
            '`stride = "0.3*leg"`. A trajectory records their values with its '
            "gait.",
            table(("length", "what"), lengths),
            "## [channel.NAME]",
            CHANNELS_BEGIN,
            table(("channel", "what", "goes on"), channels),
            "## [[foothold]]",
            "Steps of kind `footsteps`: `x`, `y` [m], `yaw` [rad], perhaps `z` [m], of the foot that swings.",
        ]
    )


def commands() -> str:
    """Every verb with its arguments and options."""
    parts = [
        "# Command line",
        COMMANDS_BEGIN,
        table(("option", "what"), [(code(name), text) for name, text in OPTIONS.items()]),
    ]
    return "\n\n".join(
        [
            *parts,
            *(
                part
                for verb in VERBS
                for part in _verb(f"screwkin {verb}", typer.main.get_command(verb_app(verb)))
            ),
        ]
    )


def _verb(name: str, command: Any) -> Iterator[str]:
    """A verb and the verbs in it: its help, arguments and options."""
    yield f"## {name}"
    yield inspect.cleandoc(command.help or "").replace("<", "\\<")
    rows = [
        (
            code(
                parameter.metavar or parameter.name
                if parameter.param_type_name == "argument"
                else ", ".join([*parameter.opts, *parameter.secondary_opts])
            ),
            parameter.help or "-",
        )
        for parameter in command.params
        if "--help" not in parameter.opts and not getattr(parameter, "hidden", False)
    ]
    if rows:
        yield table(("argument or option", "what"), rows)
    for part, inner in getattr(command, "commands", {}).items():
        yield from _verb(f"{name} {part}", inner)


def records() -> str:
    """Fields of what files hold besides: verdicts, perturbations, motors, servo models."""
    parts = ["# Verdicts, perturbations and motors"]
    titles = {
        Verdict: "validation.json",
        Criteria: "Criteria of a verdict",
        Perturbation: "[perturbation]",
        MotorModel: "Files of servo models",
        Motor: "[motor]",
        Friction: "[motor.friction]",
    }
    for kind, title in titles.items():
        rows = [(code(f.name), _default(f)) for f in fields(kind)]
        texts = (
            [_doc(kind)]
            + ([_doc(Measured)] if kind is Verdict else [])
            + ([_doc(model_file)] if kind is MotorModel else [])
        )
        parts += [f"## {title}", *texts, table(("field", "default"), rows)]
    return "\n\n".join(parts)


def _default(field: Any) -> str:
    value = field.default_factory() if field.default_factory is not MISSING else field.default
    return "-" if value is MISSING or hasattr(value, "__dataclass_fields__") else code(value)


def _doc(thing: Any) -> str:
    """A docstring as Markdown: indented blocks become code, double backticks single ones."""
    text = inspect.cleandoc(thing.__doc__ or "").replace("``", "`").replace("[[", "\\[[")
    blocks = []
    for block in text.split("\n\n"):
        inner = inspect.cleandoc("\n" + block).replace("\\[[", "[[")
        language = "text" if "…" in inner else "toml"
        blocks.append(f"```{language}\n{inner}\n```" if block.startswith("    ") else block)
    return "\n\n".join(blocks)


def functions() -> str:
    """Every name of the package's root, by Sphinx's reading of its docstring."""
    names = [
        (name, "autoclass" if inspect.isclass(getattr(sk, name)) else "autofunction") for name in sk.__all__
    ]
    parts = [
        "# Python",
        "Every name of `import screwkin as sk`. Arrays may have leading batch dimensions; NumPy in, NumPy "
        "out, JAX in, JAX out.",
        "## Functions",
    ]
    parts += [_auto(name, kind) for name, kind in names if kind == "autofunction"]
    parts += ["## Records", *(_auto(name, kind) for name, kind in names if kind == "autoclass")]
    return "\n\n".join([*parts, "## Errors", ERRORS_BEGIN, *map(_raised, raised_classes())])


def raised_classes() -> list[type[Exception]]:
    """The classes of ``screwkin.errors``, in its order: what is raised, and what is warned of."""
    own = (thing for thing in vars(errors).values() if inspect.isclass(thing))
    return [thing for thing in own if issubclass(thing, Exception) and thing.__module__ == errors.__name__]


def _raised(kind: type[Exception]) -> str:
    """An error as Sphinx reads it, with what the command line returns for it."""
    if issubclass(kind, Warning):
        ends = "A warning; a remark of the command line."
    else:
        ends = f"Exit code {getattr(kind, 'exit_code', 1)}."
    read = f".. autoexception:: {kind.__module__}.{kind.__name__}"
    return f"### {kind.__name__}\n\n{ends}\n\n```{{eval-rst}}\n{read}\n```"


def _auto(name: str, kind: str) -> str:
    members = "\n   :members:" if kind == "autoclass" else ""
    return f"### {name}\n\n```{{eval-rst}}\n.. {kind}:: screwkin.{name}{members}\n```"


RESULTS = Path(__file__).parent.parent / "benchmarks" / "results"
"""Pages that the commands of benchmarks wrote."""
PAGES: Mapping[str, Any] = {
    "gallery": gallery.page,
    "tables": robot_tables,
    "gaits": gaits,
    "command-line": commands,
    "records": records,
    "python": functions,
}
"""What writes each page."""


def write_all(folder: Path) -> None:
    """Write all pages; those that stay the same keep their time, so that Sphinx reads changed ones only."""
    folder.mkdir(exist_ok=True)
    pages = {name: written() + "\n" for name, written in PAGES.items()}
    pages |= {f"result-{path.stem}": path.read_text(encoding="utf-8") for path in RESULTS.glob("*.md")}
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            with atomic_write(path) as file:
                file.write(text)
