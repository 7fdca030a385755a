"""Writes neuron.msh: a block of gel, 100 x 60 x 60 micrometers, with two capsules (cylinders with half spheres at their
ends). The long one runs along x; the short one runs along y and crosses it at a distance. Lengths are in micrometers.
Needs the Python package `gmsh`."""

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
model, occ = gmsh.model, gmsh.model.occ


def capsule(axis, center, half_length, radius):
    """A cylinder with half spheres at its ends."""
    low, high = list(center), list(center)
    low[axis] -= half_length
    high[axis] += half_length
    along = [high[k] - low[k] for k in range(3)]
    cylinder = occ.addCylinder(*low, *along, radius)
    ends = [(3, occ.addSphere(*end, radius)) for end in (low, high)]
    [(_, fused)], _ = occ.fuse([(3, cylinder)], ends)
    return fused


gel = occ.addBox(-50, -30, -30, 100, 60, 60)
axial = capsule(0, (0, 0, -9), 32, 6)
transverse = capsule(1, (6, 0, 9), 14, 6)
_, parts = occ.fragment([(3, gel)], [(3, axial), (3, transverse)])
occ.synchronize()

inside = {name: [tag for _, tag in of] for name, of in zip(("axial", "transverse"), parts[1:])}
inside["gel"] = [tag for _, tag in parts[0] if tag not in inside["axial"] + inside["transverse"]]
for name, volumes in inside.items():
    model.addPhysicalGroup(3, volumes, name=name)


def face(axis, value):
    low = [-50.0, -30.0, -30.0]
    high = [50.0, 30.0, 30.0]
    low[axis] = high[axis] = value
    box = [x - 1e-3 for x in low] + [x + 1e-3 for x in high]
    return [tag for _, tag in model.getEntitiesInBoundingBox(*box, 2)]


for axis, (name, half) in enumerate([("x", 50.0), ("y", 30.0), ("z", 30.0)]):
    model.addPhysicalGroup(2, face(axis, -half), name=f"{name}0")
    model.addPhysicalGroup(2, face(axis, half), name=f"{name}1")

gmsh.option.setNumber("Mesh.MeshSizeMin", 4)
gmsh.option.setNumber("Mesh.MeshSizeMax", 12)
gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 12)
gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
gmsh.option.setNumber("Mesh.Binary", 1)
gmsh.option.setNumber("Mesh.RandomSeed", 1)
model.mesh.generate(3)
gmsh.write("neuron.msh")
print(sum(len(tags) for tags in model.mesh.getElements(3)[1]), "tetrahedra")
gmsh.finalize()
