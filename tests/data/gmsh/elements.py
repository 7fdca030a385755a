"""Writes the meshes `*_<type>.msh` of this folder: a quarter of a ring, in every element type of the reader.

Run with the Python package `gmsh` (4.15.2 was used). The volume of each mesh, as Gmsh integrates it, is printed.
"""

import sys

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
for name, order, extruded, incomplete in [
    ("tet10", 2, False, 0),
    ("hex8", 1, True, 0),
    ("hex20", 2, True, 1),
    ("hex27", 2, True, 0),
    ("wedge6", 1, True, 0),
]:
    gmsh.clear()
    occ = gmsh.model.occ
    inner, outer = (occ.addDisk(0, 0, 0, radius, radius) for radius in (1, 2))
    ring, _ = occ.cut([(2, outer)], [(2, inner)])
    quarter, _ = occ.intersect(ring, [(2, occ.addRectangle(0, 0, 0, 3, 3))])
    is_hex = name.startswith("hex")
    out = occ.extrude(quarter, 0, 0, 0.5, [1] if extruded else [], recombine=extruded)
    occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [tag for dim, tag in quarter], name="base")
    gmsh.model.addPhysicalGroup(3, [tag for dim, tag in out if dim == 3], name="ring")
    if is_hex:
        for _, curve in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(curve, 3)
        gmsh.model.mesh.setTransfiniteSurface(quarter[0][1])
        gmsh.model.mesh.setRecombine(2, quarter[0][1])
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.7)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(order)
    volume = 0
    for kind in gmsh.model.mesh.getElementTypes(3):
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss5")
        _, determinants, _ = gmsh.model.mesh.getJacobians(kind, points)
        volume += sum(w * d for w, d in zip(list(weights) * (len(determinants) // len(weights)), determinants))
    kinds = {int(kind): len(gmsh.model.mesh.getElementsByType(kind)[0]) for kind in gmsh.model.mesh.getElementTypes(3)}
    print(name, kinds, len(gmsh.model.mesh.getNodes()[0]), float(volume))
    for version, binary in ((4.1, 0), (2.2, 1)):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(f"{sys.argv[1]}/ring_{name}_{version}_{'binary' if binary else 'text'}.msh")
gmsh.finalize()
