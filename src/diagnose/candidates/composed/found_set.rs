//! Sets of a pool as they are found, and moves from one to the next.

use rustc_hash::FxHashSet;

/// A set, its members in order.
pub(super) type Set = Vec<usize>;

/// A set with what it leaves.
#[derive(Debug, Clone)]
pub(super) struct FoundSet {
    pub(super) members: Set,
    /// Twice the nats of its description.
    pub(super) cost: f64,
    /// What of that is saved by terms of the model that idle beside it.
    pub(super) saved: f64,
}

/// What a set with one more member costs, and that member.
pub(super) type Addition = (f64, usize);

/// A set with one more member, at a cost.
pub(super) fn with(set: &[usize], &(cost, at): &Addition) -> FoundSet {
    let mut members = set.to_vec();
    members.push(at);
    members.sort_unstable();
    FoundSet { members, cost, saved: 0.0 }
}

/// How many of some kinds are the wanted one.
pub(super) fn count(kinds: &[usize], wanted: usize) -> usize {
    kinds.iter().filter(|&&kind| kind == wanted).count()
}

/// The cheapest so many in their order, and the others in none.
pub(super) fn cheapest(all: &mut [Addition], most: usize) -> (&mut [Addition], &mut [Addition]) {
    let order = |a: &Addition, b: &Addition| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    let count = most.min(all.len());
    if count < all.len() {
        all.select_nth_unstable_by(count, order);
    }
    let (first, then) = all.split_at_mut(count);
    first.sort_unstable_by(order);
    (first, then)
}

/// Keeps so many sets, which are in the order of their cost, and the best of each size.
pub(super) fn shorten(pool: &mut Vec<FoundSet>, kept: usize) {
    let mut place = 0;
    let mut sizes = FxHashSet::default();
    pool.retain(|one| {
        place += 1;
        sizes.insert(one.members.len()) || place <= kept
    });
}

/// A set without the members at some of its places.
pub(super) fn without(set: &[usize], places: &[usize]) -> Set {
    let kept = set.iter().enumerate().filter(|(place, _)| !places.contains(place));
    kept.map(|(_, &at)| at).collect()
}
