"""Two established ways from formulas to fast code, CasADi and sympy, measured on workload W1."""
