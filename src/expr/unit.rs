//! Physical units: what they measure, and how large they are.

use num_rational::Ratio;

/// How many base quantities there are: metre, kilogram, second, ampere, kelvin, mole, candela, pixel.
pub const BASES: usize = 8;

/// A unit as powers of the base units times a scale; the radian is the number 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    pub powers: [Ratio<i32>; BASES],
    /// How many base units one of this unit is.
    pub scale: f64,
}

impl Unit {
    pub const ONE: Unit = Unit { powers: [Ratio::new_raw(0, 1); BASES], scale: 1.0 };
}
