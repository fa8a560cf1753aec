"""How tests compile JAX's functions, which most of them call a few times only."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version


def quick_xla_flags() -> str:
    """XLA's flags without optimisation, which takes half of a compilation; empty where JAX is not installed.

    Values are those of the same operations in the same order, without fused multiplications. ``XLA_FLAGS=``
    before the command of the tests takes the flags of everyday use. An unknown flag ends the process, so that
    the one that may go is tied to a version.
    """
    try:
        own = ["--xla_cpu_use_fusion_emitters=false"] if version("jaxlib").startswith("0.10.") else []
    except PackageNotFoundError:
        return ""
    return " ".join(["--xla_backend_optimization_level=0", "--xla_llvm_disable_expensive_passes=true", *own])
