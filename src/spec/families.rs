//! Families of basis functions: one row each.
//!
//! A family is expanded into [`Member`]s, which know nothing of what their variables are.

/// One function of a family.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Member {
    /// Product of variable ^ exponent, by the variable's place; no exponent is 0.
    Monomial(Vec<(usize, u32)>),
    /// wave(harmonic * variable).
    Harmonic {
        /// The function.
        wave: Wave,
        /// Place of the variable.
        variable: usize,
        /// Whole factor of the variable, from 1 on.
        harmonic: u32,
    },
}

/// A function of a Fourier series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Wave {
    Sine,
    Cosine,
}

/// A family of functions of `n` variables up to an order `d`.
pub struct FamilyRow {
    /// Its name in the mini-language.
    pub name: &'static str,
    /// How it is written.
    pub signature: &'static str,
    /// What it holds, in one sentence.
    pub doc: &'static str,
    /// How many members it has for n variables at order d; counted without memory.
    pub size: fn(n: u64, d: u64) -> u128,
    /// Its members, by degree, then with earlier variables first.
    pub members: fn(n: usize, d: u32) -> Vec<Member>,
    /// Whether its variables must be pure numbers (angles).
    pub needs_number: bool,
}

/// Every family. A new one is one row here.
pub static FAMILIES: &[FamilyRow] = &[
    FamilyRow {
        name: "poly",
        signature: "poly(variables; degree)",
        doc: "every monomial up to a total degree, without the constant",
        size: |n, d| binomial(n.saturating_add(d), n.min(d)).saturating_sub(1),
        members: |n, d| (1..=d).flat_map(|degree| monomials(n, degree, degree)).collect(),
        needs_number: false,
    },
    FamilyRow {
        name: "tensor",
        signature: "tensor(variables; degree)",
        doc: "every monomial up to a degree in each variable, without the constant",
        size: |n, d| power(u128::from(d).saturating_add(1), n).saturating_sub(1),
        members: |n, d| {
            let top = d.saturating_mul(u32::try_from(n).unwrap_or(u32::MAX));
            (1..=top).flat_map(|degree| monomials(n, degree, d)).collect()
        },
        needs_number: false,
    },
    FamilyRow {
        name: "pairs",
        signature: "pairs(variables; degree)",
        doc: "powers up to a degree of each variable and products of such powers of two variables",
        size: |n, d| {
            let (n, d) = (u128::from(n), u128::from(d));
            let singles = n.saturating_mul(d);
            let couples = n.saturating_mul(n.saturating_sub(1)) / 2;
            singles.saturating_add(couples.saturating_mul(d).saturating_mul(d))
        },
        members: pairs,
        needs_number: false,
    },
    FamilyRow {
        name: "trig",
        signature: "trig(variables; harmonics)",
        doc: "sin(k x) and cos(k x) of each variable for k from 1 to the number of harmonics",
        size: |n, d| u128::from(n).saturating_mul(2).saturating_mul(u128::from(d)),
        members: |n, d| {
            let of = |harmonic| {
                (0..n).flat_map(move |variable| {
                    [Wave::Sine, Wave::Cosine].map(|wave| Member::Harmonic {
                        wave,
                        variable,
                        harmonic,
                    })
                })
            };
            (1..=d).flat_map(of).collect()
        },
        needs_number: true,
    },
];

/// Looks a family up by its name.
pub fn by_name(name: &str) -> Option<&'static FamilyRow> {
    FAMILIES.iter().find(|row| row.name == name)
}

/// n over k, or the largest number there is.
fn binomial(n: u64, k: u64) -> u128 {
    let mut result: u128 = 1;
    for i in 1..=k.min(n) {
        result = match result.checked_mul(u128::from(n - k + i)) {
            Some(product) => product / u128::from(i),
            None => return u128::MAX,
        };
    }
    result
}

fn power(base: u128, exponent: u64) -> u128 {
    if base <= 1 {
        return base;
    }
    u32::try_from(exponent).ok().and_then(|e| base.checked_pow(e)).unwrap_or(u128::MAX)
}

/// Monomials of one total degree with no exponent above `most`, earlier variables first.
fn monomials(n: usize, degree: u32, most: u32) -> Vec<Member> {
    let mut out = Vec::new();
    let mut current = Vec::new();
    extend(&mut out, &mut current, 0, n, degree, most);
    out
}

fn extend(
    out: &mut Vec<Member>,
    current: &mut Vec<(usize, u32)>,
    variable: usize,
    n: usize,
    left: u32,
    most: u32,
) {
    if left == 0 {
        out.push(Member::Monomial(current.clone()));
        return;
    }
    // Variables that cannot take up what is left end the branch.
    let room = u64::from(most) * (n - variable) as u64;
    if variable == n || room < u64::from(left) {
        return;
    }
    for exponent in (0..=left.min(most)).rev() {
        if exponent > 0 {
            current.push((variable, exponent));
        }
        extend(out, current, variable + 1, n, left - exponent, most);
        if exponent > 0 {
            current.pop();
        }
    }
}

fn pairs(n: usize, d: u32) -> Vec<Member> {
    let mut out = Vec::new();
    for degree in 1..=d.saturating_mul(2) {
        for i in 0..n {
            if degree <= d {
                out.push(Member::Monomial(vec![(i, degree)]));
            }
            for j in i + 1..n {
                for a in (1..degree).rev().filter(|&a| a <= d && degree - a <= d) {
                    out.push(Member::Monomial(vec![(i, a), (j, degree - a)]));
                }
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_family_has_the_size_it_announces_and_no_member_twice() {
        for row in FAMILIES {
            for n in 0..5_usize {
                for d in 1..5_u32 {
                    let members = (row.members)(n, d);
                    let size = (row.size)(n as u64, u64::from(d));
                    assert_eq!(members.len() as u128, size, "{} n={n} d={d}", row.name);
                    let distinct: HashSet<String> =
                        members.iter().map(|member| format!("{member:?}")).collect();
                    assert_eq!(distinct.len(), members.len(), "{} n={n} d={d}", row.name);
                }
            }
        }
    }

    #[test]
    fn sizes_of_the_papers_spaces() {
        let size = |name: &str, n, d| by_name(name).map(|row| (row.size)(n, d));
        assert_eq!(size("tensor", 2, 10), Some(120));
        assert_eq!(size("pairs", 5, 2), Some(50));
        assert_eq!(size("poly", 1, 5), Some(5));
    }

    #[test]
    fn huge_sizes_are_counted_without_memory() {
        for row in FAMILIES {
            assert!((row.size)(1000, u64::from(u32::MAX)) > 1_000_000, "{}", row.name);
        }
    }

    #[test]
    fn order_is_by_degree_then_earlier_variables_first() {
        let poly = by_name("poly").map(|row| (row.members)(2, 2));
        let expected =
            [vec![(0, 1)], vec![(1, 1)], vec![(0, 2)], vec![(0, 1), (1, 1)], vec![(1, 2)]];
        assert_eq!(poly, Some(expected.into_iter().map(Member::Monomial).collect()));
    }
}
