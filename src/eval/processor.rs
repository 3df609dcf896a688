//! What the processor can do.

/// Registers that arithmetic runs on. The results are the same bits on all of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every processor of the platform has. On x86-64 without fused multiply-add the
    /// fused operations are done in software: the same bits, many times slower.
    Plain,
    /// AVX2 with fused multiply-add: four numbers at once.
    Avx2,
    /// AVX-512: eight numbers at once.
    Avx512,
}

impl InstructionSet {
    /// The widest that this processor has.
    pub fn widest() -> InstructionSet {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if avx2 && is_x86_feature_detected!("avx512f") {
                return InstructionSet::Avx512;
            }
            if avx2 {
                return InstructionSet::Avx2;
            }
        }
        InstructionSet::Plain
    }

    /// All that this processor has, narrowest first.
    pub fn available() -> Vec<InstructionSet> {
        let all = [InstructionSet::Plain, InstructionSet::Avx2, InstructionSet::Avx512];
        let widest = InstructionSet::widest();
        all.into_iter().filter(|&set| set <= widest).collect()
    }
}

/// Defines a function of an instruction set: `name(set, arguments)` runs the body compiled
/// for that set. The body must be `#[inline(always)]`.
macro_rules! dispatched {
    ($(#[$about:meta])* $visible:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) = $body:path;) => {
        $(#[$about])*
        #[allow(unsafe_code, reason = "code for an instruction set runs where the set was found")]
        $visible fn $name(set: $crate::eval::InstructionSet, $($argument: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn avx2($($argument: $type),*) {
                    $body($($argument),*);
                }
                #[target_feature(enable = "avx512f,avx2,fma")]
                fn avx512($($argument: $type),*) {
                    $body($($argument),*);
                }
                let set = set.min($crate::eval::InstructionSet::widest());
                if set == $crate::eval::InstructionSet::Avx512 {
                    // SAFETY: `widest` has just found the instruction set on this processor.
                    return unsafe { avx512($($argument),*) };
                }
                if set == $crate::eval::InstructionSet::Avx2 {
                    // SAFETY: `widest` has just found the instruction set on this processor.
                    return unsafe { avx2($($argument),*) };
                }
            }
            let _ = set;
            $body($($argument),*);
        }
    };
}

pub(super) use dispatched;
