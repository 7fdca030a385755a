"""A neo-Hookean unit cube of N cells per side (6 N^3 linear tetrahedra), clamped at x = 0 and moved by 0.3 at x = 1 in
three load steps, by dolfinx with conjugate gradients and GAMG. Prints one JSON object.

    python3 box_dolfinx.py N [RELATIVE_TOLERANCE_OF_CG]
"""
import json
import resource
import sys
import time

import numpy as np
import ufl
from dolfinx import fem, la, mesh
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from petsc4py import PETSc

cells = int(sys.argv[1])
linear_tolerance = float(sys.argv[2]) if len(sys.argv) > 2 else 1e-8
start = time.perf_counter()

domain = mesh.create_unit_cube(MPI.COMM_WORLD, cells, cells, cells)
space = fem.VectorFunctionSpace(domain, ("CG", 1))
u, v, du = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
mu, lmbda = 1e6 / 2.6, 1e6 * 0.3 / (1.3 * 0.4)
F = ufl.Identity(3) + ufl.grad(u)
J = ufl.det(F)
energy = 0.5 * mu * (ufl.tr(F.T * F) - 3) - mu * ufl.ln(J) + 0.5 * lmbda * ufl.ln(J) ** 2
residual = ufl.derivative(energy * ufl.dx, u, v)
residual_form, jacobian_form = fem.form(residual), fem.form(ufl.derivative(residual, u, du))

pulled = fem.Constant(domain, PETSc.ScalarType((0.0, 0.0, 0.0)))
dofs = [
    fem.locate_dofs_geometrical(space, lambda x, end=end: np.isclose(x[0], end))
    for end in (0.0, 1.0)
]
conditions = [
    fem.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), dofs[0], space),
    fem.dirichletbc(pulled, dofs[1], space),
]

matrix = fem_petsc.create_matrix(jacobian_form)
vector = fem_petsc.create_vector(residual_form)
solution = vector.duplicate()

# The six rigid motions, orthonormal.
index_map = space.dofmap.index_map
basis = [la.create_petsc_vector(index_map, space.dofmap.index_map_bs) for _ in range(6)]
x = space.tabulate_dof_coordinates() - 0.5
arrays = [b.array.reshape(-1, 3) for b in basis]
for i in range(3):
    arrays[i][:, i] = 1.0
for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
    arrays[3 + k][:, i] = -x[: len(arrays[0]), j]
    arrays[3 + k][:, j] = x[: len(arrays[0]), i]
for k, b in enumerate(basis):
    for other in basis[:k]:
        b.axpy(-b.dot(other), other)
    b.normalize()
matrix.setNearNullSpace(PETSc.NullSpace().create(vectors=basis))

solver = PETSc.KSP().create(domain.comm)
solver.setType("cg")
solver.getPC().setType("gamg")
solver.setTolerances(rtol=linear_tolerance, max_it=1000)
solver.setOperators(matrix)

newton, linear, first = [], 0, None
for step in (1, 2, 3):
    pulled.value = (0.1 * step, 0.0, 0.0)
    scale, iterations = None, 0
    while True:
        with vector.localForm() as local:
            local.set(0.0)
        fem_petsc.assemble_vector(vector, residual_form)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        internal = vector.norm()
        fem_petsc.apply_lifting(vector, [jacobian_form], [conditions], x0=[u.vector], scale=-1.0)
        vector.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)
        fem_petsc.set_bc(vector, conditions, x0=u.vector, scale=-1.0)
        norm = vector.norm()
        # The norm of all nodal forces, prescribed nodes included, scales the residual.
        if iterations > 0 and norm <= 1e-8 * internal:
            break
        matrix.zeroEntries()
        fem_petsc.assemble_matrix(matrix, jacobian_form, conditions)
        matrix.assemble()
        solver.setOperators(matrix)
        solver.solve(vector, solution)
        if solver.getConvergedReason() <= 0:
            sys.exit(f"no convergence of CG: {solver.getConvergedReason()}")
        first = first or solver.getIterationNumber()
        linear += solver.getIterationNumber()
        u.vector.axpy(-1.0, solution)
        u.vector.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        iterations += 1
        if iterations > 25:
            sys.exit("no convergence of Newton's method")
    newton.append(iterations)

with vector.localForm() as local:
    local.set(0.0)
fem_petsc.assemble_vector(vector, residual_form)
force = vector.array.reshape(-1, 3)[dofs[1]].sum(axis=0)
usage = resource.getrusage(resource.RUSAGE_SELF)
print(
    json.dumps(
        {
            "unknowns": 3 * index_map.size_global,
            "newton": newton,
            "linear": linear,
            "first_linear": first,
            "force": force.tolist(),
            "seconds": time.perf_counter() - start,
            "processor_seconds": usage.ru_utime + usage.ru_stime,
            "megabytes": usage.ru_maxrss / 1e3,
        }
    )
)
