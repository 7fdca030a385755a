//! Error messages for invalid nodes, elements and groups.

use super::broken::{DAMAGED, LINE_END, NODE, four, said, two};
use super::{TEXT_2, TEXT_4, with};

// Expected contents and hints.
const NOT_FINITE: &str = "look for what went wrong where the mesh was made";
const ONCE: &str = "each node once";
const RENUMBER: &str = "renumber the mesh in Gmsh (Mesh, Renumber) or export it again";
const NODE_BLOCK: &str = "a block of nodes: dimension and tag of its entity, parametric or not (0, 1), how many nodes";
const ADD_UP: &str = "blocks that add up to the number announced";
const KNOWN_NODES: &str = "nodes of this file";
const TYPES: &str = "4-node tetrahedra and 3-node triangles (points and lines are ignored)";
const LINEAR: &str = "export the mesh with element order 1 (in Gmsh: Mesh.ElementOrder = 1)";
const BODY: &str = "a body of tetrahedra";
const MESH_VOLUME: &str = "mesh the volume (in Gmsh: Mesh, 3D), put it in a physical group (Gmsh saves nothing else if there are any groups), and export again";
const ONE_GROUP_OR_NONE: &str = "every tetrahedron in one physical volume group (or no such group at all)";
const ADD_TO_GROUP: &str = "add the volumes left out to a physical group (and export with Mesh.SaveAll = 0: version 2.2 loses the groups otherwise), or remove all physical volume groups and their names";
const ONE_GROUP: &str = "every tetrahedron in one physical volume group";
const TAKE_OUT: &str = "take its volume out of one of the groups";
const COHERENCE: &str = "remove duplicate elements (in Gmsh: Coherence Mesh) and export again";

#[test]
fn nodes_that_are_wrong() {
    said(vec![
        (two("$Nodes\n4\n", "$Nodes\n5\n"), "a.msh:15: $Nodes ends after 4 of 5 nodes", NODE, DAMAGED),
        (two("$Nodes\n4\n", "$Nodes\n3\n"), "a.msh:14: `4` follows the 3 nodes announced", "`$EndNodes`", DAMAGED),
        (
            two("$Nodes\n4\n", "$Nodes\n1000000000000000000\n"),
            "a.msh:15: $Nodes ends after 4 of 1000000000000000000 nodes",
            NODE,
            DAMAGED,
        ),
        (
            two("$Nodes\n4\n", "$Nodes\n-4\n"),
            "a.msh:10: `-4` is not a whole number from 0 up",
            "the number of nodes",
            DAMAGED,
        ),
        (two("2 1 0 0\n", "2 1 O 0\n"), "a.msh:12: `O` is not a number", NODE, DAMAGED),
        (two("2 1 0 0\n", "2 1 NaN 0\n"), "a.msh:12: NaN is not finite", NODE, NOT_FINITE),
        (two("2 1 0 0\n", "2 1 -1e999 0\n"), "a.msh:12: -inf is not finite", NODE, NOT_FINITE),
        (two("2 1 0 0\n", "2 1 0\n"), "a.msh:12: the line ends too early", NODE, DAMAGED),
        (two("2 1 0 0\n", "2 1 0 0 0\n"), "a.msh:12: `0` was found where the line should end", LINE_END, DAMAGED),
        (two("2 1 0 0\n", "-2 1 0 0\n"), "a.msh:12: -2 is negative", NODE, DAMAGED),
        (two("2 1 0 0\n", "1 1 0 0\n"), "a.msh:12: node 1 is defined a second time", ONCE, RENUMBER),
        (four("10\n20\n", "10\n10\n"), "a.msh:18: node 10 is defined a second time", ONCE, RENUMBER),
        (
            four("2 4 10 90000", "2 5 10 90000"),
            "a.msh:25: the blocks hold 4 nodes, but 5 are announced",
            ADD_UP,
            DAMAGED,
        ),
        (four("2 4 10 90000", "3 4 10 90000"), "a.msh:26: $Nodes ends after 4 of 4 nodes", NODE_BLOCK, DAMAGED),
        (
            four("3 6 0 1\n", "3 6 2 1\n"),
            "a.msh:23: a block of dimension 3 whose parametric flag is 2",
            NODE_BLOCK,
            DAMAGED,
        ),
        (
            four("3 6 0 1\n", "3 6 0 2\n"),
            "a.msh:25: the line ends too early",
            "x, y and z of a node, and its parameters on the entity in a parametric block",
            DAMAGED,
        ),
    ]);
}

#[test]
fn elements_that_are_wrong() {
    said(vec![
        (
            two("1 2 3 4\n", "1 2 3 9\n"),
            "a.msh:19: tetrahedron 2 names node 9, which is not in $Nodes",
            KNOWN_NODES,
            DAMAGED,
        ),
        (
            four("10 20 30 90000\n", "10 20 30 90001\n"),
            "a.msh:32: tetrahedron 2 names node 90001, which is not in $Nodes",
            KNOWN_NODES,
            DAMAGED,
        ),
        (
            two("1 2 3 4\n", "1 2 3 3\n"),
            "a.msh:19: tetrahedron 2 has node 3 twice",
            "different nodes",
            "remove the collapsed element or mesh again",
        ),
        (
            two("4 0 0 1\n", "4 0.3 0.3 0\n"),
            "a.msh:19: tetrahedron 2 is flat: its volume is 0e0, its longest edge 1.4142135623730951e0",
            "tetrahedra with a volume",
            "improve the mesh (in Gmsh: Optimize 3D) or mesh again",
        ),
        (two("1 2 3 4\n", "1 2 3\n"), "a.msh:19: the line ends too early", "the four nodes of a tetrahedron", DAMAGED),
        (two("1 2 3 4\n", "1 2 3 4 1\n"), "a.msh:19: `1` was found where the line should end", LINE_END, DAMAGED),
        (
            two("2 4 2 1 1 1 2 3 4\n", "2 11 2 1 1 1 2 3 4 5 6 7 8 9 10\n"),
            "a.msh:19: the mesh has 10-node tetrahedra (order 2, element type 11)",
            TYPES,
            LINEAR,
        ),
        (
            two("2 4 2 1 1 1 2 3 4\n", "2 5 2 1 1 1 2 3 4 5 6 7 8\n"),
            "a.msh:19: the mesh has 8-node hexahedra (order 1, element type 5)",
            TYPES,
            "mesh the body with tetrahedra only (in Gmsh: no recombination, no transfinite or extruded hexahedra)",
        ),
        (
            two("2 4 2 1 1 1 2 3 4\n", "2 99 2 1 1 1 2 3 4\n"),
            "a.msh:19: the mesh has elements of type 99",
            TYPES,
            "the file is damaged or of a newer kind: export it again from Gmsh",
        ),
        (
            four("3 6 4 1\n", "3 6 11 1\n"),
            "a.msh:31: the mesh has 10-node tetrahedra (order 2, element type 11)",
            TYPES,
            LINEAR,
        ),
        (
            four("3 6 4 1\n", "2 6 4 1\n"),
            "a.msh:31: a block of tetrahedra lies on an entity of dimension 2",
            "dimension 3",
            DAMAGED,
        ),
        (four("2 2 1 2\n", "2 3 1 2\n"), "a.msh:32: the blocks hold 2 elements, but 3 are announced", ADD_UP, DAMAGED),
        (
            two("$Elements\n2\n", "$Elements\n3\n"),
            "a.msh:20: $Elements ends after 2 of 3 elements",
            "an element: its number, its type, how many tags it has, the tags, its nodes",
            DAMAGED,
        ),
    ]);
}

#[test]
fn bodies_and_groups_that_are_wrong() {
    said(vec![
        (
            two("\n2 4 2 1 1 1 2 3 4\n", "\n2 2 2 1 1 1 2 4\n"),
            "a.msh: the mesh has no tetrahedra, only 2 triangles",
            BODY,
            MESH_VOLUME,
        ),
        (
            with(
                &with(TEXT_4, "2 2 1 2\n", "0 0 0 0\n$EndElements\n$Rest\n"),
                "30 90000\n$EndElements\n",
                "30 90000\n$EndRest\n",
            )
            .into(),
            "a.msh: the mesh has no tetrahedra",
            BODY,
            MESH_VOLUME,
        ),
        (
            two("2 4 2 1 1 1", "2 4 2 0 1 1"),
            "a.msh: 1 of 1 tetrahedra are in no physical volume group",
            ONE_GROUP_OR_NONE,
            ADD_TO_GROUP,
        ),
        (
            four("6 0 0 0 1 1 1 1 1 1 5", "6 0 0 0 1 1 1 0 1 5"),
            "a.msh: 1 of 1 tetrahedra are in no physical volume group",
            ONE_GROUP_OR_NONE,
            ADD_TO_GROUP,
        ),
        (
            four("6 0 0 0 1 1 1 1 1 1 5", "6 0 0 0 1 1 1 2 1 4 1 5"),
            "a.msh:32: tetrahedron 2 is in two physical volume groups, `tissue` and `4`",
            ONE_GROUP,
            TAKE_OUT,
        ),
        (
            two("$Elements\n2\n", "$Elements\n3\n3 4 2 4 1 2 1 3 4\n"),
            "a.msh:20: tetrahedron 2 is in two physical volume groups, `4` and `tissue`",
            ONE_GROUP,
            TAKE_OUT,
        ),
        (
            two("$Elements\n2\n", "$Elements\n3\n3 4 2 1 1 2 1 3 4\n"),
            "a.msh:20: tetrahedra 3 and 2 are the same",
            "each tetrahedron once",
            COHERENCE,
        ),
        (
            two("$Elements\n2\n", "$Elements\n3\n3 2 2 1 1 2 1 3\n"),
            "a.msh:19: triangles 3 and 1 of surface `base` are the same",
            "each triangle of a surface once",
            COHERENCE,
        ),
        (
            with(
                &with(TEXT_2, "$Nodes\n4\n", "$Nodes\n5\n5 1 1 1\n"),
                "$Elements\n2\n",
                "$Elements\n3\n3 4 2 1 1 1 2 3 5\n",
            )
            .into(),
            "a.msh:21: tetrahedra 3 and 2 overlap: they lie on the same side of a face they share",
            "a body that does not overlap itself",
            "check the mesh for inverted and overlapping elements and mesh again",
        ),
        (
            with(
                &with(TEXT_2, "$Nodes\n4\n", "$Nodes\n5\n5 1 1 1\n"),
                "$Elements\n2\n",
                "$Elements\n3\n3 2 2 1 1 1 2 5\n",
            )
            .into(),
            "a.msh:19: triangle 3 of surface `base` is no face of any tetrahedron",
            "surfaces that bound the body or lie in it",
            "take the surface out of the physical group, or export the volume that belongs to it too",
        ),
        (
            four("$Entities\n0 0 1 1\n", "$Entities\n0 0 2 1\n5 0 0 0 1 1 0 1 1 0\n"),
            "a.msh:12: a second entity 5 of dimension 2",
            "each entity once",
            DAMAGED,
        ),
    ]);
}
