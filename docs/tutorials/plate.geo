// A plate of 20 mm x 10 mm x 2 mm with a hole, in millimeters.
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 20, 10, 2};
Cylinder(2) = {10, 5, -1, 0, 0, 4, 2.5};
BooleanDifference{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Physical Volume("gel") = {1};
Physical Surface("left") = Surface In BoundingBox{-0.1, -0.1, -0.1, 0.1, 10.1, 2.1};
Physical Surface("right") = Surface In BoundingBox{19.9, -0.1, -0.1, 20.1, 10.1, 2.1};
Mesh.MeshSizeMax = 2.5;
Mesh.MeshSizeMin = 1.0;
