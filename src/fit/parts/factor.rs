//! What the pass of a part leaves, as bytes.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::super::factor::Factor;
use super::super::pass::{FoldResult, Sums};
use super::super::stream::{Asked, Passed};
use super::request::PassRequest;
use crate::data::{MOST, Sealed};
use crate::error::{Error, ErrorKind, Result};

/// Unknowns of a factor, and folds, at most.
const LARGEST: usize = 1 << 15;

/// What the pass of a part leaves, or of several that follow each other: for each fold of the data
/// the triangular factor of its residuals and their sums.
///
/// Its size depends on the number of unknowns and not on that of the samples.
///
/// ```
/// use leverrier::{Engine, LocalParts, Options, Part, PartPlace, PartSampling, PartSurvey};
/// use leverrier::{PassFactor, PassRequest, Result, Silent, Spec};
///
/// /// Tells how large the factors are.
/// struct Told(LocalParts);
///
/// impl Engine for Told {
///     fn survey(&self, of: PartSampling, watch: &dyn Fn(f64) -> bool) -> Result<PartSurvey> {
///         self.0.survey(of, watch)
///     }
///
///     fn pass(
///         &self,
///         request: &PassRequest,
///         places: &[PartPlace],
///         watch: &dyn Fn(f64) -> bool,
///     ) -> Result<PassFactor> {
///         let factor = self.0.pass(request, places, watch)?;
///         let bytes = factor.to_bytes()?;
///         assert!(bytes.len() < 20_000);
///         assert_eq!(PassFactor::from_bytes(&bytes)?, factor);
///         Ok(factor)
///     }
/// }
///
/// let spec = Spec::open("examples/damped-pendulum/fit.ham")?;
/// let file = Part::File("examples/damped-pendulum/swings.csv".into());
/// let engine = Told(LocalParts::new(&spec, vec![file]));
/// let (law, _) = spec.fit_parts(&engine, &Options::default(), &Silent)?;
/// assert_eq!(law.terms().len(), 1);
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PassFactor {
    /// Of the request.
    mark: [u8; 16],
    /// Number of the first part, and how many there are.
    first: u32,
    parts: u32,
    unknowns: u32,
    folds: Vec<Fold>,
    segments: u64,
    transitions: u64,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Fold {
    /// The upper triangle, column after column.
    triangle: Vec<f64>,
    /// Residuals that went into it.
    rows: u64,
    sums: Sums,
}

impl Fold {
    fn of(result: &FoldResult) -> Fold {
        let full = result.factor.triangle();
        let columns = full.column_iter().enumerate();
        let triangle = columns.flat_map(|(k, column)| column.as_slice()[..=k].to_vec()).collect();
        Fold { triangle, rows: result.factor.rows() as u64, sums: result.sums.clone() }
    }

    fn result(self, unknowns: usize) -> FoldResult {
        let width = unknowns + 1;
        let mut full = DMatrix::zeros(width, width);
        let mut start = 0;
        for k in 0..width {
            full.view_mut((0, k), (k + 1, 1)).copy_from_slice(&self.triangle[start..=start + k]);
            start += k + 1;
        }
        let factor = Factor::of_triangle(full, self.rows as usize);
        FoldResult { factor, sums: self.sums, responses: None }
    }
}

impl PassFactor {
    pub(super) fn of(passed: Passed, mark: [u8; 16], part: u32) -> PassFactor {
        let Passed { folds, segments, transitions } = passed;
        let unknowns = folds.first().map_or(0, |fold| fold.factor.columns()) as u32;
        let folds = folds.iter().map(Fold::of).collect();
        PassFactor { mark, first: part, parts: 1, unknowns, folds, segments, transitions }
    }

    /// What `asked` gets, if this is what all of so many parts leave of its request.
    pub(super) fn passed(
        self,
        asked: &Asked,
        request: &PassRequest,
        parts: usize,
    ) -> Result<Passed> {
        if self.mark != request.mark()? {
            return Err(unlike("are of another request"));
        }
        if self.first != 0 || self.parts as usize != parts {
            return Err(unlike("are not of all parts"));
        }
        let observables = asked.problem.weights.len();
        let unknowns = asked.by.0.unknowns();
        if self.unknowns as usize != unknowns
            || self.folds.len() != asked.problem.tuning.segments.folds
            || self.folds.iter().any(|fold| fold.sums.squares.len() != observables)
        {
            return Err(unlike("are of another function space"));
        }
        let PassFactor { folds, segments, transitions, .. } = self;
        let folds = folds.into_iter().map(|fold| fold.result(unknowns)).collect();
        Ok(Passed { folds, segments, transitions })
    }

    /// How many transitions went in.
    ///
    /// ```
    /// fn told(factor: &leverrier::PassFactor) -> String {
    ///     format!("{} transitions of {} parts", factor.transitions(), factor.parts())
    /// }
    /// ```
    pub fn transitions(&self) -> u64 {
        self.transitions
    }

    /// How many unknowns it has: terms, then inner parameters.
    ///
    /// ```
    /// fn size(factor: &leverrier::PassFactor) -> usize {
    ///     (factor.unknowns() + 1) * (factor.unknowns() + 2) / 2
    /// }
    /// ```
    pub fn unknowns(&self) -> usize {
        self.unknowns as usize
    }

    /// The sum of squared weighted residuals after a change of the unknowns, as the linearised
    /// problem has it; none where the change has not a number for each of them.
    ///
    /// ```
    /// fn left(factor: &leverrier::PassFactor) -> Option<f64> {
    ///     factor.squares(&vec![0.0; factor.unknowns()])
    /// }
    /// ```
    pub fn squares(&self, change: &[f64]) -> Option<f64> {
        let unknowns = self.unknowns();
        let change = nalgebra::DVector::from_column_slice(change);
        let of = |fold: Fold| fold.result(unknowns).factor.squares(&change);
        (change.len() == unknowns).then(|| self.folds.iter().cloned().map(of).sum())
    }

    /// How many parts it is of.
    ///
    /// ```
    /// fn told(factor: &leverrier::PassFactor) -> String {
    ///     format!("{} transitions of {} parts", factor.transitions(), factor.parts())
    /// }
    /// ```
    pub fn parts(&self) -> usize {
        self.parts as usize
    }

    /// What both leave, of which `next` is of the parts that follow.
    ///
    /// # Errors
    /// They are not neighbours, or not of the same request ([`ErrorKind::InvalidArgument`]).
    ///
    /// ```
    /// use leverrier::{PassFactor, Result};
    ///
    /// fn both(first: PassFactor, second: PassFactor) -> Result<PassFactor> {
    ///     first.merge(second)
    /// }
    /// ```
    pub fn merge(self, next: PassFactor) -> Result<PassFactor> {
        let observables =
            |factor: &PassFactor| factor.folds.first().map(|fold| fold.sums.squares.len());
        if self.mark != next.mark
            || self.unknowns != next.unknowns
            || self.folds.len() != next.folds.len()
            || observables(&self) != observables(&next)
        {
            return Err(unlike("are of different requests"));
        }
        if self.first.checked_add(self.parts) != Some(next.first) {
            return Err(unlike("are of parts that do not follow each other"));
        }
        let unknowns = self.unknowns as usize;
        let mut folds = Vec::with_capacity(self.folds.len());
        for (one, other) in self.folds.into_iter().zip(next.folds) {
            let both = vec![one.result(unknowns), other.result(unknowns)];
            folds.extend(FoldResult::together(both).as_ref().map(Fold::of));
        }
        Ok(PassFactor {
            parts: self.parts.saturating_add(next.parts),
            folds,
            segments: self.segments.saturating_add(next.segments),
            transitions: self.transitions.saturating_add(next.transitions),
            ..self
        })
    }

    /// The bytes that [`PassFactor::from_bytes`] reads: `docs/formats.md`.
    ///
    /// # Errors
    /// None that is known.
    ///
    /// ```
    /// fn sent(factor: &leverrier::PassFactor) -> leverrier::Result<Vec<u8>> {
    ///     factor.to_bytes()
    /// }
    /// ```
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        self.sealed()
    }

    /// What [`PassFactor::to_bytes`] wrote.
    ///
    /// # Errors
    /// The bytes are of another kind or version, or damaged ([`ErrorKind::Model`]).
    ///
    /// ```
    /// let error = leverrier::PassFactor::from_bytes(b"LVpf, and something else").unwrap_err();
    /// assert_eq!(error.kind(), leverrier::ErrorKind::Model);
    /// ```
    pub fn from_bytes(bytes: &[u8]) -> Result<PassFactor> {
        PassFactor::unsealed(bytes)
    }
}

fn unlike(what: &str) -> Error {
    Error::new(
        ErrorKind::InvalidArgument,
        format!("these factors {what}"),
        "pass over every part once with the same request, each at its own place",
    )
}

impl Sealed for PassFactor {
    const MARK: &'static [u8; 4] = b"LVpf";
    const WHAT: &'static str = "factor of a pass";

    fn checked(&self) -> std::result::Result<(), &'static str> {
        let unknowns = self.unknowns as usize;
        if unknowns > LARGEST || self.folds.is_empty() || self.folds.len() > LARGEST {
            return Err("they have too many unknowns, or no fold");
        }
        if self.parts == 0 || self.segments > MOST || self.transitions > MOST {
            return Err("their counts contradict each other");
        }
        let size = (unknowns + 1) * (unknowns + 2) / 2;
        let observables = self.folds.first().map_or(0, |fold| fold.sums.squares.len());
        for Fold { triangle, rows, sums } in &self.folds {
            let counts = [sums.diverged, sums.unsettled, sums.rows].map(|count| count as u64);
            if *rows > MOST || counts.into_iter().any(|count| count > MOST) {
                return Err("their counts contradict each other");
            }
            if triangle.len() != size {
                return Err("their triangles have not the size that they say");
            }
            if triangle.iter().any(|x| !x.is_finite()) {
                return Err("their triangles hold what is not a number");
            }
            if sums.squares.len() != observables || sums.freedom.len() != observables {
                return Err("their sums are not as many as the observables");
            }
        }
        Ok(())
    }
}
