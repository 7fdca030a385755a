"""Prints the table of `ilut.rs` for SciPy's incomplete factorization (SuperLU's ILUTP): first with the default column
reordering and pivoting, then without either. FOLDER contains the matrices that `ilut.rs` wrote.

    python3 studies/ilut.py FOLDER
"""

import sys

import numpy as np
import scipy.io
import scipy.sparse.linalg as linalg

# Drop tolerances and fill factors.
KEPT = [(1e-1, 2), (1e-2, 5), (1e-3, 10), (1e-4, 20)]
ORDERS = [("COLAMD", {}), ("natural", {"permc_spec": "NATURAL", "diag_pivot_thresh": 0.0})]

print("| matrix | order | spilu(drop_tol, fill_factor) | entries of the factors | BiCGSTAB | GMRES(50) | CG |")
print("|---|---|---|---|---|---|---|")
for name, definite in [("network", True), ("convection", False)]:
    a = scipy.io.mmread(f"{sys.argv[1]}/{name}.mtx").tocsc()
    b = np.ones(a.shape[0])
    for order, options in ORDERS:
        for drop, fill in KEPT:
            lu = linalg.spilu(a, drop_tol=drop, fill_factor=fill, **options)
            m = linalg.LinearOperator(a.shape, lu.solve)
            counts = []
            methods = [
                (linalg.bicgstab, {}),
                (linalg.gmres, {"restart": 50, "callback_type": "pr_norm"}),
            ] + ([(linalg.cg, {})] if definite else [])
            for method, more in methods:
                steps = []
                x, info = method(a, b, M=m, rtol=1e-10, maxiter=1000, callback=lambda _: steps.append(0), **more)
                counts.append(str(len(steps)) if info == 0 else "none in 1000")
            counts += [""] * (3 - len(counts))
            # Neither table counts the unit diagonal of `L`.
            entries = lu.L.nnz + lu.U.nnz - a.shape[0]
            print(f"| {name} | {order} | {drop:g}, {fill} | {entries} | {' | '.join(counts)} |")
