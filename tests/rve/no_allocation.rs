//! The iterations of an RVE allocate no memory.

use biotissue::backends::sparse::Sparse;
use nalgebra::Matrix3;

use crate::{counting, support};

/// The number of allocations of an equilibrium solve does not depend on its number of iterations.
#[test]
fn iterations_of_an_rve_do_not_allocate() {
    let mut bench = support::Bench::<Sparse>::new(&support::frozen(), Some(support::laws()[1].clone()));
    let mut equilibrium = |stretch: f64| {
        let mut rve = bench.at_rest();
        let target = Matrix3::from_diagonal(&[stretch, 1.0, 1.0].into());
        let before = counting::calls();
        let report = bench.solve(&mut rve, &target).unwrap();
        (report.iterations, counting::calls() - before)
    };
    // The first solve allocates the scratch memory.
    equilibrium(1.3);
    let (few, many) = (equilibrium(1.0 + 1e-4), equilibrium(1.3));
    assert!(few.0 < many.0, "{few:?} against {many:?} iterations and allocations");
    assert_eq!(few.1, many.1, "{few:?} against {many:?} iterations and allocations");
}
