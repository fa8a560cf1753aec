"""The root names: every function explains its arguments, and has an example that runs and a type."""

from __future__ import annotations

import doctest
import inspect
import io
import pydoc

import pytest

import screwkin as sk

FUNCTIONS = [name for name in sk.__all__ if not inspect.isclass(getattr(sk, name))]


def test_the_root_has_functions_and_classes() -> None:
    assert len(FUNCTIONS) > 20
    assert len(sk.__all__) - len(FUNCTIONS) >= 8


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_example_of_a_root_function_runs(name: str, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = getattr(sk, name).__doc__ or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert example.examples, f"{name} has no example"
    output = io.StringIO()
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(example, out=output.write)
    assert not output.getvalue(), output.getvalue()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_root_function_explains_every_argument(name: str) -> None:
    function = getattr(sk, name)
    text, parameters = function.__doc__ or "", inspect.signature(function).parameters
    section = text.partition("Args:")[2].partition("\n\n")[0]
    missing = [p for p in parameters if f"{p}:" not in section.replace(f"*{p}", p)]
    assert not missing, f"{name} does not explain {missing}"
    assert "Returns:" in text or inspect.signature(function).return_annotation in ("None", None), name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_root_function_returns_a_type(name: str) -> None:
    assert inspect.signature(getattr(sk, name)).return_annotation not in (inspect.Signature.empty, "Any"), (
        name
    )


def test_help_reads_as_a_function_s_with_shapes() -> None:
    text = pydoc.render_doc(sk.frame_pose, renderer=pydoc.plaintext)
    assert "frame_pose(robot: 'Robot', state: 'State', frame: 'str') -> 'Array'" in text
    assert "state: T_world_base (..., 4, 4), the base's pose [m]; q (..., n) joint positions" in text
    text = pydoc.render_doc(sk.inverse_dynamics, renderer=pydoc.plaintext)
    assert "qd: (..., n) joint rates [rad/s or m/s]" in text
