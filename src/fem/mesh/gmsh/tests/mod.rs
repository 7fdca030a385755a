//! Tests of the Gmsh reader and writer.

mod broken;
mod damaged;
mod features;
mod round_trip;

use std::path::Path;

use super::{MeshFile, parse};
use crate::input::InputError;

/// One tetrahedron and one of its faces, version 2.2.
const TEXT_2: &str = "\
$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 \"base\"
3 1 \"tissue\"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
$EndNodes
$Elements
2
1 2 2 1 1 1 2 3
2 4 2 1 1 1 2 3 4
$EndElements
";

/// The same mesh in version 4.1, with node tags that have gaps.
const TEXT_4: &str = "\
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 \"base\"
3 1 \"tissue\"
$EndPhysicalNames
$Entities
0 0 1 1
5 0 0 0 1 1 0 1 1 0
6 0 0 0 1 1 1 1 1 1 5
$EndEntities
$Nodes
2 4 10 90000
2 5 0 3
10
20
30
0 0 0
1 0 0
0 1 0
3 6 0 1
90000
0 0 1
$EndNodes
$Elements
2 2 1 2
2 5 2 1
1 10 20 30
3 6 4 1
2 10 20 30 90000
$EndElements
";

fn read(bytes: impl AsRef<[u8]>) -> Result<MeshFile, InputError> {
    parse(bytes.as_ref(), Path::new("a.msh"))
}

/// Replaces a piece of a text; the piece must occur exactly once.
fn with(text: &str, old: &str, new: &str) -> String {
    assert_eq!(text.matches(old).count(), 1, "{old:?} does not occur exactly once");
    text.replace(old, new)
}
