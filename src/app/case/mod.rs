//! A case: the complete input of a simulation, read from one TOML file and checked.
//!
//! [`Case::read`] reads a file, [`Case::parse`] a text. Both return the case with warnings, or all errors in the file,
//! each with its line, the value found, the value expected (with range and unit) and the cure. [`Case::check_names`]
//! compares the names in a case with those of its mesh, and [`Case::to_toml`] writes a case with all defaults filled
//! in.
//!
//! # Example
//!
//! A block pulled along x, with every section that a case may have. Lengths of the mesh are in mesh units of
//! `[mesh] scale` meters; everything else is in SI units. Integers are accepted where numbers are expected.
//!
//! ```
//! let text = r#"
//! title = "Block in tension"               # the name of the file where absent
//!
//! [mesh]                                   # a file of Gmsh or VTK: file = "block.msh" or "block.vtu"; or a built-in
//!                                          ## shape: "box", "tube" (below), or "dogbone" with an element_size in mesh units
//! generate = { shape = "box", cells = [4, 2, 2], size = [2.0, 1.0, 1.0] }
//! scale = 0.001                            # default 1.0: a mesh unit is a meter
//!
//! [[region]]
//! name = "*"                               # a physical volume; "*": all that no other region names
//! f_bar = false                            # default; true: no volumetric locking (below)
//! [region.material]
//! model = "neo-hookean"                    # or another formula, or "fiber-rve" (below)
//! youngs_modulus = 1.0e6                   # two of: youngs_modulus, shear_modulus, lame_lambda (Pa),
//! poisson_ratio = 0.3                      # poisson_ratio
//!
//! [[boundary]]
//! surface = "x0"                           # a physical surface
//! displacement = { x = 0.0 }               # m; a component not named is free
//! [[boundary]]
//! surface = "x1"
//! traction = [4.0e4, 0.0, 0.0]             # Pa of reference area
//! curve = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.2]]   # factor over pseudo-time t; default "ramp": the factor is t
//!
//! [[boundary]]
//! surface = "z1"
//! pressure = 1.0e3                         # Pa of current area, normal to the deformed surface; presses on the body
//!
//! [[boundary]]
//! surface = "y0"
//! foundation = { normal = 1.0e8, tangential = 0.0 }   # springs, Pa/m of reference area; or one number for both
//!
//! [[boundary]]
//! surface = "z0"
//! symmetry = true                          # a plane of any orientation: no displacement along its normal
//!
//! [[point]]
//! at = [0.0, 0.0, 0.0]                     # the node nearest to it, in mesh units; or: node = 0
//! displacement = { y = 0.0, z = 0.0 }
//! [[point]]
//! at = [0.0, 1.0, 0.0]
//! displacement = { z = 0.0 }
//! force = [1.0e-3, 0.0, 0.0]               # N on this node; with a displacement of other components, or alone
//!
//! [[body_force]]
//! region = "*"                             # "*": the whole body
//! value = [0.0, 0.0, -9.81e3]              # N/m^3 of reference volume; takes a curve too
//!
//! [[constraint]]
//! region = "*"                             # or: cavity = ["inner", "lid"], the surfaces that enclose it together
//! name = "tissue"                          # in loads.csv; default: the region, or the first surface
//! volume = "constant"                      # or the volume over that at rest: [[0.0, 1.0], [1.0, 1.2]]
//! method = "multiplier"                    # default; or "penalty" (below)
//!
//! [steps]
//! count = 20                               # default 10
//! max_cuts = 6                             # default; how many times a failing step may be halved
//! adaptive = false                         # default; true, or { target_iterations = 8, largest = 1.0, smallest = 0.015625 }
//!                                          ## (lengths in steps), which replaces `max_cuts`
//!
//! [newton]                                 # the macro scale, with its defaults
//! tolerance = 1e-8                         # of the residual, relative to the forces
//! max_iterations = 25
//! line_search = true
//! displacement_tolerance = 1e-6            # optional: the last correction, relative to the increment's displacements
//! energy_tolerance = 1e-12                 # optional: its work, relative to those displacements times the forces
//! start = "tangent"                        # a step starts from a linear prediction; "held": from the last state
//! solver = { method = "direct" }           # or an iterative one (below)
//!
//! [micro]                                  # every RVE, with its defaults
//! tolerance = 1e-10
//! max_iterations = 50
//! max_cuts = 6
//! stages = ["newton", "regularized", "cuts", "relaxation"]   # tried in this order, whatever the order here
//! solver = { method = "direct" }           # or an iterative one (below)
//! predictor = true                         # start from the prediction of the last tangent; 72 bytes per interior node
//! device = "none"                         # or "cuda": a graphics processor solves most RVEs, many at once
//! lanes = "auto"                          # RVEs of one network side by side in vector registers; or "off": one by one
//!
//! [scales]                                 # ranks of each scale; default: one process does both
//! macro = 1
//! micro = 0                                # default: all ranks that `macro` leaves; or the number for the RVEs
//! near = false                             # or true: by the machines' topology, in a build with the feature `hwloc`
//!
//! [scales.balance]                         # how RVEs move between ranks (below)
//! planner = "diffusive"                    # or "longest-first", "greedy", "metis"; "none": they stay
//! weights = "predictor"                    # what an RVE costs next: or "seconds", "iterations", "unit"
//! trigger = { threshold = 1.05, sweeps = 1, cool_down = 0, horizon = 10 }   # or the threshold alone
//! when = "iteration"                       # before any evaluation; or "step": before the first one of a step
//!
//! [output]
//! directory = "results"                    # default; relative to the case file
//! every = 1                                # default; steps between two writings of the fields; 0: no fields
//! checkpoint = 1                           # default; steps between two checkpoints
//! points = false                           # default; or true: also the values at the integration points
//! costs = false                            # default; or true: what each RVE costs in every sweep
//! fields = "default"                       # default: those of the materials; or names, such as ["cauchy_stress"]
//! rve = "none"                             # default; or "all", or ids of elements, such as [0, 17]
//! "#;
//! # use std::path::Path;
//! use biotissue::app::case::{Case, MeshSource};
//! use biotissue::fem::element::ElementType;
//!
//! let file = Case::parse(text, Path::new("block.toml"))?;
//! assert!(file.warnings.is_empty());
//! let element = ElementType::Tet4;
//! assert_eq!(file.case.mesh, MeshSource::Box { cells: [4, 2, 2], size: [2.0, 1.0, 1.0], element });
//! assert_eq!(file.case.boundaries[1].curve.factor(0.25, [0.0; 3]), 0.5);
//!
//! let names = |list: &[&str]| list.iter().map(|name| name.to_string()).collect::<Vec<_>>();
//! file.case.check_names(&names(&["body"]), &names(&["x0", "x1", "y0", "y1", "z0", "z1"]))?;
//!
//! let errors = Case::parse(&text.replace("count = 20", "cuont = 20"), Path::new("block.toml")).unwrap_err();
//! assert_eq!(errors.0[0].cure, "did you mean `count`?");
//! # Ok::<(), biotissue::input::InputErrors>(())
//! ```
//!
//! # Fiber networks as a material
//!
//! ```toml
//! [region.material]
//! model = "fiber-rve"
//! networks = ["networks/*.txt"]            # files or patterns, relative to the case file; patterns skip files that
//!                                          # end in .params or .toml
//! choose = "random"                        # default, by seed and integration point; or "cycle", by integration point
//! seed = 1                                 # default
//! fiber_volume_fraction = 0.003            # or: scale = "raw"
//! law = { name = "exponential", youngs_modulus = 1.0e8, radius = 5.0e-8, nonlinearity = 1.2 }
//! matrix = { model = "neo-hookean", shear_modulus = 100.0, poisson_ratio = 0.3 }
//! ```
//!
//! With `scale = "raw"`, the stresses are the forces of the network in the unit cube, in N per square of the edge: every
//! network is scaled to the unit cube, whatever the edge of the cube in its file, but the `radius` of its fibers is not.
//! If the cube has the edge `a` in the unit of the radius, give `radius / a` as the radius for stresses in Pa.
//! `biotissue network info` prints the edge in the unit of the file. A `fiber_volume_fraction` needs no such care.
//!
//! ```toml
//! life = { created_at = 0.02, before = "linear", asleep_below = 1e-4, deleted_at = 0.8 }   # with the keys above
//! ```
//!
//! `life` defines when RVEs are created, sleep and are deleted; without it, every RVE exists and is awake throughout.
//! An RVE is created once the strain of its element (the norm of the Green-Lagrange strain) exceeds `created_at`;
//! before that, `linear` (the response of its network at rest) or `matrix` replaces it. It falls asleep at the end of a
//! step in which every component of the deformation gradient changed by less than `asleep_below`, and wakes once a
//! component has changed by more since; while it sleeps, its last tangent extrapolates the stress. It is deleted once
//! the strain exceeds `deleted_at`; the matrix then remains alone.
//!
//! Whenever RVEs are created, woken or deleted, the body is solved again at the same load until no strain requires
//! another change; only then has the step converged. Of the RVEs to be deleted, the most strained tenth goes first
//! (elements with equal strains together); the others are deleted only if their strain still exceeds the limit
//! afterwards.
//!
//! `law` is `linear` (`youngs_modulus`, `radius`), `exponential` (also `nonlinearity`), `exponential-stretch` (also
//! `transition`) or `table`; without it, the parameter files beside each network define the law, and fibers may be of
//! several types. `matrix` is optional. `networks = []` with a `matrix` uses the matrix alone at every point, evaluated
//! by the micro scale, for comparison with the same formula as a material; `biotissue check` counts these points as
//! RVEs, and warns. A table is a CSV file, relative to the case file, or a list of points (stretch and nominal stress
//! in Pa), one of them at stretch 1 and stress 0:
//!
//! ```toml
//! law = { name = "table", radius = 5.0e-8, file = "curve.csv" }
//! law = { name = "table", radius = 5.0e-8, points = [[0.9, -1.0e5], [1.0, 0.0], [1.1, 2.0e6], [1.2, 9.0e6]] }
//! ```
//!
//! Either of these keys, added to any law, makes its fibers buckle in compression:
//!
//! ```toml
//! compression = 1e-3                       # residual fraction of the stiffness at rest; default beside the other key
//! buckling_strain = 0.01                   # shortening over which it drops; default beside the other key
//! ```
//!
//! [`crate::fiber::law`] documents the formulas.
//!
//! # Formulas as a material
//!
//! ```toml
//! [region.material]                        # isotropic: two of youngs_modulus, shear_modulus, lame_lambda, poisson_ratio
//! model = "neo-hookean"                    # or "linear-elastic", for small strains
//! youngs_modulus = 1.0e6                   # Pa
//! poisson_ratio = 0.3
//! ```
//!
//! ```toml
//! model = "holmes-mow"                     # isotropic and stiffening; constants as above
//! youngs_modulus = 1.0e6
//! poisson_ratio = 0.3
//! beta = 0.5                               # exponent
//! ```
//!
//! ```toml
//! model = "transversely-isotropic"
//! youngs_modulus = 1.0e5                   # normal to the axis, Pa
//! poisson_ratio = 0.2
//! axial_youngs_modulus = 4.0e5             # along the axis, Pa
//! axial_shear_modulus = 6.0e4              # in planes that contain the axis, Pa
//! axis = [0.0, 0.0, 1.0]                   # of any length
//! ```
//!
//! ```toml
//! model = "holzapfel-gasser-ogden"
//! shear_modulus = 3.0e3                    # of the matrix, Pa
//! k1 = 2.0e3                               # stiffness of the fibers, Pa
//! k2 = 0.8                                 # their exponent
//! dispersion = 0.1                         # kappa, from 0 (default: all fibers along their axis) to 1/3 (isotropic)
//! bulk_modulus = 1.0e6                     # Pa
//! axes = [[0.8, 0.6, 0.0], [0.8, -0.6, 0.0]]   # of one or two families of fibers
//! ```
//!
//! ```toml
//! model = "guccione"
//! c = 2.0e3                                # stress scale, Pa
//! bf = 8.0                                 # exponents: along the fibers,
//! bt = 2.0                                 # across them,
//! bfs = 4.0                                # of shear along them
//! bulk_modulus = 1.0e6                     # Pa
//! axis = [1.0, 0.0, 0.0]
//! ```
//!
//! All but `linear-elastic` can also be the `matrix` of a `fiber-rve`, in parallel with the networks.
//! [`crate::fem::material`] documents the formulas.
//!
//! # Nearly incompressible materials
//!
//! Linear elements are far too stiff in nearly incompressible materials: they lock. With `f_bar = true`, each linear
//! hexahedron of the region, or patch of linear tetrahedra, has one dilatation, which prevents locking at the price of
//! an unsymmetric tangent (see [`assembly`](crate::fem::assembly#f-bar)). Quadratic elements (`order = 2`) are an
//! alternative. Wedges have neither. `biotissue check` warns of linear elements without `f_bar`, and of wedges, at
//! Poisson ratios above 0.45. The dilatation is that of the center of a hexahedron, so that the volume of a strongly
//! deformed coarse mesh (`NAME.volume` in `loads.csv`) differs from it; a `[[constraint]]` controls the true volume, and
//! its pressure then depends on the mesh. Use quadratic elements, or a finer mesh, where the pressure of a constraint
//! matters.
//!
//! # Rigid surfaces and free bodies
//!
//! ```toml
//! [[boundary]]
//! surface = "x1"                           # its nodes move as a rigid body
//! rigid = { reference = [1.0, 0.5, 0.5], displacement = { y = 0.0, z = 0.0 }, rotation = { x = 0.6, y = 0.0, z = 0.0 } }
//! curve = "ramp"                           # default; of the displacement and the rotation
//! ```
//!
//! `displacement` (m) moves the reference point (`reference`, in mesh units; by default the centroid of the surface),
//! and `rotation` is the rotation vector about it: the axis times the angle in rad. A component that is not named is
//! free. No force acts along a free direction, except those of other loads: a `traction`, `pressure` or `foundation` on
//! the same surface acts on the grip. The moment conjugate to a free component of the rotation vector is zero. This is
//! the moment about that axis only as long as the rotation is small: beside a prescribed rotation, a tilt of the grip
//! meets a moment that grows with the angle and has no limit at 2 pi, so prescribe all three components for angles above
//! about 1 rad. `loads.csv` gives the moment about the displaced reference point, exerted by the grip and other loads,
//! and the motion. See [`RigidCondition`](crate::fem::boundary::RigidCondition).
//!
//! A rigid surface may touch a plane of symmetry in which it moves: with no displacement along the normal of the plane,
//! and no rotation except about the normal; prescribe all components that could leave it. For an inclined plane, give them
//! with at least 5 digits, or as expressions: `displacement = { x = "0.1*cos(pi/6)", y = 0.05 }`.
//!
//! ```toml
//! [body]
//! free = "rigid"                           # hold the free rigid-body motions of a body whose loads balance
//! ```
//!
//! adds the fewest zero displacements of single nodes that prevent rigid-body motions; `biotissue check` lists them.
//! They exert no force if the loads balance on the deformed body; otherwise the step fails. A rigid surface with a
//! prescribed and a free component of its rotation vector resists tilting, so that its moments do not balance those of
//! another one.
//!
//! # Volume constraints
//!
//! ```toml
//! [[constraint]]
//! cavity = "lumen"                         # the wall, whose faces form a closed surface
//! volume = [[0.0, 1.0], [1.0, 1.5]]
//! method = "penalty"
//! penalty = 100.0                          # default
//! ```
//!
//! A constraint finds the pressure that gives a region or a cavity its volume. A positive pressure presses on the walls
//! of the cavity, or expands the region; `loads.csv` lists it. The `multiplier` satisfies the constraint in every
//! equilibrium. The `penalty` method (augmented Lagrangian) restores equilibrium with adapted pressures until the
//! volume is within the tolerance of `[newton]`, relative to the volume at rest. `penalty` is the penalty parameter in
//! units of `|A| / V0`, with the mean norm `|A|` of the tangent at rest in Pa and the volume `V0` at rest: larger
//! values need fewer rounds, which `log.jsonl` counts as `augmentations`. `name` names the columns of the constraint in
//! `loads.csv`; by default, it is the region (`all` for `*`) or the first surface of the cavity. See
//! [`constraint`](crate::fem::constraint).
//!
//! # Linear solvers
//!
//! ```toml
//! [newton]
//! solver = "auto"                          # default: by size; or "direct", "cg", "bicgstab", "gmres"
//! ```
//!
//! ```toml
//! [newton]                                 # or [micro], whose default is "direct"
//! solver = { method = "gmres", restart = 50, preconditioner = "ilut", drop_tolerance = 1e-4, fill = 50, tolerance = 1e-12, max_iterations = 1000 }
//! ```
//!
//! `auto` estimates the time of a factorization and of an iterative solution from the pattern of the stiffness, and
//! takes conjugate gradients with algebraic multigrid (GMRES if the matrix may be indefinite or is unsymmetric) where
//! they are at least twice as fast, from about 15 000 unknowns of a compact body. `biotissue check` and `log.jsonl` name
//! the choice and both times. Where the iteration fails, the direct solver replaces it until the increment ends, and the
//! run says so. See [`SolverChoice`](crate::las::SolverChoice).
//!
//! `method` is `direct`, `cg`, `bicgstab` or `gmres` (the only one with a `restart`), `preconditioner` is `ilut` (the
//! only one with `drop_tolerance` and `fill`, see [`Preconditioner::Ilut`](crate::las::Preconditioner::Ilut)),
//! `diagonal`, `none` or, on the backends `sparse` and `petsc`, `multigrid`. `tolerance` applies to every linear system:
//! the norm of its residual over that of its right-hand side; it limits the accuracy of the RVE tangents. Without
//! a `tolerance` in `[newton]`, each system is solved only as far as Newton's method needs
//! ([`Forcing`](crate::las::Forcing)). The other numbers above are the defaults; without a `preconditioner`, `cg` uses
//! `diagonal` and the others `ilut`. An incomplete LU factorization is not symmetric: if it drops many entries, `cg` may
//! fail with it; use `gmres` or `bicgstab` then.
//!
//! # Elements
//!
//! ```toml
//! [mesh]
//! generate = { shape = "box", cells = [4, 2, 2], size = [2.0, 1.0, 1.0], element = "hex8" }   # default "tet4"
//! order = 2                                # default 1: the elements as they are in the file or the shape
//! hexahedra = 27                           # nodes of a hexahedron of order 2; default 20
//! ```
//!
//! ```toml
//! [mesh]                                   # a hollow cylinder around the z axis, from z = 0; lengths in mesh units
//! generate = { shape = "tube", cells = [2, 16, 20], inner_radius = 3.0, outer_radius = 4.0, length = 50.0 }
//! ```
//!
//! The box and the tube consist of six tetrahedra per cell (`tet4`), of two wedges (`wedge6`), or of one hexahedron
//! (`hex8`). The `cells` of the tube are those through its wall, around its axis (3 or more) and along it; its region
//! is `wall`, its surfaces are `inner`, `outer`, `z0` and `z1`. With elements of order 1 it is a prism. `order = 2`
//! replaces linear tetrahedra by those of 10 nodes, and linear hexahedra by those of 20 or 27 nodes, in any source of
//! the mesh; the new nodes lie at the centers of edges, faces and elements, so that curved surfaces do not become
//! smoother. Only those of the tube lie on its cylinders. There are no wedges of order 2. A mesh that is of order 2 in
//! its file needs no `order`.
//!
//! A `.vtu` file (`file = "body.vtu"`) has numbers instead of names: the regions `region_1`, `region_2`, ... and the
//! surfaces `surface_1`, ... are the values of an integer array `region` of its cells ([`crate::app::vtu`]).
//!
//! # Expressions
//!
//! ```toml
//! [[boundary]]
//! surface = "x1"
//! traction = ["1e3*z", 0.0, 0.0]           # each component a number or an expression of t, x, y, z
//! curve = "t^2"                            # instead of "ramp" or a table
//! [[boundary]]
//! surface = "y1"
//! pressure = "50*sin(pi*t)"                # contains t: no curve
//! [[boundary]]
//! surface = "x0"
//! displacement = { x = "0.1*t*y", y = 0.0 }
//! ```
//!
//! `t` is the pseudo-time from 0 to 1, and `x`, `y`, `z` are the position in the reference state, m.
//! [`crate::app::expression`] lists operators and functions. Displacements of surfaces and points and forces on points
//! are evaluated at nodes; tractions, pressures and body forces (`value = [...]`) at integration points; the
//! displacement and the rotation of a `rigid` surface at its reference point.
//!
//! An expression that contains `t` is the value at every time, and a `curve` beside it is an error. Everything else,
//! numbers and expressions of the position, is multiplied by the curve, which is `t` by default. So
//! `traction = ["1e3*t*z", 5.0, 0.0]` is the same as `["1e3*t*z", "5.0*t", 0.0]`. An expression without variables is a
//! number. A value that is not finite where it is evaluated, at `t` = 0 or the end of a step, is an error.
//!
//! Increments end at the points of a table, but not at the times at which the rate of an expression jumps, such as
//! those of `min`, `step` and `abs` of `t`: choose `[steps] count` so that a step ends there.
//!
//! Two boundaries or points that share a node may prescribe the same component there if their displacements are equal:
//! as numbers and curves, or else exactly at every hundredth of pseudo-time and at the points of tables.
//!
//! # Fields of material parameters
//!
//! Every number of a formula, also of the `matrix` of a `fiber-rve`, may vary over the body:
//!
//! ```toml
//! [region.material]
//! model = "transversely-isotropic"
//! youngs_modulus = "1e3*(1 + x)"                       # an expression of x, y, z
//! poisson_ratio = 0.2
//! axial_youngs_modulus = { cells = "E" }               # an array of the cells of the mesh, a .vtu file
//! axial_shear_modulus = { file = "G.csv", column = "G" }
//! axis = ["-y", "x", 0]                                # of any length; or a field of three components:
//! # axis = { cells = "fiber" }
//! # axis = { file = "field.vtu", cells = "fiber" }     # of another file with the same cells
//! # axis = { file = "G.csv", columns = ["ax", "ay", "az"] }
//! ```
//!
//! An expression is evaluated at the reference position of every integration point; the other fields have one value for
//! each element. A CSV file has names in its first line and one row for each element of the mesh, in the order of the
//! result files, or in any order with a column `element` (from 0); rows of elements outside of the region may then be
//! missing. The cells of another `.vtu` file are those of the mesh in the same order, in mesh units or in meters, such
//! as those of a result file. Each value must be in the range of the number that it replaces. `biotissue check` prints
//! the range of every field. [`crate::app::material_fields`] evaluates fields.
//!
//! # Checkpoints
//! The state of the run is written after every `checkpoint` steps, after the last one, and after the last converged step
//! of a run that fails ([`crate::app::checkpoint`]). A run that is killed continues with the step after its last
//! checkpoint, and repeats up to `checkpoint` steps.
//!
//! # Restrictions
//!
//! * A surface may appear in several boundaries and a node in several points, but each component is prescribed once: by
//!   a displacement, a nonzero traction or a rigid motion. Pressures on one surface add up, as do body forces of one
//!   region.
//! * Names of regions are unique. The region `*` covers every region of the mesh that no other `[[region]]` names, so
//!   that no region has two materials.
//! * Names of constraints are unique. That of a cavity is not the name of a region.

mod constraint;
mod data;
mod elastic;
mod field_names;
mod formula;
mod law;
mod load;
mod load_value;
mod material;
mod names;
mod networks;
mod parameter;
mod problems;
mod range;
mod read;
mod section;
mod solver;
mod table;
#[cfg(test)]
mod tests;
mod value;
mod write;

pub use crate::fem::boundary::LoadCurve;
pub use crate::fem::stepping::{AdaptiveIncrements, StepStart};
pub use crate::fiber::rve::StressScale;
pub use crate::tissue::materials::{
    BeforeCreation, ElementSelection, FiberRve, Formula, NetworkAssignment, RegionMaterial, RveLifecycle, RveParams,
};
pub use data::*;
pub use field_names::FieldSelection;
pub use formula::{FieldFormula, FormulaCase, FormulaModel};
pub(crate) use formula::{Unstable, entries as formula_entries};
pub use load_value::LoadValue;
pub(crate) use load_value::terms;
pub(crate) use parameter::direction;
pub use parameter::{AxisCase, FieldCase, FieldSource, ParameterCase};
pub(crate) use range::Range;
pub use read::CaseFile;
