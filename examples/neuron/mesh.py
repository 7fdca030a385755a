"""Writes neuron.msh: a block of gel, 100 x 60 x 60 micrometers, with two ellipsoids. The long one runs along x, the short
one crosses it at a distance along y. Lengths are in micrometers. Needs the Python package `gmsh`."""

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
model, occ = gmsh.model, gmsh.model.occ


def ellipsoid(center, radii):
    sphere = occ.addSphere(*center, 1.0)
    occ.dilate([(3, sphere)], *center, *radii)
    return sphere


gel = occ.addBox(-50, -30, -30, 100, 60, 60)
axial = ellipsoid((0, 0, -9), (36, 6, 6))
transverse = ellipsoid((6, 0, 9), (6, 22, 6))
occ.fragment([(3, gel)], [(3, axial), (3, transverse)])
occ.synchronize()

for name, volume in [("axial", axial), ("transverse", transverse)]:
    model.addPhysicalGroup(3, [volume], name=name)
rest = [tag for dim, tag in model.getEntities(3) if tag not in (axial, transverse)]
model.addPhysicalGroup(3, rest, name="gel")


def face(axis, value):
    low = [-50.0, -30.0, -30.0]
    high = [50.0, 30.0, 30.0]
    low[axis] = high[axis] = value
    box = [x - 1e-3 for x in low] + [x + 1e-3 for x in high]
    return [tag for _, tag in model.getEntitiesInBoundingBox(*box, 2)]


for axis, (name, half) in enumerate([("x", 50.0), ("y", 30.0), ("z", 30.0)]):
    model.addPhysicalGroup(2, face(axis, -half), name=f"{name}0")
    model.addPhysicalGroup(2, face(axis, half), name=f"{name}1")

gmsh.option.setNumber("Mesh.MeshSizeMin", 5)
gmsh.option.setNumber("Mesh.MeshSizeMax", 14)
gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.option.setNumber("Mesh.RandomSeed", 1)
model.mesh.generate(3)
gmsh.write("neuron.msh")
print(len(model.mesh.getElements(3)[1][0]), "tetrahedra")
gmsh.finalize()
