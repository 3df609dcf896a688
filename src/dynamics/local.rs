//! Tangents of systems whose couplings are local: of every row only the columns near to it.
//!
//! The graph of couplings has the coordinates as its sites; two are neighbours where a force on
//! one, or its velocity, depends on the other. Over a short time a state follows the start of far
//! sites, and the terms that act there, by next to nothing: how far is looked up, not assumed.

use super::batch::{Batch, Scratch};
use super::equations::Dynamics;
use super::flow::Flow;
use super::methods::{Method, MethodKind};
use super::splitting::{rescale, stages};
use crate::eval::{Eight, InstructionSet, add_carrying, add_multiples};

/// Trajectories that move together: their tangents fill a register.
pub(crate) const LANES: usize = size_of::<Eight>() / size_of::<f64>();

/// The graph of couplings of equations of motion, and where their unknowns act.
pub(crate) struct Couplings {
    /// Of every site its neighbours, ascending.
    pub(crate) neighbours: Vec<Vec<usize>>,
    /// Columns by theta. An unknown that acts in many places has one for each of them; they add up.
    pub(crate) pieces: Vec<Piece>,
}

/// What an unknown does in one place.
pub(crate) struct Piece {
    /// The unknown, by its place in theta.
    pub(crate) unknown: usize,
    /// Sites whose equations name it, ascending.
    pub(crate) sites: Vec<usize>,
}

impl Couplings {
    /// Sites with their distances from the nearest of some, as far as `reach`, nearest first.
    pub(crate) fn around(&self, sites: &[usize], reach: usize) -> Vec<(usize, usize)> {
        let mut found: Vec<(usize, usize)> = sites.iter().map(|&site| (site, 0)).collect();
        let mut seen: std::collections::HashSet<usize> = sites.iter().copied().collect();
        let mut next = 0;
        while let Some(&(site, distance)) = found.get(next) {
            next += 1;
            if distance == reach {
                break;
            }
            for &neighbour in &self.neighbours[site] {
                if seen.insert(neighbour) {
                    found.push((neighbour, distance + 1));
                }
            }
        }
        found
    }
}

impl Dynamics {
    /// The graph of couplings, for equations that separate.
    pub(crate) fn couplings(&self) -> Couplings {
        let degrees = self.degrees();
        let mut neighbours = vec![Vec::new(); degrees];
        let mut acts = vec![Vec::new(); self.unknowns()];
        for flow in [self.kick(), self.drift()] {
            for &(row, from) in &flow.jacobian {
                let from = from % degrees;
                if row != from {
                    neighbours[row].push(from);
                    neighbours[from].push(row);
                }
            }
            flow.mixed.iter().for_each(|&(row, unknown)| acts[unknown].push(row));
        }
        for list in neighbours.iter_mut().chain(&mut acts) {
            list.sort_unstable();
            list.dedup();
        }
        let mut pieces = Vec::new();
        for (unknown, sites) in acts.into_iter().enumerate() {
            let near = |site: &usize| *site == sites[0] || neighbours[sites[0]].contains(site);
            if sites.iter().all(near) && sites.len() <= MOST_SITES {
                pieces.extend((!sites.is_empty()).then_some(Piece { unknown, sites }));
            } else {
                pieces.extend(sites.iter().map(|&site| Piece { unknown, sites: vec![site] }));
            }
        }
        Couplings { neighbours, pieces }
    }
}

/// Sites of one piece, at most.
const MOST_SITES: usize = 8;

/// Which columns each row of a tangent has.
pub(crate) struct TangentPattern {
    degrees: usize,
    /// Of every site the columns that its two rows have, ascending: those of the state, then the
    /// pieces, with the distance of each.
    pub(crate) columns: Vec<Vec<(usize, usize)>>,
    /// Where the row of each coordinate begins; those of the momenta are as long, and follow.
    starts: Vec<usize>,
    kick: Pushes,
    drift: Pushes,
}

/// What goes where when a flow moves tangents.
struct Pushes {
    /// Of each entry of the Jacobian the places (target, source) in their halves.
    pairs: Vec<Vec<(u32, u32)>>,
    /// Of each mixed entry its place in the half that moves.
    mixed: Vec<u32>,
}

impl TangentPattern {
    /// Rows with all columns as far as `reach`.
    pub(crate) fn new(dynamics: &Dynamics, couplings: &Couplings, reach: usize) -> TangentPattern {
        let degrees = dynamics.degrees();
        let mut of_site = vec![Vec::new(); degrees];
        for (at, piece) in couplings.pieces.iter().enumerate() {
            for (site, distance) in couplings.around(&piece.sites, reach) {
                of_site[site].push((2 * degrees + at, distance));
            }
        }
        let mut columns = Vec::with_capacity(degrees);
        for (site, pieces) in of_site.into_iter().enumerate() {
            let near = couplings.around(&[site], reach);
            let mut all: Vec<(usize, usize)> =
                near.iter().flat_map(|&(s, d)| [(s, d), (degrees + s, d)]).collect();
            all.extend(pieces);
            all.sort_unstable();
            columns.push(all);
        }
        let mut starts = vec![0];
        for list in &columns {
            starts.push(starts[starts.len() - 1] + list.len());
        }
        let mut pattern = TangentPattern {
            degrees,
            columns,
            starts,
            kick: Pushes { pairs: Vec::new(), mixed: Vec::new() },
            drift: Pushes { pairs: Vec::new(), mixed: Vec::new() },
        };
        let mut piece_of = std::collections::HashMap::new();
        for (at, piece) in couplings.pieces.iter().enumerate() {
            piece.sites.iter().for_each(|&site| {
                piece_of.insert((site, piece.unknown), 2 * degrees + at);
            });
        }
        pattern.kick = pattern.pushes(dynamics.kick(), &piece_of);
        pattern.drift = pattern.pushes(dynamics.drift(), &piece_of);
        pattern
    }

    /// Where a column stands in the rows of a site.
    pub(crate) fn place(&self, site: usize, column: usize) -> Option<usize> {
        self.columns[site].binary_search_by_key(&column, |&(column, _)| column).ok()
    }

    fn pushes(
        &self,
        flow: &Flow,
        piece_of: &std::collections::HashMap<(usize, usize), usize>,
    ) -> Pushes {
        let pairs = |&(row, from): &(usize, usize)| {
            let from = from % self.degrees;
            let (a, b) = (self.starts[row], self.starts[from]);
            let source = self.columns[from].iter().enumerate();
            let pair = |(at, &(column, _)): (usize, &(usize, usize))| {
                Some(((a + self.place(row, column)?) as u32, (b + at) as u32))
            };
            source.filter_map(pair).collect()
        };
        let mixed = |&(row, unknown): &(usize, usize)| {
            let place = piece_of.get(&(row, unknown)).and_then(|&column| self.place(row, column));
            (self.starts[row] + place.unwrap_or(0)) as u32
        };
        Pushes {
            pairs: flow.jacobian.iter().map(pairs).collect(),
            mixed: flow.mixed.iter().map(mixed).collect(),
        }
    }

    /// Entries of half of the rows.
    pub(crate) fn half(&self) -> usize {
        self.starts[self.degrees]
    }

    /// Tangents at the start: the identity.
    pub(crate) fn identity(&self, tangents: &mut Vec<Eight>) {
        tangents.clear();
        tangents.resize(2 * self.half(), Eight::ZERO);
        for row in 0..2 * self.degrees {
            let range = self.row(row);
            if let Some(place) = self.place(row % self.degrees, row) {
                tangents[range.start + place] = Eight::all(1.0);
            }
        }
    }

    /// Where a row stands, `[2n]`.
    pub(crate) fn row(&self, row: usize) -> std::ops::Range<usize> {
        let (half, site) = (row / self.degrees * self.half(), row % self.degrees);
        half + self.starts[site]..half + self.starts[site + 1]
    }

    /// Moves trajectories with tangents of this pattern, [`LANES`] of them, as
    /// [`advance`](super::advance) does; the method is a splitting.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn advance(
        &self,
        dynamics: &Dynamics,
        method: Method,
        (batch, tangents): (&mut Batch, &mut [Eight]),
        span: &[f64],
        steps: usize,
        theta: &[f64],
        scratch: &mut Scratch,
    ) {
        let MethodKind::Splitting(gammas) = &method.row().kind else {
            batch.state.fill(f64::NAN);
            return;
        };
        scratch.drive.clone_from(&batch.drive);
        scratch.step.clear();
        scratch.step.extend(span.iter().map(|span| span / steps as f64));
        scratch.carry.clear();
        scratch.carry.resize(batch.state.len(), 0.0);
        scratch.again.iter_mut().for_each(Vec::clear);
        let set = InstructionSet::widest();
        let half = self.degrees * LANES;
        for stage in stages(gammas, steps) {
            let (flow, pushes) = match stage.drift {
                true => (dynamics.drift(), &self.drift),
                false => (dynamics.kick(), &self.kick),
            };
            stage.prepare(&batch.time, flow.timed(), scratch);
            let part = usize::from(stage.drift);
            std::mem::swap(&mut scratch.workspace, &mut scratch.again[part]);
            flow.evaluate_again(&batch.state, LANES, theta, true, scratch);
            std::mem::swap(&mut scratch.workspace, &mut scratch.again[part]);
            let Scratch { out, scale, carry, .. } = scratch;
            let out = &mut out[..flow.outputs() * LANES];
            let moving = if stage.drift { 0..half } else { half..2 * half };
            let (state, carry) = (&mut batch.state[moving.clone()], &mut carry[moving]);
            add_carrying(set, state, carry, &out[..half], scale);
            rescale(out, scale);
            let (entries, _) = out[half..].as_chunks::<LANES>();
            let (q, p) = tangents.split_at_mut(self.half());
            let (target, source) = if stage.drift { (q, &*p) } else { (p, &*q) };
            for (pairs, entry) in pushes.pairs.iter().zip(entries) {
                add_multiples(set, target, source, pairs, &Eight(*entry));
            }
            let mixed = &entries[flow.jacobian.len()..];
            for (&place, entry) in pushes.mixed.iter().zip(mixed) {
                let into = &mut target[place as usize].0;
                into.iter_mut().zip(entry).for_each(|(x, entry)| *x += entry);
            }
        }
        batch.time.iter_mut().zip(span).for_each(|(time, span)| *time += span);
        batch.drive.go_on(span);
    }
}
