//! Robust losses: how much a residual of a given size counts.

/// One loss, in units of the noise.
pub struct LossRow {
    /// As the command line calls it.
    pub name: &'static str,
    /// rho(r), equal to r^2 near zero for the smooth ones.
    pub value: fn(f64) -> f64,
    /// Weight of the residual in iteratively reweighted least squares: rho'(r) / (2 r).
    pub weight: fn(f64) -> f64,
    /// Where it comes from.
    pub source: &'static str,
}

/// A loss: a row of [`LOSSES`].
///
/// ```
/// use leverrier::Loss;
///
/// assert_eq!(Loss::by_name("squares"), Some(Loss::SQUARES));
/// assert!(Loss::by_name("huber").is_some() && Loss::by_name("cubes").is_none());
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Loss(u8);

impl Loss {
    /// Least squares: the right loss for Gaussian noise.
    pub const SQUARES: Loss = Loss(0);

    /// The row of that name.
    ///
    /// ```
    /// use leverrier::Loss;
    ///
    /// assert_eq!(Loss::by_name("squares"), Some(Loss::SQUARES));
    /// assert_eq!(Loss::by_name("cubes"), None);
    /// ```
    pub fn by_name(name: &str) -> Option<Loss> {
        LOSSES.iter().position(|row| row.name == name).map(|i| Loss(i as u8))
    }

    /// Its row of the table.
    #[doc(hidden)]
    pub fn row(self) -> &'static LossRow {
        &LOSSES[self.0 as usize]
    }

    /// Whether it is plain least squares.
    #[doc(hidden)]
    pub fn is_squares(self) -> bool {
        self == Loss::SQUARES
    }

    /// What a residual adds to the estimate of the noise's variance, whose expectation is one
    /// for Gaussian noise: the square, or for robust losses what Huber's second proposal makes
    /// of it (Huber, Ann. Math. Stat. 35, 1964, section 7), so that outliers do not hide the
    /// noise that they stand out of.
    #[doc(hidden)]
    pub fn scale(self, r: f64) -> f64 {
        if self.is_squares() { r * r } else { (r * r).min(HUBER * HUBER) / CLIPPED }
    }
}

/// Where Huber's loss turns from squares to absolute values: 95 % efficiency for Gaussian noise.
const HUBER: f64 = 1.345;
/// Expectation of min(z^2, HUBER^2) for a standard normal z.
const CLIPPED: f64 = 0.710_164;
/// Scale of the Cauchy loss: 95 % efficiency for Gaussian noise.
const CAUCHY: f64 = 2.3849;
/// Below this residual the absolute loss is rounded off, so that its weight stays finite.
const CORNER: f64 = 1e-3;

/// The losses. A new one is one row here.
pub static LOSSES: &[LossRow] = &[
    LossRow { name: "squares", value: |r| r * r, weight: |_| 1.0, source: "Gauss (1809)" },
    LossRow {
        name: "huber",
        value: |r| {
            let size = r.abs();
            if size <= HUBER { r * r } else { HUBER * (2.0 * size - HUBER) }
        },
        weight: |r| if r.abs() <= HUBER { 1.0 } else { HUBER / r.abs() },
        source: "Huber, Ann. Math. Stat. 35 (1964) 73",
    },
    LossRow {
        name: "absolute",
        value: |r| 2.0 * ((r * r + CORNER * CORNER).sqrt() - CORNER),
        weight: |r| 1.0 / (r * r + CORNER * CORNER).sqrt(),
        source: "the L1 loss of DiPietro, Xiong and Zhu (2020), eq. 6, with a rounded corner",
    },
    LossRow {
        name: "cauchy",
        value: |r| CAUCHY * CAUCHY * (r / CAUCHY).powi(2).ln_1p(),
        weight: |r| 1.0 / (1.0 + (r / CAUCHY).powi(2)),
        source: "Holland and Welsch, Commun. Stat. A6 (1977) 813",
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_derivatives_of_the_losses() {
        for row in LOSSES {
            for r in [-7.0, -1.2, -0.3, 0.4, 1.3, 2.0, 25.0] {
                let h = 1e-6;
                let slope = ((row.value)(r + h) - (row.value)(r - h)) / (2.0 * h);
                assert!((slope - 2.0 * r * (row.weight)(r)).abs() < 1e-6, "{} at {r}", row.name);
            }
            assert!((row.value)(0.0).abs() < 1e-12);
        }
    }
}
