//! A damaged file must not end the program, even where the decoder did not expect the damage.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Whether this thread is decoding: what panics then is reported as damage.
    static DECODING: Cell<bool> = const { Cell::new(false) };
}
static HOOK: Once = Once::new();

/// Decodes; a decoder that gives up with a panic has found damage, and gives nothing.
///
/// What was being decoded into is not used after a failure.
pub(super) fn guarded<T>(work: impl FnOnce() -> T) -> Option<T> {
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |about| {
            if !DECODING.get() {
                usual(about);
            }
        }));
    });
    DECODING.set(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    DECODING.set(false);
    done.ok()
}
