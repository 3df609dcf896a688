//! The mini-language: text to syntax tree and back.

pub mod ast;
mod bodies;
pub mod edit;
pub mod effects;
mod expand;
pub mod families;
mod gain;
mod holonomic;
mod integer;
mod lagrangian;
mod parse;
mod print;
pub(crate) mod resolve;

pub(crate) use expand::{MOST_CANDIDATES, expand, scene_of};
pub use parse::{expression, may_name, spec};

/// The candidate that a mistyped word is most likely to mean, if one is near.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| (strsim::damerau_levenshtein(word, candidate), candidate))
        .filter(|&(distance, candidate)| {
            let longest = word.chars().count().max(candidate.chars().count());
            distance * 3 < longest.max(4)
        })
        .min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}
