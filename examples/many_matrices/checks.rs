//! Checks of the results of the two cases.

use biotissue::las::{Backend, MatVec, VectorOps};

use crate::operators::{B, BZ, N, NODES, P, V, on_nodes};
use crate::step::{DT, Outcome, STEPS};
use crate::{Error, numerical_wave_numbers};

/// A number with an upper limit.
pub struct Check {
    /// The description of the number.
    pub what: &'static str,
    pub found: f64,
    pub limit: f64,
}

impl Check {
    /// Returns whether the number is below its limit; false for NaN.
    pub fn is_met(&self) -> bool {
        self.found < self.limit
    }
}

/// Checks the standing wave: the velocity is the initial velocity times a cosine, whose phase grows in each step by the
/// angle given by `tan(angle / 2) = omega dt / 2` with `omega = k . B`.
pub fn wave<S: Backend>(end: &Outcome<S>) -> Result<Vec<Check>, Error> {
    let omega: f64 = numerical_wave_numbers().into_iter().zip(B).map(|(k, b)| k * b).sum();
    let cosine = (STEPS as f64 * 2.0 * (0.5 * omega * DT).atan()).cos();
    let (mut error, mut size) = (0.0_f64, 0.0_f64);
    for v in V {
        for (now, first) in end.fields[v].as_slice().iter().zip(end.start[v].as_slice()) {
            error = error.max((now - cosine * first).abs());
            size = size.max(first.abs());
        }
    }
    let (now, first) = (end.operators.energy(&end.fields)?, end.operators.energy(&end.start)?);
    let pressure = end.fields[P].as_slice().iter().fold(0.0_f64, |most, p| most.max(p.abs()));
    Ok(vec![
        Check { what: "wave: error of the velocity", found: error / size, limit: 1e-10 },
        Check { what: "wave: change of energy", found: (now / first - 1.0).abs(), limit: 1e-11 },
        Check { what: "wave: pressure", found: pressure / size, limit: 1e-11 },
    ])
}

/// Checks the conserved quantities of the pressure pulse, and its energy balance.
pub fn puff<S: Backend>(end: &Outcome<S>) -> Result<Vec<Check>, Error> {
    let (operators, ones, nodes) = (&end.operators, on_nodes(|_, _| 1.0), NODES as f64);
    let change = |field: usize| -> Result<f64, Error> {
        Ok((end.fields[field].dot(&ones)? - end.start[field].dot(&ones)?).abs() / nodes)
    };
    let (now, first) = (operators.energy(&end.fields)?, operators.energy(&end.start)?);
    let (mut product, mut momentum) = (on_nodes(|_, _| 0.0), 0.0_f64);
    for v in V {
        operators.density.mul(&end.fields[v], &mut product)?;
        momentum = momentum.max(product.dot(&ones)?.abs() / nodes);
    }
    let imbalance = (first - now - end.dissipated).abs() / first;
    Ok(vec![
        Check { what: "puff: energy lost but not dissipated", found: imbalance, limit: 1e-11 },
        Check { what: "puff: change of mass", found: change(N)?, limit: 1e-12 },
        Check { what: "puff: change of heat", found: change(P)?, limit: 1e-12 },
        Check { what: "puff: change of magnetic flux", found: change(BZ)?, limit: 1e-12 },
        Check { what: "puff: change of momentum", found: momentum, limit: 1e-12 },
    ])
}

/// Compares the puff on two backends: the largest difference of the fields, relative to the largest value.
pub fn difference<S: Backend, T: Backend>(a: &Outcome<S>, b: &Outcome<T>) -> Check {
    let (mut difference, mut size) = (0.0_f64, 0.0_f64);
    for (a, b) in a.fields.iter().zip(&b.fields).flat_map(|(a, b)| a.as_slice().iter().zip(b.as_slice())) {
        difference = difference.max((a - b).abs());
        size = size.max(a.abs());
    }
    Check { what: "puff: difference from one process without PETSc", found: difference / size, limit: 1e-11 }
}
