"""The cache folder."""

from __future__ import annotations

from screwkin.cache import cache_folder, digest


def test_the_environment_chooses_the_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("SCREWKIN_CACHE", str(tmp_path / "elsewhere"))
    assert cache_folder() == tmp_path / "elsewhere"


def test_a_name_depends_on_every_text_and_on_where_it_ends():
    assert digest("a", "b") == digest("a", "b")
    assert len({digest("ab"), digest("a", "b"), digest("a", "b", ""), digest("b", "a")}) == 4
