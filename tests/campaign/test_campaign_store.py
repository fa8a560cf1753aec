"""What has ended in a campaign stays ended, wherever its process died."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from screwkin.campaign.outcome import STATUSES, Outcome
from screwkin.campaign.plan import Campaign
from screwkin.campaign.store import PLAN, ROWS, journal
from screwkin.errors import InputError, OutputError

PLAN_OF_THREE = Campaign("robot", {"walk": "{}"}, {"Tc": ("1", "2", "3")}, (5,), {"screwkin": "1"})
NUMBERS = st.none() | st.floats(allow_nan=False, allow_infinity=False)
OUTCOMES = st.builds(
    Outcome,
    row=st.integers(0, 50),
    status=st.sampled_from(STATUSES),
    passed=st.booleans(),
    reason=st.text(max_size=20),
    margin_mm=NUMBERS,
    tilt_deg=NUMBERS,
)


@given(st.lists(OUTCOMES, min_size=1, max_size=4, unique_by=lambda o: o.row), st.data())
def test_a_line_torn_anywhere_costs_its_own_row_only(rows, data):
    with TemporaryDirectory() as name:
        folder = Path(name)
        with journal(folder, PLAN_OF_THREE.to_dict()) as written:
            for row in rows:
                written.append(row)
        whole = (folder / ROWS).read_bytes()
        cut = data.draw(st.integers(0, len(whole)))
        (folder / ROWS).write_bytes(whole[:cut])
        complete = whole[:cut].count(b"\n")
        with journal(folder, PLAN_OF_THREE.to_dict()) as resumed:
            assert resumed.outcomes == {row.row: row for row in rows[:complete]}
            for row in rows:
                resumed.append(row)
        assert (folder / ROWS).read_bytes() == whole


def test_a_row_that_ends_twice_counts_as_it_ended_first(tmp_path):
    first, again = Outcome(1, "fell"), Outcome(1, "stood")
    with journal(tmp_path, PLAN_OF_THREE.to_dict()) as rows:
        rows.append(first)
        rows.append(again)
    with (tmp_path / ROWS).open("a") as file:
        file.write(json.dumps(again.to_dict()) + "\n")
    with journal(tmp_path, PLAN_OF_THREE.to_dict()) as rows:
        assert rows.outcomes == {1: first}


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"robot": "other"}, "robot"),
        ({"gaits": {"walk": "{ }"}}, "gaits"),
        ({"axes": {"Tc": ("1", "2")}}, "axes"),
        ({"seeds": (6,)}, "seeds"),
        ({"versions": {"screwkin": "2"}}, "versions"),
    ],
)
def test_rows_of_two_plans_are_never_mixed(tmp_path, changed, named):
    with journal(tmp_path, PLAN_OF_THREE.to_dict()) as rows:
        rows.append(Outcome(0, "stood"))
    other = Campaign(**{**vars(PLAN_OF_THREE), **changed})
    refused = pytest.raises(InputError, match=f"another campaign: {named} differ")
    with refused, journal(tmp_path, other.to_dict()):
        pass


def test_two_processes_do_not_write_to_one_campaign(tmp_path):
    with journal(tmp_path, PLAN_OF_THREE.to_dict()), pytest.raises(OutputError, match="another process"):
        journal(tmp_path, PLAN_OF_THREE.to_dict()).__enter__()


@pytest.mark.parametrize(
    "line", ["{}", "no JSON", '{"row": 1, "status": "flew"}', '{"row": "1", "status": "fell"}']
)
def test_a_damaged_line_is_named_not_passed_over(tmp_path, line):
    with journal(tmp_path, PLAN_OF_THREE.to_dict()) as rows:
        rows.append(Outcome(0, "stood"))
    with (tmp_path / ROWS).open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InputError, match="line 2 is no row"), journal(tmp_path, PLAN_OF_THREE.to_dict()):
        pass


@pytest.mark.parametrize("text", ["[]", "{}", "torn {"])
def test_a_damaged_plan_is_refused(tmp_path, text):
    (tmp_path / PLAN).write_text(text)
    with pytest.raises(InputError), journal(tmp_path, PLAN_OF_THREE.to_dict()):
        pass
