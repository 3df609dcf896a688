//! Motion across switching surfaces: each crossing at its own time, and motion along a surface.
//!
//! No integrator has an order across a jump of the force, and none can stand on one: explicit steps
//! chatter there. So each trajectory moves smoothly until its next event, which is looked for, and
//! goes on from there by the equations of the other side, or along the surface. Tangents take the
//! jump that an event earlier or later makes in them (the saltation matrix).
//!
//! Source: M. di Bernardo, C. Budd, A. Champneys, P. Kowalczyk, Piecewise-smooth Dynamical Systems
//! (Springer 2008), chapters 2 and 5.

use std::collections::BTreeMap;

use super::batch::{Batch, Scratch};
use super::equations::{Dynamics, Mode};
use super::integrate::advance_plainly;
use super::margins::{Margins, dips, first_root};
use super::methods::Method;
use super::switches::{Side, Switches};

/// Events of one trajectory in one advance, at most: behind it it goes on as if there were none.
const MOST_EVENTS: usize = 24;
/// How often the time ahead is halved where what happens in it is not clear.
const MOST_HALVINGS: usize = 5;
/// Times of events are found to this part of the advance.
const ACCURACY: f64 = 1e-11;
/// Corrections to a guess of the time of an event.
const MOST_CORRECTIONS: usize = 8;
/// A state that moves to a surface within this part of the advance is on it.
const ON_SURFACE: f64 = 1e-9;

/// Advances every lane by its own `span[lane]` in `steps` equal steps.
///
/// A span may be negative (backward) or 0 (no motion). Inputs go by the polynomials of the batch's
/// [`Drive`](super::Drive), which must hold for all of the span. Tangents, if the batch has them,
/// are multiplied by the Jacobian of the discrete map. A lane that leaves the finite numbers
/// becomes NaN, state and tangent, and does not disturb others; so does every lane when a splitting
/// is asked for dynamics that is not separable. Nothing is computed for 0 steps.
///
/// Where the equations jump, every trajectory takes its steps between the jumps, and along a
/// surface that holds it, as dry friction does.
pub fn advance(
    dynamics: &Dynamics,
    method: Method,
    batch: &mut Batch,
    span: &[f64],
    steps: usize,
    theta: &[f64],
    scratch: &mut Scratch,
) {
    match dynamics.switches(theta) {
        Some((switches, acting)) => {
            let moving = Moving { dynamics, switches, method, steps, theta, scratch };
            if steps > 0 {
                moving.advance(batch, span, &acting);
            }
        }
        None => advance_plainly(dynamics, method, batch, span, steps, theta, scratch),
    }
}

/// What moves: the equations, the method, and the numbers that both take.
struct Moving<'a> {
    dynamics: &'a Dynamics,
    switches: &'a Switches,
    method: Method,
    steps: usize,
    theta: &'a [f64],
    scratch: &'a mut Scratch,
}

/// Trajectories that have some of their time left, all on the same sides of all surfaces.
struct Waiting {
    sides: Vec<Side>,
    lanes: Vec<usize>,
    /// Events that they have had.
    events: usize,
    /// They go for so many times a half of the time that is left.
    halvings: usize,
}

/// The end of a mode.
struct Event {
    lane: usize,
    /// Time from now.
    time: f64,
    /// The surface, by its place among those that the mode watches.
    of: usize,
}

/// What happens to trajectories in the time ahead.
#[derive(Default)]
struct Ahead {
    /// Nothing.
    smooth: Vec<usize>,
    /// An event.
    events: Vec<Event>,
    /// Something else: the time is too long to say.
    unclear: Vec<usize>,
}

impl Moving<'_> {
    /// As [`advance`], by the surfaces on which the motion jumps.
    fn advance(mut self, batch: &mut Batch, span: &[f64], acting: &[bool]) {
        let mut left = span.to_vec();
        let lanes: Vec<usize> = (0..batch.lanes).collect();
        let sides = self.sides(&batch.without_tangents(&lanes), span, acting);
        let at_first = |(sides, lanes)| Waiting { sides, lanes, events: 0, halvings: 0 };
        let mut waiting: Vec<Waiting> = sides.into_iter().map(at_first).collect();
        while let Some(Waiting { sides, lanes, events, halvings }) = waiting.pop() {
            let mode = self
                .dynamics
                .mode(self.switches, &sides)
                .filter(|_| events < MOST_EVENTS && halvings <= MOST_HALVINGS);
            let Some(mode) = mode else {
                self.finish(self.dynamics, batch, &lanes, &left);
                continue;
            };
            let part = 0.5_f64.powi(halvings as i32);
            let mut goals = left.clone();
            lanes.iter().for_each(|&lane| goals[lane] *= part);
            let ahead = self.moved_until_events(&mode, batch, &lanes, &goals);
            let mut wait = |sides: &[Side], lanes: Vec<usize>, events, halvings| {
                if !lanes.is_empty() {
                    waiting.push(Waiting { sides: sides.to_vec(), lanes, events, halvings });
                }
            };
            wait(&sides, ahead.unclear, events, halvings + 1);
            for (next, lanes) in self.pass(&mode, batch, &ahead.events) {
                wait(&next, lanes, events + 1, halvings);
            }
            ahead.events.iter().for_each(|event| left[event.lane] -= event.time);
            if halvings > 0 {
                ahead.smooth.iter().for_each(|&lane| left[lane] -= goals[lane]);
                wait(&sides, ahead.smooth, events, halvings - 1);
            }
        }
    }

    fn moved(&mut self, by: &Dynamics, batch: &mut Batch, span: &[f64]) {
        advance_plainly(by, self.method, batch, span, self.steps, self.theta, self.scratch);
    }

    /// Moves some trajectories by the time ahead of each.
    fn finish(&mut self, by: &Dynamics, batch: &mut Batch, lanes: &[usize], ahead: &[f64]) {
        if lanes.is_empty() {
            return;
        }
        let spans: Vec<f64> = lanes.iter().map(|&lane| ahead[lane]).collect();
        if lanes.len() == batch.lanes {
            self.moved(by, batch, &spans);
        } else {
            let mut part = batch.with_tangents_of(lanes);
            self.moved(by, &mut part, &spans);
            batch.put_back(lanes, &part);
        }
    }

    /// Moves trajectories of a mode by the time ahead of each that have no event in it, and says
    /// what happens to each. Between most samples there is none: all are moved first.
    fn moved_until_events(
        &mut self,
        mode: &Mode,
        batch: &mut Batch,
        lanes: &[usize],
        times: &[f64],
    ) -> Ahead {
        let spans: Vec<f64> = lanes.iter().map(|&lane| times[lane]).collect();
        let start = batch.without_tangents(lanes);
        let mut moved = batch.with_tangents_of(lanes);
        self.moved(&mode.dynamics, &mut moved, &spans);
        let (before, after) = (self.margins(mode, &start), self.margins(mode, &moved));
        let course = |at: usize, of: usize| {
            let place = of * lanes.len() + at;
            let ends = [before.value[place], after.value[place]];
            (ends, [before.rate[place], after.rate[place]].map(|rate| rate * spans[at]))
        };
        let leaves = |at: usize| {
            (0..mode.watched.len()).any(|of| {
                let (ends, slopes) = course(at, of);
                ends[1].is_nan() || ends[1] < 0.0 || dips(ends, slopes)
            })
        };
        // What is lost already, or does not move, has no events.
        let stands = |at: usize| spans[at] == 0.0 || !start.is_finite(at);
        let (ending, smooth): (Vec<usize>, Vec<usize>) =
            (0..lanes.len()).partition(|&at| !stands(at) && leaves(at));
        let mut ahead =
            Ahead { smooth: smooth.iter().map(|&at| lanes[at]).collect(), ..Ahead::default() };
        if ending.is_empty() {
            batch.put_back(lanes, &moved);
            return ahead;
        }
        batch.put_back(&ahead.smooth, &moved.with_tangents_of(&smooth));
        let guess = |&at: &usize| first_root(mode.watched.len(), |of| course(at, of));
        let guesses: Vec<(f64, usize)> = ending.iter().map(guess).collect();
        let some = start.without_tangents(&ending);
        let spans: Vec<f64> = ending.iter().map(|&at| spans[at]).collect();
        let found = self.times(mode, &some, &spans, &guesses);
        for (&at, (time, (_, of))) in ending.iter().zip(found.into_iter().zip(guesses)) {
            match time {
                Some(time) => ahead.events.push(Event { lane: lanes[at], time, of }),
                None => ahead.unclear.push(lanes[at]),
            }
        }
        ahead
    }

    /// The times of events by Newton's method; none where it does not come to an end, or to
    /// another surface first. A guess is a part of the span, and the surface.
    fn times(
        &mut self,
        mode: &Mode,
        start: &Batch,
        spans: &[f64],
        guesses: &[(f64, usize)],
    ) -> Vec<Option<f64>> {
        let mut found = vec![None; start.lanes];
        let mut times: Vec<f64> =
            guesses.iter().zip(spans).map(|((share, _), span)| share * span).collect();
        let mut open: Vec<usize> =
            (0..start.lanes).filter(|&lane| times[lane].is_finite()).collect();
        for _ in 0..MOST_CORRECTIONS {
            if open.is_empty() {
                break;
            }
            let mut batch = start.without_tangents(&open);
            let now: Vec<f64> = open.iter().map(|&lane| times[lane]).collect();
            self.moved(&mode.dynamics, &mut batch, &now);
            let margins = self.margins(mode, &batch);
            let mut still = Vec::new();
            for (at, &lane) in open.iter().enumerate() {
                let (of, span) = (guesses[lane].1, spans[lane]);
                let correction =
                    -margins.value[of * open.len() + at] / margins.rate[of * open.len() + at];
                let next = times[lane] + correction;
                let first = (0..mode.watched.len()).all(|other| {
                    let place = other * open.len() + at;
                    let reach = ACCURACY * (span * margins.rate[place]).abs();
                    other == of || margins.value[place] >= -reach
                });
                if correction.abs() <= ACCURACY * span.abs() {
                    found[lane] = first.then_some(times[lane]);
                } else if (0.0..=1.0).contains(&(next / span)) {
                    times[lane] = next;
                    still.push(lane);
                }
            }
            open = still;
        }
        found
    }

    /// Moves trajectories to their events and through them; returns where they are then.
    fn pass(
        &mut self,
        mode: &Mode,
        batch: &mut Batch,
        events: &[Event],
    ) -> BTreeMap<Vec<Side>, Vec<usize>> {
        let mut after: BTreeMap<Vec<Side>, Vec<usize>> = BTreeMap::new();
        if events.is_empty() {
            return after;
        }
        let lanes: Vec<usize> = events.iter().map(|event| event.lane).collect();
        let times: Vec<f64> = events.iter().map(|event| event.time).collect();
        let mut part = batch.with_tangents_of(&lanes);
        self.moved(&mode.dynamics, &mut part, &times);
        for of in 0..mode.watched.len() {
            let at: Vec<usize> = (0..events.len()).filter(|&at| events[at].of == of).collect();
            if at.is_empty() {
                continue;
            }
            let mut some = part.with_tangents_of(&at);
            let known = self.beyond(mode, of, &some);
            for (sides, members) in known {
                if let Some(next) = self.dynamics.mode(self.switches, &sides) {
                    let mut through = some.with_tangents_of(&members);
                    self.salt(mode, of, &next, &mut through);
                    some.put_back(&members, &through);
                }
                let members = members.iter().map(|&member| lanes[at[member]]);
                after.entry(sides).or_default().extend(members);
            }
            part.put_back(&at, &some);
        }
        batch.put_back(&lanes, &part);
        after.values_mut().for_each(|lanes| lanes.sort_unstable());
        after
    }

    /// Where trajectories go that end a mode at one of its surfaces.
    fn beyond(&mut self, mode: &Mode, of: usize, batch: &Batch) -> BTreeMap<Vec<Side>, Vec<usize>> {
        let switch = mode.watched[of];
        let all: Vec<usize> = (0..batch.lanes).collect();
        match mode.sides[switch] {
            Side::On => {
                // The sign that holds the motion on the surface has grown beyond one of its ends.
                let mut above = mode.sides.clone();
                above[switch] = Side::Above;
                let leaves = self.rates_inside(&above, switch, batch);
                let side =
                    |lane: usize| if leaves[lane] >= 0.0 { Side::Above } else { Side::Below };
                grouped(&mode.sides, switch, &all, side)
            }
            Side::Above => self.on_surface(&mode.sides, switch, batch, &all, Side::Below),
            _ => self.on_surface(&mode.sides, switch, batch, &all, Side::Above),
        }
    }

    /// Where trajectories on a surface go: off it where one side lets them, `first` before the
    /// other, or else along it.
    fn on_surface(
        &mut self,
        sides: &[Side],
        switch: usize,
        batch: &Batch,
        lanes: &[usize],
        first: Side,
    ) -> BTreeMap<Vec<Side>, Vec<usize>> {
        let second = if first == Side::Above { Side::Below } else { Side::Above };
        let [on_first, on_second] = [first, second].map(|side| {
            let mut sides = sides.to_vec();
            sides[switch] = side;
            self.rates_inside(&sides, switch, batch)
        });
        let side = |lane: usize| {
            if on_first[lane] > 0.0 {
                first
            } else if on_second[lane] > 0.0 {
                second
            } else {
                Side::On
            }
        };
        grouped(sides, switch, lanes, side)
    }

    /// How fast trajectories get away from a surface, on a side of it.
    fn rates_inside(&mut self, sides: &[Side], switch: usize, batch: &Batch) -> Vec<f64> {
        let Some(mode) = self.dynamics.mode(self.switches, sides) else {
            return vec![f64::NAN; batch.lanes];
        };
        let of = mode.watched.iter().position(|&watched| watched == switch).unwrap_or(0);
        self.margins(&mode, batch).rate[of * batch.lanes..][..batch.lanes].to_vec()
    }

    /// Where the state of each trajectory stands.
    fn sides(
        &mut self,
        batch: &Batch,
        spans: &[f64],
        acting: &[bool],
    ) -> BTreeMap<Vec<Side>, Vec<usize>> {
        let (lanes, count) = (batch.lanes, self.switches.count());
        self.scratch.stand_at(batch);
        let mut field = vec![0.0; batch.state.len()];
        self.dynamics.field_at(batch, self.theta, &mut field, self.scratch);
        let flow = self.dynamics.surfaces(self.switches);
        let at = Margins::of(flow, count, batch, &field, self.theta, self.scratch);
        let mut groups: BTreeMap<Vec<Side>, Vec<usize>> = BTreeMap::new();
        let mut touching: Vec<Vec<usize>> = vec![Vec::new(); count];
        for lane in 0..lanes {
            let side = |k: usize| {
                if !acting[k] {
                    return Side::Any;
                }
                if at.value[k * lanes + lane] < 0.0 { Side::Below } else { Side::Above }
            };
            groups.entry((0..count).map(side).collect()).or_default().push(lane);
            for (k, touching) in touching.iter_mut().enumerate().filter(|(k, _)| acting[*k]) {
                let [value, rate] = [&at.value, &at.rate].map(|of| of[k * lanes + lane]);
                if value.abs() <= ON_SURFACE * (rate * spans[lane]).abs() || value == 0.0 {
                    touching.push(lane);
                }
            }
        }
        for (k, touching) in touching.iter().enumerate().filter(|(_, lanes)| !lanes.is_empty()) {
            let mut decided: BTreeMap<Vec<Side>, Vec<usize>> = BTreeMap::new();
            for (sides, lanes) in groups {
                let (on, off): (Vec<usize>, Vec<usize>) =
                    lanes.into_iter().partition(|lane| touching.binary_search(lane).is_ok());
                if !off.is_empty() {
                    decided.entry(sides.clone()).or_default().extend(off);
                }
                if !on.is_empty() {
                    let some = batch.without_tangents(&on);
                    for (sides, lanes) in self.on_surface(&sides, k, &some, &on, sides[k]) {
                        decided.entry(sides).or_default().extend(lanes);
                    }
                }
            }
            groups = decided;
        }
        groups.values_mut().for_each(|lanes| lanes.sort_unstable());
        groups
    }

    /// The tangents' jump at an event. The event comes earlier or later by how the margin changes;
    /// for that time the motion is the one and not the other.
    fn salt(&mut self, mode: &Mode, of: usize, next: &Mode, batch: &mut Batch) {
        if !batch.has_tangents() {
            return;
        }
        let (lanes, columns, rows) = (batch.lanes, batch.columns(), 2 * batch.degrees());
        let [before, after] = [mode, next].map(|mode| {
            let mut field = vec![0.0; batch.state.len()];
            self.scratch.stand_at(batch);
            mode.dynamics.field_at(batch, self.theta, &mut field, self.scratch);
            field
        });
        let margins = self.margins(mode, batch);
        // The change of the margin by each column.
        let mut change = vec![0.0; columns * lanes];
        for (&(row, from), slope) in mode.margins.jacobian.iter().zip(margins.jacobian(lanes)) {
            if row != of {
                continue;
            }
            let tangent = &batch.tangent[from * columns * lanes..][..columns * lanes];
            for (change, tangent) in change.chunks_exact_mut(lanes).zip(tangent.chunks_exact(lanes))
            {
                let products = slope.iter().zip(tangent);
                change.iter_mut().zip(products).for_each(|(c, (s, t))| *c += s * t);
            }
        }
        let mixed = margins.mixed(&mode.margins, lanes);
        for (&(row, unknown), slope) in mode.margins.mixed.iter().zip(mixed) {
            if row == of && columns > rows {
                let change = &mut change[(rows + unknown) * lanes..][..lanes];
                change.iter_mut().zip(slope).for_each(|(c, s)| *c += s);
            }
        }
        for row in 0..rows {
            let jump: Vec<f64> = (0..lanes)
                .map(|lane| {
                    let at = row * lanes + lane;
                    let ratio = (after[at] - before[at]) / margins.rate[of * lanes + lane];
                    if ratio.is_finite() { ratio } else { 0.0 }
                })
                .collect();
            let tangent = &mut batch.tangent[row * columns * lanes..][..columns * lanes];
            for (tangent, change) in tangent.chunks_exact_mut(lanes).zip(change.chunks_exact(lanes))
            {
                let products = jump.iter().zip(change);
                tangent.iter_mut().zip(products).for_each(|(t, (j, c))| *t += j * c);
            }
        }
    }

    fn margins(&mut self, mode: &Mode, batch: &Batch) -> Margins {
        let mut field = vec![0.0; batch.state.len()];
        mode.dynamics.field_at(batch, self.theta, &mut field, self.scratch);
        let count = mode.watched.len();
        Margins::of(&mode.margins, count, batch, &field, self.theta, self.scratch)
    }
}

/// Trajectories by the sides that they are on when that of one surface is set.
fn grouped(
    sides: &[Side],
    switch: usize,
    lanes: &[usize],
    side: impl Fn(usize) -> Side,
) -> BTreeMap<Vec<Side>, Vec<usize>> {
    let mut groups: BTreeMap<Vec<Side>, Vec<usize>> = BTreeMap::new();
    for (at, &lane) in lanes.iter().enumerate() {
        let mut sides = sides.to_vec();
        sides[switch] = side(at);
        groups.entry(sides).or_default().push(lane);
    }
    groups
}
