"""Writes pressed_boxes.csv: boxes of neo-Hookean material under follower pressure, solved with scikit-fem.

    pip install scikit-fem==12.0.2
    python3 pressed_boxes.py

The weak forms, the consistent linearization and Newton's method are written here; scikit-fem provides meshes, shape
functions and assembly. The quadrature rules are those of the elements of biotissue, because the stored digits are those
of the discrete problem. Each case is a box whose nodes are moved by `moved`, clamped at x = 0; x = 1 is moved by
`MOVED`, and a pressure presses on z = 1. Columns: the element type, the forces of the supports at x = 0 and x = 1, and
the displacement of the node at (0.5, 1, 1) of the regular grid. The run takes a few minutes.
"""

from pathlib import Path

import numpy as np
from skfem import (Basis, BilinearForm, ElementHex1, ElementHex2, ElementHexS2, ElementTetP1, ElementTetP2,
                   ElementVector, FacetBasis, LinearForm, MeshHex, MeshTet, condense, solve)

MU, LAMBDA, PRESSURE = 3.0, 5.0, 0.8
MOVED = np.array([0.15, 0.05, -0.1])
CELLS = [2, 2, 2]


def moved(x):
    """Moves the nodes of the regular grid; the ends x = 0 and x = 1 stay plane."""
    x, y, z = x
    bubble = 16.0 * x * (1.0 - x) * y * (1.0 - y)
    return np.array([x + 0.05 * bubble * z * (1.0 - z), 0.9 * y - 0.04 * bubble * (1.0 - z), 0.8 * z + 0.06 * bubble])


def hexahedra():
    axes = [np.linspace(0.0, 1.0, n + 1) for n in CELLS]
    return MeshHex.init_tensor(*axes)


def tetrahedra():
    """Six tetrahedra per cell, one for each path along the edges from the lowest corner of the cell to the highest."""
    n = np.array(CELLS)
    index = lambda i, j, k: i + (n[0] + 1) * (j + (n[1] + 1) * k)
    grid = [np.array([i, j, k]) / n for k in range(n[2] + 1) for j in range(n[1] + 1) for i in range(n[0] + 1)]
    paths = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]
    cells = [(i, j, k) for k in range(n[2]) for j in range(n[1]) for i in range(n[0])]
    corner = lambda i, j, k, c: index(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2))
    elements = [[corner(*cell, c) for c in path] for cell in cells for path in paths]
    return MeshTet(np.array(grid).T, np.array(elements).T)


def gauss(n, dim):
    """Gauss's rule of n points in each direction of the unit cube."""
    x, w = np.polynomial.legendre.leggauss(n)
    points = np.stack(np.meshgrid(*[0.5 * (x + 1.0)] * dim, indexing="ij")).reshape(dim, -1)
    weights = np.stack(np.meshgrid(*[0.5 * w] * dim, indexing="ij")).reshape(dim, -1).prod(axis=0)
    return points, weights


def tetrahedron(points):
    if points == 1:
        return np.full((3, 1), 0.25), np.array([1.0 / 6.0])
    s5 = np.sqrt(5.0)
    far, near = (5.0 - s5) / 20.0, (5.0 + 3.0 * s5) / 20.0
    x = np.full((3, 4), far)
    for a in range(3):
        x[a, a + 1] = near
    return x, np.full(4, 1.0 / 24.0)


def triangle(points):
    """Dunavant's rules of degree 2 and 4."""
    if points == 3:
        orbits = [(1.0 / 6.0, 1.0 / 6.0)]
    else:
        s, t = np.sqrt(10.0), np.sqrt(38.0 - 44.0 * np.sqrt(0.4))
        root = np.sqrt(213125.0 - 53320.0 * s)
        orbits = [((8.0 - s + sign * t) / 18.0, (620.0 + sign * root) / 7440.0) for sign in (1.0, -1.0)]
    x, w = [], []
    for b, weight in orbits:
        x += [[b, b], [1.0 - 2.0 * b, b], [b, 1.0 - 2.0 * b]]
        w += [weight] * 3
    return np.array(x).T, np.array(w)


def inverse(f):
    return np.moveaxis(np.linalg.inv(np.moveaxis(f, (0, 1), (-2, -1))), (-2, -1), (0, 1))


def determinant(f):
    return np.linalg.det(np.moveaxis(f, (0, 1), (-2, -1)))


def deformation(w):
    return w["u"].grad + np.eye(3)[:, :, None, None]


@LinearForm
def internal(v, w):
    f = deformation(w)
    g = inverse(f)
    p = MU * f + (LAMBDA * np.log(determinant(f)) - MU) * np.swapaxes(g, 0, 1)
    return np.einsum("ijep,ijep->ep", p, v.grad)


@BilinearForm
def stiffness(u, v, w):
    f = deformation(w)
    g = inverse(f)
    gu, gv = np.einsum("jiep,ikep->jkep", g, u.grad), np.einsum("jiep,ikep->jkep", g, v.grad)
    volumetric = np.einsum("jjep->ep", gu) * np.einsum("jjep->ep", gv)
    geometric = np.einsum("jkep,kjep->ep", gu, gv)
    return (MU * np.einsum("ijep,ijep->ep", u.grad, v.grad) + LAMBDA * volumetric
            - (LAMBDA * np.log(determinant(f)) - MU) * geometric)


@LinearForm
def pressed(v, w):
    """The force -p J F^-T N of a pressure of 1."""
    f = deformation(w)
    area = determinant(f) * np.einsum("jiep,jep->iep", inverse(f), w.n)
    return -np.einsum("iep,iep->ep", area, v)


@BilinearForm
def load_stiffness(u, v, w):
    """The derivative of minus that force: d(J F^-T N) = J (tr(G H) G^T - G^T H^T G^T) N with G = F^-1."""
    f = deformation(w)
    g, j = inverse(f), determinant(f)
    normal = np.einsum("jiep,jep->iep", g, w.n)
    trace = np.einsum("ijep,jiep->ep", g, u.grad)
    turned = np.einsum("jiep,kjep,kep->iep", g, u.grad, normal)
    return np.einsum("iep,iep->ep", j * (trace * normal - turned), v)


def run(mesh, element, volume, face):
    corner_grid = mesh.p.copy()
    at = int(np.argmin(np.abs(corner_grid - np.array([[0.5], [1.0], [1.0]])).sum(axis=0)))
    top = [f for f in mesh.boundary_facets() if np.all(corner_grid[2, mesh.facets[:, f]] == 1.0)]
    mesh = type(mesh)(moved(mesh.p), mesh.t)
    basis = Basis(mesh, ElementVector(element), quadrature=volume)
    faces = FacetBasis(mesh, ElementVector(element), facets=np.array(top), quadrature=face)
    x = basis.doflocs
    ends = [basis.get_dofs(lambda p, end=end: np.abs(p[0] - end) < 1e-12).flatten() for end in (0.0, 1.0)]
    component = np.zeros(basis.N, dtype=int)
    for dofs in (basis.nodal_dofs, basis.edge_dofs, basis.facet_dofs, basis.interior_dofs):
        for row in range(dofs.shape[0] if dofs.size else 0):
            component[dofs[row]] = row % 3
    u = np.zeros(basis.N)
    for t in (0.25, 0.5, 0.75, 1.0):
        before = u.copy()
        u[ends[1]] = t * MOVED[component[ends[1]]]
        du, fixed = u - before, np.concatenate(ends)
        u = before
        for iteration in range(30):
            w, wf = basis.interpolate(u), faces.interpolate(u)
            r = internal.assemble(basis, u=w) - t * PRESSURE * pressed.assemble(faces, u=wf)
            k = stiffness.assemble(basis, u=w) + t * PRESSURE * load_stiffness.assemble(faces, u=wf)
            step = np.zeros(basis.N)
            if iteration == 0:
                step[fixed] = du[fixed]
            step = solve(*condense(k, -r, x=step, D=fixed))
            u = u + step
            if np.abs(step).max() < 1e-14:
                break
        else:
            raise RuntimeError("no convergence")
    forces = internal.assemble(basis, u=basis.interpolate(u))
    forces -= PRESSURE * pressed.assemble(faces, u=faces.interpolate(u))
    reactions = [[forces[end[component[end] == i]].sum() for i in range(3)] for end in ends]
    return np.concatenate([*reactions, u[basis.nodal_dofs[:, at]]])


def main():
    three, two = gauss(3, 3), gauss(2, 3)
    cases = {
        "tet4": (tetrahedra(), ElementTetP1(), tetrahedron(1), triangle(3)),
        "tet10": (tetrahedra(), ElementTetP2(), tetrahedron(4), triangle(6)),
        "hex8": (hexahedra(), ElementHex1(), two, gauss(2, 2)),
        "hex20": (hexahedra(), ElementHexS2(), three, gauss(3, 2)),
        "hex27": (hexahedra(), ElementHex2(), three, gauss(3, 2)),
    }
    lines = ["case,x0_x,x0_y,x0_z,x1_x,x1_y,x1_z,corner_x,corner_y,corner_z"]
    for name, case in cases.items():
        lines.append(",".join([name] + [f"{value:.15e}" for value in run(*case)]))
    Path(__file__).with_name("pressed_boxes.csv").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
