"""DH tables as files: read in any unit, written exactly, and every fault told with its line and column."""

from __future__ import annotations

import math

import numpy as np
import pytest

from screwkin.algebra.se3 import as_array
from screwkin.errors import TableError
from screwkin.model.dh import screws_from_dh
from screwkin.model.dh_csv import dh_text, load_dh, parse_dh
from screwkin.model.dh_derive import dh_from_screws
from tests.model.chains import fk_by_matrices, lines, random_chain

HEADER = "convention,joint,alpha_rad,a_m,d_m,offset_rad\n"


def faults(text: str) -> list[str]:
    with pytest.raises(TableError) as caught:
        parse_dh(text, "arm.csv")
    assert caught.value.exit_code == 2
    return [str(fault) for fault in caught.value.faults]


def test_units_are_read_from_the_header():
    one = parse_dh("convention,joint,alpha_deg,a_mm,d_mm,offset_deg\nstandard,q1,90,52,-47,-180\n")
    other = parse_dh(f"{HEADER}standard,q1,{math.pi / 2!r},0.052,-0.047,{-math.pi!r}\n")
    assert one[0].rows == other[0].rows
    assert (one[0].name, one[0].tip) == ("chain", "chain_tip")


def test_a_file_holds_several_chains_with_base_tool_and_comments():
    text = """# both arms
convention, limb, joint, type, alpha_deg, a_mm, d_mm, offset_deg

modified,left,base,fixed,0,0,100,0
modified,left,lift,prismatic,0,0,0,90
# the right one
modified,right,turn,,90,10,0,0
modified,left,left_hand,fixed,0,20,0,0
modified,right,swing,revolute,0,30,0,0
"""
    left, right = parse_dh(text)
    assert (left.name, left.tip, left.joint_names) == ("left", "left_hand", ("lift",))
    assert (right.name, right.tip, right.joint_names) == ("right", "right_tip", ("turn", "swing"))
    tip = as_array(screws_from_dh(left)[1])
    np.testing.assert_array_equal(tip, [[0, -1, 0, 0], [1, 0, 0, 0.02], [0, 0, 1, 0.1], [0, 0, 0, 1]])
    assert screws_from_dh(left)[0][0].is_translation


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_a_written_table_reads_back_to_the_same_numbers_and_motion(convention):
    rng = np.random.default_rng(1)
    tables = []
    for _ in range(20):
        screws, tool, _ = random_chain(rng, 5)
        tables.append(dh_from_screws(screws, tool, convention))
    named = [type(t)(t.convention, t.rows, t.base, t.tool, f"c{i}", f"t{i}") for i, t in enumerate(tables)]
    again = parse_dh(dh_text(named))
    assert [(t.name, t.tip) for t in again] == [(t.name, t.tip) for t in named]
    q = rng.uniform(-3, 3, (10, 5))
    for table, read in zip(tables, again, strict=True):
        assert read.rows == table.rows
        size = max(1.0, *(abs(row.d) for row in table.rows))
        np.testing.assert_allclose(
            fk_by_matrices(read, q), fk_by_matrices(table, q), rtol=0, atol=1e-13 * size
        )
        np.testing.assert_allclose(
            lines(screws_from_dh(read)[0]), lines(screws_from_dh(table)[0]), rtol=0, atol=1e-13 * size
        )


def test_degrees_in_a_column_of_radians_are_noticed():
    assert faults(f"{HEADER}modified,knee,90,0,0,-180") == [
        "line 2 'knee', key alpha_rad: 90 rad is more than a full turn, as degrees would be. "
        "If the column holds degrees, call it alpha_deg; else keep angles within a full turn",
        "line 2 'knee', key offset_rad: -180 rad is more than a full turn, as degrees would be. "
        "If the column holds degrees, call it offset_deg; else keep angles within a full turn",
    ]
    assert parse_dh(f"{HEADER}modified,knee,{2 * math.pi!r},0,0,0")


def test_missing_doubtful_and_doubled_columns_are_told_together():
    assert faults("convention,alpha_rad,alpha_deg,a,d_mm,d_mm,colour\n") == [
        "line 1, key a: has no unit. Name the unit: a_mm or a_m",
        "line 1, key d_mm: is there twice. Keep one column of that name",
        "line 1, key colour: is unknown. Columns: convention, limb, joint, type, alpha_deg, alpha_rad, "
        "a_mm, a_m, d_mm, d_m, offset_deg, offset_rad",
        "line 1, key joint: is missing. Write a column joint",
        "line 1, key alpha: is given by alpha_deg and alpha_rad. Keep one of the columns",
        "line 1, key offset: is missing. Write a column offset_deg or offset_rad",
    ]


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("modified,knee,0,nan,0,0", "line 2 'knee', key a_m: nan is not finite. Write a finite number in m"),
        ("modified,knee,0,0,1e999,0", "line 2 'knee', key d_m: 1e999 is not finite. "),
        ("modified,knee,pi/2,0,0,0", "line 2 'knee', key alpha_rad: 'pi/2' is not a number. "),
        ("modified,knee,0,,0,0", "line 2 'knee', key a_m: '' is not a number. "),
        (
            "modifed,knee,0,0,0,0",
            "line 2 'knee', key convention: is 'modifed'. Did you mean 'modified'? Write standard or",
        ),
        (",knee,0,0,0,0", "line 2 'knee', key convention: is empty. Write standard or modified"),
        ("modified,,0,0,0,0", "line 2, key joint: is empty. "),
        ("modified,knee,0,0,0", "line 2: 5 cells under 6 columns. "),
        ("modified,knee,0,0,0,0,0", "line 2: 7 cells under 6 columns. "),
        (
            "modified,a,0,0,0,0\nstandard,b,0,0,0,0",
            "line 3 'b', key convention: differs from line 2 'a' of the same chain. ",
        ),
        ("modified,a,0,0,0,0\nmodified,a,0,0,0,0", "line 3 'a', key joint: stands at line 2 'a' already. "),
    ],
)
def test_every_fault_of_a_row_is_told_with_its_line_and_column(row, told):
    (fault,) = faults(HEADER + row)
    assert fault.startswith(told)


@pytest.mark.parametrize(
    ("kinds", "told"),
    [
        (["fixed"], "line 2 'q0', key type: chain 'chain' has no joint. "),
        (["revolute", "fixed", "revolute"], "line 3 'q1', key type: is fixed, between joints. "),
        (["helical"], "line 2 'q0', key type: is 'helical'. DH parameters have no helical joints. "),
        (["revolut"], "line 2 'q0', key type: is 'revolut'. Did you mean 'revolute'? "),
    ],
)
def test_kinds_of_rows_are_checked(kinds, told):
    text = HEADER.replace("joint,", "joint,type,")
    text += "".join(f"modified,q{i},{kind},0,0,0,0\n" for i, kind in enumerate(kinds))
    (fault,) = faults(text)
    assert fault.startswith(told)


def test_files_that_are_no_tables_are_refused(tmp_path):
    assert faults("# only a comment\n") == [
        "file: is empty. Begin with a header: convention,joint,alpha_deg,a_mm,d_mm,offset_deg"
    ]
    assert faults(HEADER) == ["file: has a header but no rows. Write a row for each joint"]
    path = tmp_path / "arm.csv"
    path.write_bytes(HEADER.encode() + b"modified,\xff,0,0,0,0\n")
    with pytest.raises(TableError, match=r"arm.csv: line 2: byte 0xff is not UTF-8"):
        load_dh(path)
    with pytest.raises(TableError, match="cannot be read"):
        load_dh(tmp_path / "none.csv")
    with pytest.raises(TableError, match="is no CSV"):
        parse_dh(HEADER + 'modified,"' + "x" * 200_000 + '",0,0,0,0')
