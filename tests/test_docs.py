"""The Python blocks of README and docs run as they stand, one page after the other."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PAGES = ["README.md", "docs/theory.md"]


@pytest.mark.parametrize("page", PAGES)
def test_the_python_of_a_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(blocks), page, "exec"), {})  # noqa: S102


@pytest.mark.parametrize(
    "page", ["README.md", *(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md"))]
)
def test_links_between_pages_and_pictures_lead_somewhere(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
    own = [link for link in links if "://" not in link and "reference/" not in link]  # written with the site
    missing = [link for link in own if not ((ROOT / page).parent / link).exists()]
    assert not missing


def test_every_result_page_is_linked_from_a_page_that_speaks_of_it() -> None:
    pages = [path for path in (ROOT / "docs").rglob("*.md") if path.parent.name != "reference"]
    text = "".join(path.read_text(encoding="utf-8") for path in pages)
    results = {path.name for path in (ROOT / "benchmarks/results").glob("*.md")}
    assert results == set(re.findall(r"\]\([./]*benchmarks/results/([\w-]+\.md)\)", text))


@pytest.mark.parametrize("page", [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"], ids=lambda p: p.stem)
def test_pictures_have_alternative_texts_of_several_words(page: Path) -> None:
    """Of pages; ``docs/conf.py`` looks at those that cells draw while it builds the site."""
    text = page.read_text(encoding="utf-8")
    assert all(len(alt.split()) > 3 for alt in re.findall(r"!\[(.*?)\]\(", text, re.DOTALL))
    assert all(re.search(r'\balt="[^"]+"', tag) for tag in re.findall(r"<img\b[^>]*>", text))


@pytest.mark.parametrize(
    ("figure", "page", "there"),
    [
        ("99.6 ns", "docs/performance.md", "| 99.6 ns |"),
        ("143 ns", "docs/performance.md", "| 143 ns |"),
        ("2.57 µs", "docs/performance.md", "| 2.57 µs |"),
        ("578 ns", "docs/performance.md", "578 ns, all solutions"),
        ("56.8 µs", "docs/performance.md", "56.8 µs, damped least squares"),
        ("200 of 200 agree", "benchmarks/results/verdicts.md", "| table | 100 | 100 |"),
        ("83 of 105 files", "docs/robots.md", "83 of 105 files"),
        ("1 of 60", "benchmarks/results/walking.md", "| MuJoCo | AX-12 | x3 | feedback | 60 | 1 |"),
        ("197 of 200", "tests/servo/mutants.md", "Of the 200\nthat seed 0 draws 197 are"),
    ],
)
def test_figures_of_the_readme_stand_on_the_pages_that_it_names(figure: str, page: str, there: str) -> None:
    assert figure in (ROOT / "README.md").read_text(encoding="utf-8")
    assert there in (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.parametrize(("number", "python"), [(0, "python3"), (1, "python3.11"), (2, "python3")])
def test_the_first_commands_of_the_readme_each_stand_on_their_own(number: int, python: str) -> None:
    """In a fresh clone: they make the environment that they use. The second one is what ``.ci/run`` runs."""
    blocks = re.findall(r"```sh\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    make, install, *use = blocks[number].strip().split(" && ")
    assert make == f"{python} -m venv .venv"
    assert install.startswith(".venv/bin/pip install -")
    assert use
    for line in use:  # uv would install into an environment that happens to be active
        assert "uv pip" not in line or line.startswith(".venv/bin/uv pip install --python .venv ")
    assert all(one.startswith(".venv/bin/") for one in use)
