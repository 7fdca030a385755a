//! Forcing terms: how accurately an iterative solver solves the linear system of a Newton iteration.

/// Parameters of the forcing terms of Eisenstat and Walker.
///
/// Iteration `k` solves its linear system to the relative residual
///
/// ```text
/// eta_k = gamma (|r_k| / |r_(k-1)|)^2,    at least gamma eta_(k-1)^2 if that is above 0.1,    at most `largest`,
/// ```
///
/// so that the iteration converges quadratically without accuracy that a bad direction wastes (S. C. Eisenstat, H. F.
/// Walker, *Choosing the forcing terms in an inexact Newton method*, SIAM J. Sci. Comput. 17, 1996, choice 2). No
/// system is solved further than convergence of Newton's method needs, and the last one is solved as far.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Forcing {
    /// The forcing term of the first iteration, and the largest one. Default 0.01.
    pub largest: f64,
    /// The factor `gamma`. Default 0.9.
    pub gamma: f64,
}

impl Default for Forcing {
    fn default() -> Self {
        Self { largest: 1e-2, gamma: 0.9 }
    }
}

/// A system that brings the residual this close to its limit is solved to the limit instead, which saves an iteration.
const LAST: f64 = 30.0;

/// The part of the limit that the residual of the last system may use.
const MARGIN: f64 = 0.5;

/// The forcing terms of one solution.
pub(super) struct Sequence {
    params: Forcing,
    /// The residual norm and the forcing term of the previous iteration.
    previous: Option<(f64, f64)>,
}

impl Sequence {
    pub fn new(params: Forcing) -> Self {
        Self { params, previous: None }
    }

    /// Returns the forcing term of the next iteration, from the residual norm before it and the norm at which Newton's
    /// method has converged.
    pub fn next(&mut self, norm: f64, limit: f64) -> f64 {
        let Forcing { largest, gamma } = self.params;
        let mut eta = match self.previous {
            None => largest,
            Some((before, eta)) => {
                let ratio = gamma * (norm / before).powi(2);
                let safeguard = gamma * eta * eta;
                if safeguard > 0.1 { ratio.max(safeguard) } else { ratio }
            }
        };
        eta = eta.min(largest);
        if norm > 0.0 {
            let needed = MARGIN * limit / norm;
            if eta * norm <= LAST * limit {
                eta = needed;
            }
            eta = eta.max(needed).min(largest);
        }
        self.previous = Some((norm, eta));
        eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn terms_follow_the_residual_and_end_at_the_limit() {
        let mut forcing = Sequence::new(Forcing::default());
        assert_eq!(forcing.next(1.0, 1e-8), 1e-2);
        let second = forcing.next(1e-2, 1e-8);
        assert!((second - 0.9e-4).abs() < 1e-18, "{second}");
        // 1e-6 times 0.9e-8 is below the limit: no more accuracy than the limit needs.
        assert!((forcing.next(1e-6, 1e-8) - 0.5e-2).abs() < 1e-15);
    }

    #[test]
    fn a_residual_that_does_not_fall_keeps_the_largest_term() {
        let mut forcing = Sequence::new(Forcing { largest: 0.5, ..Forcing::default() });
        assert_eq!([forcing.next(1.0, 1e-8), forcing.next(2.0, 1e-8)], [0.5, 0.5]);
        // 0.9 * 0.5^2 = 0.225 is a safeguard against a single small residual.
        assert_eq!(forcing.next(1e-3, 1e-8), 0.225);
        assert_eq!(forcing.next(0.0, 1e-8), 0.0);
    }
}
