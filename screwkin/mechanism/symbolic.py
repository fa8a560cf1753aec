"""Symbolic twin of a limb: its positions, Jacobian and network block in sympy, by the numeric formulas.

The formulas run on symbols and give expressions thousands of terms long; every expression is then brought to
one canonical form (``Tidy``): products of sines and cosines of joints that turn about parallel axes become
sines and cosines of sums, as in the textbooks' c345, and squares of sines disappear.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from screwkin.algebra.scalar import Scalar, is_symbolic
from screwkin.algebra.se3 import ZERO, Twist, Vector, as_array, leaves, map_scalars
from screwkin.errors import InputError, needed_for
from screwkin.kinematics.positions import joint_twists, link_displacements, pose_in_base
from screwkin.mechanism.chains import chain_screws
from screwkin.mechanism.mechanism import Mechanism, unchosen
from screwkin.mechanism.network import network_blocks
from screwkin.model.robot import Robot, refuse_coupled

NUMERIC = "ask network_matrix for numbers, which couples them"

Matrix = Any
Symbol = Any


@dataclass(frozen=True)
class SymbolicLimb:
    """A limb in symbols; numbers and parameters as the table has them.

    Attributes:
        name: the limb, or the loop.
        symbols: symbol of every real joint, in table order, and of every virtual coupling, by name.
        parallel: groups of joints that turn about parallel axes, one after the other.
        fk: (4, 4) pose of the tip in the base frame; None for a loop.
        jacobian: (6, joints) in base axes, [omega; v at the base origin]; None for a loop.
        couplings: names of the columns of the network block.
        network_block: (6, couplings) rows of the network matrix that belong to the limb's circuit, taken at
            the base origin with the base upright; virtual rotations are coordinates of their own.
        origin: symbols x, y, z of the tip's origin in the network block, for the last column of ``fk``.
    """

    name: str
    symbols: Mapping[str, Symbol]
    parallel: tuple[tuple[Symbol, ...], ...]
    fk: Matrix | None
    jacobian: Matrix | None
    couplings: tuple[str, ...]
    network_block: Matrix
    origin: tuple[Symbol, ...] = ()


def symbolic_limb(robot: Robot, limb: str) -> SymbolicLimb:
    """Forward kinematics, screw Jacobian and network block of one limb, in sympy.

    Args:
        robot: from ``parse_robot(text, symbolic=True)``, whose parameters stay symbols; or a numeric one.
        limb: name of a limb, or of its tip.

    Raises:
        UnknownNameError: no such limb.

    Source: paper A, eq. 3, 5, 8-9.
    """
    single = named_formulas(limb_alone(robot, limb))
    chosen = single.limbs[0]
    mechanism = _mechanism(single)
    symbols = coupling_symbols(mechanism)
    q = [symbols[name] for name in single.joint_names]
    tidy = Tidy(single, q, tuple(symbols.values()))
    D = link_displacements(single, q)
    tip = map_scalars(tidy, pose_in_base(single, D, chosen.tip))
    columns = [map_scalars(tidy, t) for t in joint_twists(single, D)]
    twists = dict(zip(single.joint_names, columns, strict=True))
    origin = origin_symbols(single)
    for chain in mechanism.chains:
        turning = [name for name in chain.names if name.split(".")[1][0] == "r"]
        if chain.limb is None:  # the block is that of an upright waist
            virtual = chain_screws(chain.couplings, [0] * len(turning), ZERO)
        else:
            virtual = chain_screws(chain.couplings, [symbols[name] for name in turning], Vector(*origin))
        twists |= zip(chain.names, (map_scalars(tidy, t) for t in virtual), strict=True)
    block = network_blocks(mechanism, [twists[name] for name in mechanism.couplings])[0]
    return SymbolicLimb(
        chosen.name,
        symbols,
        tidy.groups,
        _matrix(tip),
        _columns(columns),
        mechanism.couplings,
        _columns(block),
        origin,
    )


def symbolic_loops(robot: Robot) -> tuple[SymbolicLimb, ...]:
    """The loops of a mechanism without limbs: their rows of the network matrix, in sympy.

    Raises:
        InputError: the table has no loops, or coupled joints.
    """
    refuse_coupled(robot, range(len(robot.tree)), "the symbolic network matrix", NUMERIC)
    mechanism = _mechanism(named_formulas(robot))
    robot, symbols = mechanism.robot, coupling_symbols(mechanism)
    q = [symbols[name] for name in robot.joint_names]
    tidy = Tidy(robot, q, tuple(symbols.values()))
    columns = [map_scalars(tidy, t) for t in joint_twists(robot, link_displacements(robot, q))]
    twists = dict(zip(robot.joint_names, columns, strict=True))
    rows = network_blocks(mechanism, [twists[name] for name in mechanism.couplings])
    loops = []
    for name, circuit, row in zip(mechanism.circuit_names, mechanism.circuits, rows, strict=True):
        block = [row[mechanism.position[coupling]] for coupling in circuit]
        loops.append(SymbolicLimb(name, symbols, tidy.groups, None, None, tuple(circuit), _columns(block)))
    return tuple(loops)


def named_formulas(robot: Robot) -> Robot:
    """The robot with parameters that are roots or inverse functions of others as symbols of their names."""
    with needed_for("a symbolic model"):
        import sympy

    hard = (sympy.asin, sympy.acos, sympy.atan, sympy.atan2)
    formulas = [
        (value, sympy.Symbol(name, real=True))
        for name, value in robot.parameters.items()
        if is_symbolic(value)
        and not value.is_Symbol
        and (value.has(*hard) or (value.is_Pow and not value.exp.is_Integer))
    ]
    formulas.sort(key=lambda pair: -pair[0].count_ops())

    def named(x: Scalar) -> Scalar:
        return x.subs(formulas) if formulas and is_symbolic(x) else x

    joints = tuple(replace(j, screw=map_scalars(named, j.screw)) for j in robot.joints)
    limbs = tuple(replace(limb, frame=map_scalars(named, limb.frame)) for limb in robot.limbs)
    return replace(robot, joints=joints, limbs=limbs)


def limb_alone(robot: Robot, limb: str) -> Robot:
    """The robot with nothing but one limb and the links and joints that lead to it.

    Raises:
        InputError: one of these joints is coupled to another joint.
    """
    chosen = robot.limb(limb)
    path = robot.path_to(chosen.link)
    refuse_coupled(robot, path, f"the symbolic model of {chosen.name}", NUMERIC)
    joints = tuple(robot.joints[i] for i in path)
    names = {robot.base_link, *(joint.child for joint in joints)}
    links = tuple(link for link in robot.links if link.name in names)
    bare: dict[str, Any] = dict.fromkeys(("soles", "closures", "coupled", "postures"), ())
    return replace(robot, links=links, joints=joints, limbs=(chosen,), **bare)


def _mechanism(robot: Robot) -> Mechanism:
    """The closed mechanism without a choice of primary couplings, which needs numbers."""
    mechanism = unchosen(robot)
    if len(mechanism.couplings) < len(mechanism.links):
        raise InputError(f"{robot.name} has neither limbs nor closures, so no circuits to write down")
    return mechanism


def coupling_symbols(mechanism: Mechanism) -> dict[str, Symbol]:
    """A real symbol for every coupling, ``q_`` and its name; never the name of a parameter."""
    virtual = [name for chain in mechanism.chains for name in chain.names]
    names = [*mechanism.robot.joint_names, *virtual]
    return dict(zip(names, _fresh(mechanism.robot, [f"q_{name}" for name in names]), strict=True))


def origin_symbols(robot: Robot) -> tuple[Symbol, ...]:
    """Real symbols x, y, z; never the name of a parameter."""
    return _fresh(robot, ["x", "y", "z"])


def _fresh(robot: Robot, names: Sequence[str]) -> tuple[Symbol, ...]:
    import sympy

    while set(names) & set(robot.parameters):
        names = [f"{name}_" for name in names]
    return tuple(sympy.Symbol(name, real=True) for name in names)


def parallel_groups(robot: Robot, q: Sequence[Symbol]) -> tuple[tuple[Symbol, ...], ...]:
    """Runs of successive turning joints with the same axis direction: only sums of their angles matter."""
    groups: list[list[Symbol]] = []
    for i in robot.traversal:
        joint = robot.joints[i]
        if joint.type != "revolute":
            continue
        above = robot.joint_above.get(joint.parent)
        same = above is not None and tuple(robot.joints[above].screw.s) == tuple(joint.screw.s)
        for group in groups:
            if same and above is not None and group[-1] == q[above]:
                group.append(q[i])
                break
        else:
            groups.append([q[i]])
    return tuple(tuple(group) for group in groups if len(group) > 1)


class Tidy:
    """Brings expressions of one robot to their canonical form: exact, and as short as collecting makes it."""

    def __init__(self, robot: Robot, q: Sequence[Symbol], moving: Sequence[Symbol]) -> None:
        """``q`` are the joints' symbols in table order, ``moving`` all symbols that are coordinates."""
        import sympy

        self.groups = parallel_groups(robot, q)
        angles = sorted({a for x in leaves_of(robot) for a in _plain_angles(x)} - set(moving), key=str)
        self._moving = tuple(moving)
        self._waves = {a: (sympy.Dummy(f"c{a}"), sympy.Dummy(f"s{a}")) for a in (*moving, *angles)}
        self._flat = {sympy.cos(a): c for a, (c, _) in self._waves.items()}
        self._flat |= {sympy.sin(a): s for a, (_, s) in self._waves.items()}
        self._back = {wave: f for f, wave in self._flat.items()}

    def __call__(self, x: Scalar) -> Scalar:
        """The canonical form of a polynomial in sines and cosines of the coordinates.

        Products of sines and cosines of a group of parallel joints become those of sums, squares of other
        sines become one minus the cosine's; all other symbols are coefficients.
        """
        import sympy

        if not is_symbolic(x) or not x.free_symbols:
            return x
        flat = sympy.expand_trig(_exact(x)).xreplace(self._flat)
        others = {f: sympy.Dummy() for f in flat.atoms(sympy.Function)}
        flat = flat.xreplace(others)
        waves = {a: pair for a, pair in self._waves.items() if flat.has(*pair)}
        expanded = _reduced(flat, waves)
        for group in self.groups:
            expanded = _summed(expanded, waves, [a for a in group if a in waves])
        back = self._back | {dummy: f for f, dummy in others.items()}
        return _decimal(_shortest(expanded.xreplace(back), self._moving))


def leaves_of(robot: Robot) -> list[Scalar]:
    """Every symbolic number of the robot's joints and frames."""
    records = [*(j.screw for j in robot.joints), *(limb.frame for limb in robot.limbs)]
    return [x for record in records for x in leaves(record) if is_symbolic(x)]


def _plain_angles(x: Scalar) -> set[Symbol]:
    """Symbols in sums of which the expression takes sines and cosines."""
    import sympy

    arguments = [f.args[0] for f in x.atoms(sympy.sin, sympy.cos)]
    return {s for a in arguments for s in a.free_symbols if a.is_polynomial(*a.free_symbols)}


def _exact(x: Scalar) -> Scalar:
    """Decimals as the fractions that they are written as, so that equal terms cancel exactly."""
    import sympy

    return x.xreplace({f: sympy.Rational(str(float(f))) for f in x.atoms(sympy.Float)})


def _decimal(x: Scalar) -> Scalar:
    """Fractions that are no simple ones as decimals again."""
    import sympy

    return x.xreplace({n: sympy.Float(n) for n in x.atoms(sympy.Rational) if n.q > 64})


def _reduced(flat: Scalar, waves: Mapping[Symbol, tuple[Symbol, Symbol]]) -> Scalar:
    """Expanded, with the square of every sine replaced by one minus the cosine's."""
    import sympy

    if not waves:
        return sympy.expand(flat)
    gens = [w for pair in waves.values() for w in pair]
    poly = sympy.Poly(flat, *gens)
    total = []
    for powers, coefficient in poly.terms():
        term = coefficient
        for (c, s), (m, n) in zip(waves.values(), zip(powers[::2], powers[1::2], strict=True), strict=True):
            term *= c**m * s ** (n % 2) * (1 - c**2) ** (n // 2)
        total.append(term)
    return sympy.expand(sympy.Add(*total))


def _summed(
    expanded: Scalar, waves: Mapping[Symbol, tuple[Symbol, Symbol]], group: Sequence[Symbol]
) -> Scalar:
    """Products of the group's sines and cosines written as sines and cosines of sums."""
    import sympy

    if len(group) < 2:
        return expanded
    poly = sympy.Poly(expanded, *(w for a in group for w in waves[a]))
    terms = [coefficient * _sum_of(tuple(group), powers) for powers, coefficient in poly.terms()]
    return sympy.expand(sympy.Add(*terms))


@cache
def _sum_of(group: tuple[Symbol, ...], powers: tuple[int, ...]) -> Scalar:
    """A product of powers of the cosines and sines of some angles, as a sum of cosines and sines."""
    import sympy
    from sympy.simplify.fu import TR8

    waves = [wave(a) for a in group for wave in (sympy.cos, sympy.sin)]
    return TR8(sympy.Mul(*(wave**power for wave, power in zip(waves, powers, strict=True))))


def _shortest(expanded: Scalar, moving: Sequence[Symbol]) -> Scalar:
    """The expression collected in the way that leaves the fewest operations."""
    import sympy

    if not expanded.is_Add:
        return expanded
    waves = sorted((f for f in expanded.atoms(sympy.sin, sympy.cos) if f.has(*moving)), key=str)
    lengths = sorted(expanded.free_symbols - set(moving), key=str)
    ways = [lengths, *([wave] for wave in waves)]
    candidates = [expanded, sympy.factor_terms(expanded)]
    candidates += [sympy.collect(expanded, way) for way in ways if way]
    return min(candidates, key=lambda e: int(e.count_ops()))


def _matrix(pose: Any) -> Matrix:
    import sympy

    return sympy.Matrix(as_array(pose).tolist())


def _columns(twists: Sequence[Twist]) -> Matrix:
    import sympy

    return sympy.Matrix([[*twist.omega, *twist.v] for twist in twists]).T
