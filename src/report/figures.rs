//! The report's figures, for programs.

use super::plots::{Medium, PLOTS, PlotData, draw};
use crate::diagnose;
use crate::diagnose::comparison::Compared;
use crate::diagnose::comparison::view::view;
use crate::error::Result;
use crate::facade::{Data, Diagnosis, Law};

/// A figure of the report.
///
/// ```
/// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
/// let (training, held_out) = spec.data()?.split(0.25, 0)?;
/// let figures = spec.fit(&training)?.figures(&training, &held_out, None)?;
/// let horizons = figures.iter().find(|figure| figure.plot == "horizons").unwrap();
/// assert!(horizons.svg.starts_with("<svg"));
/// # Ok::<(), leverrier::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Drawing {
    /// The kind of plot: `horizons`, `predictions`, `forces`, `force-map`, `portrait`, `energy`,
    /// `path`, `front` or `ranking`; there may be several of a kind.
    pub plot: &'static str,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it, and what stands out, in sentences.
    pub caption: String,
    /// The figure as a file of its own, light or dark as the reader prefers.
    pub svg: String,
}

impl Law {
    /// The figures of the report: the law on the measurements that it was learned from and
    /// on held-out ones, how its terms were found and, with a diagnosis, what could be missing.
    ///
    /// # Errors
    /// As [`Law::compare_held_out`]; the measurements are too few to show what they leave.
    ///
    /// ```
    /// let spec = leverrier::Spec::open("examples/damped-pendulum/fit.ham")?;
    /// let (training, held_out) = spec.data()?.split(0.25, 0)?;
    /// let law = spec.fit(&training)?;
    /// let diagnosis = law.diagnose(&training, &held_out)?;
    /// let figures = law.figures(&training, &held_out, Some(&diagnosis))?;
    /// assert!(figures.iter().any(|figure| figure.plot == "ranking"));
    /// # Ok::<(), leverrier::Error>(())
    /// ```
    pub fn figures(
        &self,
        training: &Data,
        held_out: &Data,
        diagnosis: Option<&Diagnosis>,
    ) -> Result<Vec<Drawing>> {
        training.require(self.spec())?;
        held_out.require(self.spec())?;
        let model = &self.fitted("draw")?.model;
        let options = diagnose::Options::default();
        let unseen = (held_out.runs() > 0).then(|| held_out.dataset());
        let law = self.numbers().clone();
        let compared = Compared::new(law, training.dataset(), unseen, &options, None)?;
        let view = view(&compared.training, compared.held_out.as_ref())?;
        let material = PlotData {
            view: &view,
            comparison: &compared.comparison,
            model,
            diagnosis: diagnosis.map(Diagnosis::found),
            history: &[],
        };
        let of_plot = |plot: &'static super::plots::Plot| {
            (plot.figures)(&material).into_iter().map(|figure| Drawing {
                plot: plot.name,
                svg: draw(&figure, Medium::File),
                title: figure.title,
                caption: figure.caption,
            })
        };
        Ok(PLOTS.iter().flat_map(of_plot).collect())
    }
}
