"""``robots`` and ``gaits``: what is bundled, and what each one is."""

from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(("verb", "folder"), [("robots", "robots"), ("gaits", "trajectories")])
def test_every_file_of_the_checkout_is_listed_and_described(cli, verb, folder):
    root = CHECKOUT / folder
    files = {path.relative_to(root).with_suffix("").as_posix() for path in root.rglob("*.toml")}
    told = cli(verb, "--json").data
    assert set(told["names"]) == files
    assert all(told["descriptions"][name] for name in files)
    text = cli(verb).out
    assert all(f"{name} " in text for name in files)


def test_a_file_that_is_no_toml_is_listed_all_the_same(cli, monkeypatch, tmp_path):
    import screwkin.model.library as library

    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "odd.toml").write_text("not [ toml", encoding="utf-8")
    monkeypatch.setattr(library, "data_folder", lambda kind: tmp_path / kind)
    assert cli("robots", "--json").data == {"names": ["odd"], "descriptions": {"odd": "(cannot be read)"}}
