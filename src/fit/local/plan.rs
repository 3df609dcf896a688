//! Where everything stands: patterns of the sparse matrices of a pass, and the domains that the
//! states are eliminated in.
//!
//! All segments have the same patterns, for they follow from the graph of couplings and two
//! distances alone.

use std::collections::HashMap;
use std::ops::Range;

use crate::dynamics::{Couplings, Dynamics, TangentPattern};
use crate::eval::NOWHERE;

/// Patterns of one pass.
pub(super) struct Plan {
    /// Columns that a row of a tangent has.
    pub(super) tangents: TangentPattern,
    /// Columns by theta and what they are of.
    pub(super) couplings: Couplings,
    /// How far a tangent reaches, in sites. Products of two are kept one site further.
    pub(super) reach: usize,
    /// How far from a domain its elimination of states looks.
    pub(super) halo: usize,
    /// Lower triangle of J_s' J_s: the states before each state, itself last.
    pub(super) normal: Rows,
    /// J_s' J_theta: of each piece the states that it has something in common with.
    pub(super) mixed: Rows,
    /// What is left for theta: of each piece those before it, itself last.
    pub(super) left: Rows,
    /// Of each site, what its rows add to which entries.
    pub(super) sites: Vec<SiteMaps>,
    pub(super) domains: Vec<Domain>,
}

/// Rows of a sparse matrix, each with its columns ascending.
pub(super) struct Rows {
    pub(super) columns: Vec<u32>,
    pub(super) starts: Vec<usize>,
}

impl Rows {
    fn of(rows: impl IntoIterator<Item = Vec<usize>>) -> Rows {
        let mut all = Rows { columns: Vec::new(), starts: vec![0] };
        for mut row in rows {
            row.sort_unstable();
            row.dedup();
            all.columns.extend(row.into_iter().map(|column| column as u32));
            all.starts.push(all.columns.len());
        }
        all
    }

    /// Entries of all rows.
    pub(super) fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Where a row stands.
    pub(super) fn row(&self, row: usize) -> Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }

    /// Where an entry stands, if it does.
    pub(super) fn place(&self, row: usize, column: usize) -> u32 {
        let range = self.row(row);
        let found = self.columns[range.clone()].binary_search(&(column as u32));
        found.map_or(NOWHERE, |at| (range.start + at) as u32)
    }
}

/// Products of the entries of a row with each other, by their places.
pub(super) struct SiteMaps {
    /// State columns of the rows, ascending; the pieces are behind them.
    pub(super) states: Vec<u32>,
    pub(super) pieces: Vec<u32>,
    /// Lower triangle of `[state][state]`, into that of J_s' J_s.
    pub(super) normal: Vec<u32>,
    /// `[state][piece]`, into J_s' J_theta.
    pub(super) mixed: Vec<u32>,
    /// Lower triangle of `[piece][piece]`, into that of what is left for theta.
    pub(super) left: Vec<u32>,
}

/// A part of the sites whose states are eliminated together with those around them.
pub(super) struct Domain {
    /// States of the domain and of its halo, the farthest first: what acts near to the domain is
    /// zero before the nearest of them.
    pub(super) states: Vec<u32>,
    /// Those of the domain itself.
    pub(super) own: Vec<OwnState>,
    /// Where the first state stands that one of its pieces has something in common with.
    pub(super) from: usize,
    /// Which are as far as the halo goes, and which one site less.
    pub(super) outermost: [Vec<u32>; 2],
    /// Pieces of the domain.
    pub(super) pieces: Vec<u32>,
    /// Lower triangle of J_s' J_s for these states, row after row: places in J_s' J_s.
    pub(super) normal: Vec<u32>,
    /// Pieces that have something in common with one of the domain's, ascending.
    pub(super) near: Vec<u32>,
    /// Of each of them, where the states of its row of J_s' J_theta stand among `states`.
    pub(super) places: Rows,
}

/// A state that a domain eliminates.
pub(super) struct OwnState {
    /// The state.
    pub(super) state: usize,
    /// Where it stands in the domain's `states`,
    pub(super) place: usize,
    /// and where the states do that its row of a tangent has.
    pub(super) row: Vec<u32>,
}

impl Plan {
    /// Patterns for couplings that act as far as `reach` and `halo`.
    pub(super) fn new(dynamics: &Dynamics, reach: usize, halo: usize) -> Plan {
        let couplings = dynamics.couplings();
        let tangents = TangentPattern::new(dynamics, &couplings, reach);
        let degrees = dynamics.degrees();
        let states_at = |site: usize| [site, degrees + site];
        let common = reach + 1;
        let halo = halo.max(common);
        let normal = Rows::of((0..2 * degrees).map(|state| {
            let near = couplings.around(&[state % degrees], common);
            let all = near.into_iter().flat_map(|(site, _)| states_at(site));
            all.filter(|&other| other <= state).collect()
        }));
        let mixed = Rows::of(couplings.pieces.iter().map(|piece| {
            let near = couplings.around(&piece.sites, common);
            near.into_iter().flat_map(|(site, _)| states_at(site)).collect()
        }));
        let mut of_site = vec![Vec::new(); degrees];
        for (at, piece) in couplings.pieces.iter().enumerate() {
            piece.sites.iter().for_each(|&site| of_site[site].push(at));
        }
        let left = Rows::of(couplings.pieces.iter().enumerate().map(|(at, piece)| {
            let near = couplings.around(&piece.sites, halo);
            let all = near.into_iter().flat_map(|(site, _)| of_site[site].iter().copied());
            all.filter(|&other| other <= at).collect()
        }));
        let sites = (0..degrees)
            .map(|site| {
                let columns: Vec<usize> =
                    tangents.columns[site].iter().map(|&(column, _)| column).collect();
                let states = columns.partition_point(|&column| column < 2 * degrees);
                let (states, pieces) = columns.split_at(states);
                let piece = |column: usize| column - 2 * degrees;
                let lower = |of: &[usize], place: &dyn Fn(usize, usize) -> u32| {
                    let rows = of.iter().enumerate();
                    rows.flat_map(|(i, &a)| of[..=i].iter().map(move |&b| place(a, b))).collect()
                };
                let (mixed, piece) = (&mixed, &piece);
                let products = |&state: &usize| {
                    pieces.iter().map(move |&column| mixed.place(piece(column), state))
                };
                SiteMaps {
                    states: states.iter().map(|&state| state as u32).collect(),
                    pieces: pieces.iter().map(|&column| piece(column) as u32).collect(),
                    normal: lower(states, &|a, b| normal.place(a, b)),
                    mixed: states.iter().flat_map(products).collect(),
                    left: lower(pieces, &|a, b| left.place(piece(a), piece(b))),
                }
            })
            .collect();
        let mut domains = domains(&couplings, &tangents, &normal, halo);
        domains.iter_mut().for_each(|domain| domain.look_around(&mixed, &left));
        Plan { tangents, couplings, reach, halo, normal, mixed, left, sites, domains }
    }
}

impl Domain {
    /// Finds the pieces near to those of the domain, and where their states stand in it.
    fn look_around(&mut self, mixed: &Rows, left: &Rows) {
        let of_piece = |&piece: &u32| left.columns[left.row(piece as usize)].iter().copied();
        self.near = self.pieces.iter().flat_map(of_piece).collect();
        self.near.sort_unstable();
        self.near.dedup();
        let known = places(&self.states);
        for &piece in &self.near {
            let states = &mixed.columns[mixed.row(piece as usize)];
            let places = states.iter().map(|state| known.get(state).copied().unwrap_or(NOWHERE));
            self.places.columns.extend(places);
            self.places.starts.push(self.places.columns.len());
        }
        let own = |piece: &u32| self.near.binary_search(piece).ok();
        let rows = self.pieces.iter().filter_map(own);
        let places = rows.flat_map(|at| &self.places.columns[self.places.row(at)]);
        let first = places.copied().filter(|&place| place != NOWHERE).min();
        self.from = first.map_or(self.states.len(), |place| place as usize);
    }
}

/// Where each of some states stands.
fn places(states: &[u32]) -> HashMap<u32, u32> {
    states.iter().enumerate().map(|(at, &state)| (state, at as u32)).collect()
}

/// Factorisation, and substitution for pieces and leverages, roughly: what acts near to the middle
/// of a domain begins behind most of its states.
fn cost(states: usize, own: usize, pieces: usize) -> f64 {
    let size = states as f64;
    size.powi(3) / 6.0 + size * size * (0.75 * pieces as f64 + 0.25 * own as f64)
}

/// Products for one transition by sparse algebra over those by the dense factor, roughly; known
/// before anything takes memory.
pub(super) fn share_of_dense(
    couplings: &Couplings,
    unknowns: usize,
    reach: usize,
    halo: usize,
) -> f64 {
    let degrees = couplings.neighbours.len();
    let mut acting = vec![0; degrees];
    couplings.pieces.iter().flat_map(|piece| &piece.sites).for_each(|&site| acting[site] += 1);
    let sparse: f64 = (0..degrees)
        .map(|site| {
            let near = couplings.around(&[site], reach);
            let states = 2.0 * near.len() as f64;
            let pieces: usize = near.iter().map(|&(site, _)| acting[site]).sum();
            // A piece that acts in two sites is counted twice there.
            let pieces = 0.5 * pieces as f64;
            let wide = 2.0 * couplings.around(&[site], halo.max(reach + 1)).len() as f64;
            let own = 0.5 * acting[site] as f64 + 3.0;
            2.0 * (0.5 * states * states + states * pieces + 0.5 * pieces * pieces)
                + wide.powi(3) / (6.0 * TOGETHER)
                + wide * wide * own
        })
        .sum();
    let (states, unknowns) = (2.0 * degrees as f64, unknowns as f64);
    let eliminated = 2.0 * 2.0 * states * states * (0.5 * states + unknowns);
    let factor = 2.0 * states * unknowns * unknowns;
    sparse / (eliminated + factor)
}

/// Sites whose domains are factorised together, as a rule.
const TOGETHER: f64 = 4.0;

/// Domains that cost least among some sizes.
fn domains(
    couplings: &Couplings,
    tangents: &TangentPattern,
    normal: &Rows,
    halo: usize,
) -> Vec<Domain> {
    let degrees = couplings.neighbours.len();
    let mut of_site = vec![Vec::new(); degrees];
    for (at, piece) in couplings.pieces.iter().enumerate() {
        of_site[piece.sites[0]].push(at as u32);
    }
    let cut = |size: usize| {
        let mut taken = vec![false; degrees];
        let mut parts: Vec<Vec<usize>> = Vec::new();
        for first in 0..degrees {
            if taken[first] {
                continue;
            }
            let near = couplings.around(&[first], size);
            let free = near.into_iter().map(|(site, _)| site).filter(|&site| !taken[site]);
            let part: Vec<usize> = free.take(size).collect();
            part.iter().for_each(|&site| taken[site] = true);
            parts.push(part);
        }
        parts
    };
    let cost_of = |parts: &[Vec<usize>]| -> f64 {
        let of = |part: &Vec<usize>| {
            let pieces = part.iter().map(|&site| of_site[site].len()).sum();
            cost(2 * couplings.around(part, halo).len(), 2 * part.len(), pieces)
        };
        parts.iter().map(of).sum()
    };
    let sizes = [1, 2, 3, 4, 6, 8, 12, 16, 24, 32];
    let tried = sizes.into_iter().map(cut).map(|parts| (cost_of(&parts), parts));
    let best = tried.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, parts)| parts);
    let domain = |part: Vec<usize>| {
        let near = couplings.around(&part, halo);
        let mut states: Vec<(usize, usize)> =
            near.iter().flat_map(|&(s, d)| [(s, d), (degrees + s, d)]).collect();
        states.sort_unstable_by_key(|&(state, distance)| (std::cmp::Reverse(distance), state));
        let ring = |wanted: usize| {
            let all = states.iter().enumerate().filter(|(_, (_, distance))| *distance == wanted);
            all.map(|(at, _)| at as u32).collect::<Vec<u32>>()
        };
        let outermost = [ring(halo), ring(halo.saturating_sub(1))];
        let inner = ring(0);
        let states: Vec<u32> = states.iter().map(|&(state, _)| state as u32).collect();
        let known = places(&states);
        let own = inner.iter().map(|&place| {
            let state = states[place as usize] as usize;
            let columns = tangents.columns[state % degrees].iter();
            let columns = columns.take_while(|(column, _)| *column < 2 * degrees);
            let place_of = |(column, _): &(usize, usize)| known.get(&(*column as u32));
            let row = columns.map(|column| place_of(column).copied().unwrap_or(NOWHERE)).collect();
            OwnState { state, place: place as usize, row }
        });
        let own = own.collect();
        let entries = states.iter().enumerate().flat_map(|(i, &a)| {
            states[..=i].iter().map(move |&b| normal.place(a.max(b) as usize, a.min(b) as usize))
        });
        let pieces = part.iter().flat_map(|&site| of_site[site].iter().copied()).collect();
        let (normal, near, places) = (entries.collect(), Vec::new(), Rows::of([]));
        Domain { normal, states, own, from: 0, outermost, pieces, near, places }
    };
    best.unwrap_or_default().into_iter().map(domain).collect()
}
