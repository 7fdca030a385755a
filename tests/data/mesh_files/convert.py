"""Writes the meshes of this folder from the Gmsh files of `../gmsh`: `.inp` and `.mesh` by Gmsh, `.feb` here.

Run with the Python package `gmsh` (4.15.2 was used).
"""

from pathlib import Path

import gmsh

here = Path(__file__).parent
# Types of Gmsh with those of FEBio, whose edges 14, 24, 34 Gmsh numbers 14, 34, 24.
SOLIDS = {4: ("tet4", range(4)), 11: ("tet10", [*range(8), 9, 8]), 5: ("hex8", range(8)), 6: ("penta6", range(6))}
FACES = {2: ("tri3", 3), 9: ("tri6", 6), 3: ("quad4", 4)}


def rows(numbers, length):
    """Returns the numbers in rows."""
    return [numbers[start : start + length] for start in range(0, len(numbers), length)]


def write_feb(path):
    """Writes the open mesh as FEBio Studio does for febio_spec 4.0."""
    mesh = gmsh.model.mesh
    text = ['<?xml version="1.0" encoding="ISO-8859-1"?>', '<febio_spec version="4.0">', "<Mesh>", '<Nodes name="all">']
    tags, positions, _ = mesh.getNodes()
    for tag, position in zip(tags, rows(positions, 3)):
        text.append(f'<node id="{tag}">{",".join(repr(float(x)) for x in position)}</node>')
    text.append("</Nodes>")

    def elements(dimension, of):
        for _, group in gmsh.model.getPhysicalGroups(dimension):
            name = gmsh.model.getPhysicalName(dimension, group) or str(group)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                for kind, ids, nodes in zip(*mesh.getElements(dimension, entity)):
                    yield (name, of[kind], ids, rows(nodes, len(nodes) // len(ids)))

    for name, (kind, order), ids, nodes in elements(3, SOLIDS):
        text.append(f'<Elements type="{kind}" name="{name}">')
        text += [f'<elem id="{tag}">{",".join(str(row[k]) for k in order)}</elem>' for tag, row in zip(ids, nodes)]
        text.append("</Elements>")
    for name, (kind, _), ids, nodes in elements(2, FACES):
        text.append(f'<Surface name="{name}">')
        text += [f'<{kind} id="{k}">{",".join(map(str, row))}</{kind}>' for k, row in enumerate(nodes, 1)]
        text.append("</Surface>")
    text += ["</Mesh>", "</febio_spec>", ""]
    path.write_text("\n".join(text))


gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
for name in ("ring_tet10", "ring_hex8", "ring_wedge6", "two_cubes"):
    gmsh.open(str(here / f"../gmsh/{name}_4.1_text.msh"))
    abaqus = here / f"{name}.inp"
    gmsh.write(str(abaqus))
    # Gmsh writes the whole path into the heading.
    abaqus.write_text(abaqus.read_text().replace(str(abaqus), abaqus.name))
    gmsh.write(str(here / f"{name}.mesh"))
    write_feb(here / f"{name}.feb")
    gmsh.clear()
# Gmsh writes no prisms there.
(here / "ring_wedge6.mesh").unlink()
