"""Writes the meshes `ring_<type>_<form>.vtu` of this folder from the Gmsh files of `../gmsh`.

Run with the Python package `meshio` (5.3.5 was used).
"""

from pathlib import Path

import meshio

here = Path(__file__).parent
for name in ("tet10", "hex8", "hex20", "hex27", "wedge6"):
    mesh = meshio.read(here / f"../gmsh/ring_{name}_4.1_text.msh")
    mesh = meshio.Mesh(mesh.points, mesh.cells, cell_data={"gmsh:physical": mesh.cell_data["gmsh:physical"]})
    if name != "tet10":
        meshio.vtu.write(here / f"ring_{name}_text.vtu", mesh, binary=False)
    meshio.vtu.write(here / f"ring_{name}_zlib.vtu", mesh, binary=True, compression="zlib")
    if name == "hex8":
        meshio.vtu.write(here / f"ring_{name}_base64.vtu", mesh, binary=True, compression=None)
