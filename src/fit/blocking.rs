//! How the work is cut into pieces: sizes that change what a fit costs and not what it finds.
//!
//! They follow the caches and the memory of machines, not the data, so that no option of a fit
//! holds them. `benches/fit.rs` and docs/growth.md show what each is worth; the pieces depend on
//! the data alone, never on the number of threads.

/// Sizes of the pieces that a pass, a factor and a search are cut into.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Blocking {
    /// Segments side by side in one block, at most.
    pub lanes: usize,
    /// Bytes that the rows of one block may take.
    pub block_bytes: usize,
    /// Rows of short segments by few columns that take no more bytes than this: such blocks
    /// may be twice as wide.
    pub small_block_bytes: usize,
    /// Bytes that the rows of the lanes may take whose states are eliminated together: the
    /// nearest cache.
    pub elimination_bytes: usize,
    /// Rows of a part, at least: fewer are done before another thread could take them over.
    pub part_rows: usize,
    /// Parts of a fold, at most, each with a factor of its own.
    pub parts_of_a_fold: usize,
    /// Unknowns up to which a fold is taken in parts: with more, factors take memory and
    /// time.
    pub parts_up_to: usize,
    /// Samples of a segment up to which it is settled sooner than it is known how its state
    /// responds to theta.
    pub responses_above: usize,
    /// Bytes that the responses of all states may take.
    pub response_bytes: usize,
    /// Columns that one block reflector eliminates; the rest of the work is matrix
    /// products.
    pub panel: usize,
    /// Columns up to which those products would cost more than they save: all is one panel.
    pub one_panel: usize,
    /// Samples that one thread looks at in a row.
    pub samples_together: usize,
    /// Segments whose first states one thread looks up at a time.
    pub states_together: usize,
    /// Samples of a chunk of data that are held in memory.
    pub chunk: usize,
    /// Compiled dynamics that a training keeps, beside that of the whole function space.
    pub dynamics: usize,
    /// Triangles that a search of the whole space holds beside its folds, as
    /// [`factors`](super::memory::factors) counts them: merged ones, and copies.
    pub copies: usize,
    /// Triangles of rows that each thread gathers before they go into a factor.
    pub gathered: usize,
}

/// The sizes that every fit goes by.
pub(super) const BLOCKING: Blocking = Blocking {
    lanes: 64,
    block_bytes: 12 << 20,
    small_block_bytes: 128 << 10,
    elimination_bytes: 512 << 10,
    part_rows: 8192,
    parts_of_a_fold: 4,
    parts_up_to: 200,
    responses_above: 4,
    response_bytes: 32 << 20,
    panel: 32,
    one_panel: 128,
    samples_together: 1 << 14,
    states_together: 1024,
    chunk: 1 << 17,
    dynamics: 8,
    copies: 6,
    gathered: 4,
};
