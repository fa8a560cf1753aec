"""Public functions over arrays: they check, compute with the formulas, and convert.

Everything takes leading batch dimensions. NumPy in gives NumPy out (float64), JAX in gives JAX out, so the
same functions go through ``jax.jit``, ``jax.vmap`` and ``jax.grad``.
"""
