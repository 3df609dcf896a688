//! Why the numbers of a model may not be what they look like, in sentences.

use serde_json::{Value, json};

use crate::fit::{Model, Warning};
use crate::simplify::{significant, uncertain};

/// A warning for people, with what to do about it.
pub fn sentence(warning: &Warning) -> String {
    match warning {
        Warning::AtBound { name, value } => format!(
            "`{name}` ended at its bound, {}: the data pull it further, and the other numbers make \
             up for that. Widen the bound, or ask what the law lacks.",
            significant(*value, 4)
        ),
        Warning::NegativeMass { coordinate } => format!(
            "{coordinate} has a negative mass: it moves against its momentum. No such body exists; \
             bound the coefficient, or take terms out that the data do not tell apart."
        ),
        Warning::FeedsEnergy { term, coordinate, coefficient, standard_error } => format!(
            "The force {term} on {coordinate} feeds energy into the motion, for its coefficient is \
             {}: no drag or friction does. Something else is missing, or bound the coefficient.",
            uncertain(*coefficient, *standard_error, 10)
        ),
        Warning::FollowsBriefly { samples, time, period, numbers_from } => {
            let periods = period.map_or(String::new(), |period| {
                format!(", {} of a period of the fastest motion", significant(time / period, 2))
            });
            let numbers = match numbers_from > samples {
                true => format!(
                    "The numbers are from segments of {numbers_from} samples, which determine \
                     them better; their errors count what the law leaves there."
                ),
                false => "Longer ones do not determine its numbers better.".to_string(),
            };
            format!(
                "The law follows the measurements within their noise over {samples} samples \
                 only{periods}: it lacks something. {numbers}"
            )
        }
        Warning::WindowsDisagree { name, short, long } => format!(
            "`{name}` is {} from segments of {} samples and {} from segments of {}: what the law \
             lacks goes into the number. That from the longer ones counts.",
            uncertain(short.value, short.standard_error, 10),
            short.samples,
            uncertain(long.value, long.standard_error, 10),
            long.samples
        ),
        Warning::NotWhite { observable, correlation } => format!(
            "What the law leaves of {observable} is no noise: from one sample to the next it is \
             the same to {} (correlation). Ask `leverrier diagnose` what is missing.",
            significant(*correlation, 2)
        ),
        Warning::OneRun { run, error } => format!(
            "Run {run} leaves {} times what the others leave: the noise of all together hides \
             that the law fails there.",
            significant(*error, 2)
        ),
    }
}

/// The warnings of a model for programs, each with its sentence.
pub(super) fn to_json(model: &Model) -> Value {
    let with_sentence = |warning: &Warning| {
        let mut object = json!(warning);
        if let Some(fields) = object.as_object_mut() {
            fields.insert("sentence".to_string(), json!(sentence(warning)));
        }
        object
    };
    model.warnings.iter().map(with_sentence).collect()
}
