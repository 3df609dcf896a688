//! Physical units: what they measure, and how large they are.

use std::fmt;

use num_rational::Ratio;

/// How many base quantities there are: metre, kilogram, second, ampere, kelvin, mole, candela,
/// pixel.
pub const BASES: usize = 8;

/// What the base units are called, in the order of [`Unit::powers`].
const BASE_NAMES: [&str; BASES] = ["m", "kg", "s", "A", "K", "mol", "cd", "px"];

/// Largest numerator and denominator of a power; what is beyond is no unit of anything.
const LARGEST_POWER: i64 = 10_000;

/// A unit as powers of the base units times a scale; the radian is the number 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// Powers of metre, kilogram, second, ampere, kelvin, mole, candela, pixel.
    pub powers: [Ratio<i32>; BASES],
    /// How many base units one of this unit is.
    pub scale: f64,
}

/// A unit that the program knows by name.
pub struct UnitRow {
    /// How it is written between brackets.
    pub name: &'static str,
    /// Powers of metre, kilogram, second, ampere, kelvin, mole, candela, pixel.
    pub powers: [i32; BASES],
    /// How many base units one of it is.
    pub scale: f64,
    /// Whether kilo, milli and the like may stand before it.
    pub prefixed: bool,
}

const fn row(name: &'static str, powers: [i32; BASES], scale: f64, prefixed: bool) -> UnitRow {
    UnitRow { name, powers, scale, prefixed }
}

const NUMBER: [i32; BASES] = [0; BASES];
const LENGTH: [i32; BASES] = [1, 0, 0, 0, 0, 0, 0, 0];
const MASS: [i32; BASES] = [0, 1, 0, 0, 0, 0, 0, 0];
const TIME: [i32; BASES] = [0, 0, 1, 0, 0, 0, 0, 0];

/// Units by name, after the SI brochure (9th edition, tables 2, 4 and 8). A new one is one row.
pub static UNITS: &[UnitRow] = &[
    row("m", LENGTH, 1.0, true),
    row("g", MASS, 1e-3, true),
    row("s", TIME, 1.0, true),
    row("A", [0, 0, 0, 1, 0, 0, 0, 0], 1.0, true),
    row("K", [0, 0, 0, 0, 1, 0, 0, 0], 1.0, true),
    row("mol", [0, 0, 0, 0, 0, 1, 0, 0], 1.0, true),
    row("cd", [0, 0, 0, 0, 0, 0, 1, 0], 1.0, true),
    row("px", [0, 0, 0, 0, 0, 0, 0, 1], 1.0, false),
    row("pixel", [0, 0, 0, 0, 0, 0, 0, 1], 1.0, false),
    row("rad", NUMBER, 1.0, true),
    row("deg", NUMBER, std::f64::consts::PI / 180.0, false),
    row("°", NUMBER, std::f64::consts::PI / 180.0, false),
    row("rev", NUMBER, std::f64::consts::TAU, false),
    row("turn", NUMBER, std::f64::consts::TAU, false),
    row("%", NUMBER, 0.01, false),
    row("min", TIME, 60.0, false),
    row("h", TIME, 3600.0, false),
    row("day", TIME, 86_400.0, false),
    row("d", TIME, 86_400.0, false),
    row("year", TIME, 31_557_600.0, false),
    row("Hz", [0, 0, -1, 0, 0, 0, 0, 0], 1.0, true),
    row("rpm", [0, 0, -1, 0, 0, 0, 0, 0], std::f64::consts::TAU / 60.0, false),
    // The standard acceleration of gravity, ISO 80000-3.
    row("g_n", [1, 0, -2, 0, 0, 0, 0, 0], 9.806_65, true),
    row("N", [1, 1, -2, 0, 0, 0, 0, 0], 1.0, true),
    row("Pa", [-1, 1, -2, 0, 0, 0, 0, 0], 1.0, true),
    row("J", [2, 1, -2, 0, 0, 0, 0, 0], 1.0, true),
    row("eV", [2, 1, -2, 0, 0, 0, 0, 0], 1.602_176_634e-19, true),
    row("W", [2, 1, -3, 0, 0, 0, 0, 0], 1.0, true),
    row("C", [0, 0, 1, 1, 0, 0, 0, 0], 1.0, true),
    row("V", [2, 1, -3, -1, 0, 0, 0, 0], 1.0, true),
    row("F", [-2, -1, 4, 2, 0, 0, 0, 0], 1.0, true),
    row("Ohm", [2, 1, -3, -2, 0, 0, 0, 0], 1.0, true),
    row("Ω", [2, 1, -3, -2, 0, 0, 0, 0], 1.0, true),
    row("T", [0, 1, -2, -1, 0, 0, 0, 0], 1.0, true),
    row("Wb", [2, 1, -2, -1, 0, 0, 0, 0], 1.0, true),
    row("H", [2, 1, -2, -2, 0, 0, 0, 0], 1.0, true),
    row("L", [3, 0, 0, 0, 0, 0, 0, 0], 1e-3, true),
    row("t", MASS, 1e3, false),
    row("u", MASS, 1.660_539_068_92e-27, false),
    row("bar", [-1, 1, -2, 0, 0, 0, 0, 0], 1e5, true),
    row("inch", LENGTH, 0.0254, false),
    row("ft", LENGTH, 0.3048, false),
    row("au", LENGTH, 149_597_870_700.0, false),
];

/// SI prefixes; `da` stands before `d` so that it is tried first.
const PREFIXES: [(&str, f64); 22] = [
    ("da", 1e1),
    ("Q", 1e30),
    ("Y", 1e24),
    ("Z", 1e21),
    ("E", 1e18),
    ("P", 1e15),
    ("T", 1e12),
    ("G", 1e9),
    ("M", 1e6),
    ("k", 1e3),
    ("h", 1e2),
    ("d", 1e-1),
    ("c", 1e-2),
    ("m", 1e-3),
    ("u", 1e-6),
    ("µ", 1e-6),
    ("μ", 1e-6),
    ("n", 1e-9),
    ("p", 1e-12),
    ("f", 1e-15),
    ("a", 1e-18),
    ("z", 1e-21),
];

/// Sum of two powers; `None` where it is no power of a unit any more.
fn add(a: Ratio<i32>, b: Ratio<i32>, sign: i64) -> Option<Ratio<i32>> {
    let (an, ad) = (i64::from(*a.numer()), i64::from(*a.denom()));
    let (bn, bd) = (i64::from(*b.numer()), i64::from(*b.denom()));
    small(Ratio::new(an * bd + sign * bn * ad, ad * bd))
}

fn times(a: Ratio<i32>, b: Ratio<i32>) -> Option<Ratio<i32>> {
    let numerator = i64::from(*a.numer()) * i64::from(*b.numer());
    small(Ratio::new(numerator, i64::from(*a.denom()) * i64::from(*b.denom())))
}

fn small(value: Ratio<i64>) -> Option<Ratio<i32>> {
    let (numerator, denominator) = (*value.numer(), *value.denom());
    if numerator.abs() > LARGEST_POWER || denominator > LARGEST_POWER {
        return None;
    }
    Some(Ratio::new(i32::try_from(numerator).ok()?, i32::try_from(denominator).ok()?))
}

/// The fraction with a denominator up to 12 that a number is, if it is one.
pub fn simple_fraction(value: f64) -> Option<Ratio<i32>> {
    (1..=12).find_map(|denominator| {
        let numerator = value * f64::from(denominator);
        let whole = numerator.round();
        let near = (numerator - whole).abs() <= 1e-12 * whole.abs().max(1.0);
        (near && whole.abs() <= LARGEST_POWER as f64).then(|| Ratio::new(whole as i32, denominator))
    })
}

impl Unit {
    /// The unit of pure numbers and of angles in radians.
    pub const ONE: Unit = Unit { powers: [Ratio::new_raw(0, 1); BASES], scale: 1.0 };

    /// Reads a unit without its brackets: `kg*m^2/s^2`, `N m`, `1/s`, `m^(1/2)`.
    ///
    /// # Errors
    /// A sentence that says what cannot be read.
    pub fn parse(text: &str) -> Result<Unit, String> {
        Reader { rest: text.trim(), depth: 0 }.whole()
    }

    fn of_row(row: &UnitRow, prefix: f64) -> Unit {
        Unit { powers: row.powers.map(Ratio::from_integer), scale: row.scale * prefix }
    }

    /// A unit by name, with or without a prefix.
    fn by_name(name: &str) -> Option<Unit> {
        if let Some(row) = UNITS.iter().find(|row| row.name == name) {
            return Some(Unit::of_row(row, 1.0));
        }
        PREFIXES.iter().find_map(|&(prefix, size)| {
            let rest = name.strip_prefix(prefix)?;
            let row = UNITS.iter().find(|row| row.prefixed && row.name == rest)?;
            Some(Unit::of_row(row, size))
        })
    }

    /// A name such as `cm`, `deg` or `min` for a unit that is no product of base units.
    fn short_name(self) -> Option<String> {
        if (self.scale - 1.0).abs() < 1e-12 {
            return None;
        }
        let plain = UNITS.iter().find(|row| self.agrees(Unit::of_row(row, 1.0)));
        if let Some(row) = plain {
            return Some(row.name.to_string());
        }
        UNITS.iter().filter(|row| row.prefixed).find_map(|row| {
            let common = PREFIXES
                .iter()
                .filter(|(prefix, _)| ["k", "c", "m", "u", "n", "M", "G"].contains(prefix));
            let found =
                common.into_iter().find(|&&(_, size)| self.agrees(Unit::of_row(row, size)))?;
            Some(format!("{}{}", found.0, row.name))
        })
    }

    /// Product of two units; `None` where the powers become absurd.
    pub fn times(self, other: Unit) -> Option<Unit> {
        self.combine(other, 1).map(|powers| Unit { powers, scale: self.scale * other.scale })
    }

    /// Quotient of two units.
    pub fn over(self, other: Unit) -> Option<Unit> {
        self.combine(other, -1).map(|powers| Unit { powers, scale: self.scale / other.scale })
    }

    fn combine(self, other: Unit, sign: i64) -> Option<[Ratio<i32>; BASES]> {
        let mut powers = self.powers;
        for (power, more) in powers.iter_mut().zip(other.powers) {
            *power = add(*power, more, sign)?;
        }
        Some(powers)
    }

    /// The unit of a quantity raised to a power.
    pub fn power(self, exponent: Ratio<i32>) -> Option<Unit> {
        let mut powers = self.powers;
        for power in &mut powers {
            *power = times(*power, exponent)?;
        }
        let exponent = f64::from(*exponent.numer()) / f64::from(*exponent.denom());
        let scale = if self.scale == 1.0 { 1.0 } else { self.scale.powf(exponent) };
        (scale.is_finite() && scale > 0.0).then_some(Unit { powers, scale })
    }

    /// Whether both measure the same kind of quantity, whatever their size.
    pub fn same_kind(self, other: Unit) -> bool {
        self.powers == other.powers
    }

    /// Whether numbers in one may be added to numbers in the other.
    pub fn agrees(self, other: Unit) -> bool {
        let ratio = self.scale / other.scale;
        self.same_kind(other) && (ratio - 1.0).abs() < 1e-9
    }

    /// Whether it measures a pure number, 1 being one.
    pub fn is_number(self) -> bool {
        self.agrees(Unit::ONE)
    }
}

/// As powers of base units, which [`Unit::parse`] reads back; the radian is `1`.
impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = |(i, power): (usize, Ratio<i32>)| {
            let name = BASE_NAMES[i];
            match (*power.numer(), *power.denom()) {
                (1, 1) => name.to_string(),
                (n, 1) => format!("{name}^{n}"),
                (n, d) => format!("{name}^({n}/{d})"),
            }
        };
        if let Some(name) = self.short_name() {
            return f.write_str(&name);
        }
        let zero = Ratio::from_integer(0);
        // Mass first, as in kg*m^2/s^2.
        let all = || [1, 0, 2, 3, 4, 5, 6, 7].into_iter().map(|i| (i, self.powers[i]));
        let over: Vec<String> = all().filter(|&(_, p)| p > zero).map(part).collect();
        let under: Vec<String> =
            all().filter(|&(_, p)| p < zero).map(|(i, p)| part((i, -p))).collect();
        let mut pieces = Vec::new();
        if (self.scale - 1.0).abs() > 1e-12 {
            let rounded: f64 = format!("{:.12e}", self.scale).parse().unwrap_or(self.scale);
            let plain = (1e-3..1e6).contains(&rounded);
            pieces.push(if plain { format!("{rounded}") } else { format!("{rounded:e}") });
        }
        pieces.extend(over);
        f.write_str(if pieces.is_empty() { "1" } else { "" })?;
        f.write_str(&pieces.join("*"))?;
        under.iter().try_for_each(|factor| write!(f, "/{factor}"))
    }
}

/// Reads a unit from left to right: what follows a `/` divides, up to the next piece.
struct Reader<'a> {
    rest: &'a str,
    depth: usize,
}

const TOO_LARGE: &str = "its powers are too large";

impl Reader<'_> {
    fn whole(mut self) -> Result<Unit, String> {
        let unit = self.product()?;
        match self.rest.chars().next() {
            None => Ok(unit),
            Some(extra) => Err(format!("`{extra}` has no meaning in a unit")),
        }
    }

    fn take(&mut self, wanted: char) -> bool {
        self.rest = self.rest.trim_start();
        match self.rest.strip_prefix(wanted) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn product(&mut self) -> Result<Unit, String> {
        let mut unit = self.factor()?;
        loop {
            if self.take('/') {
                let next = self.factor()?;
                unit = unit.over(next).ok_or(TOO_LARGE)?;
                continue;
            }
            let marked = self.take('*') || self.take('·');
            self.rest = self.rest.trim_start();
            if !marked && (self.rest.is_empty() || self.rest.starts_with([')', '^'])) {
                return Ok(unit);
            }
            let next = self.factor()?;
            unit = unit.times(next).ok_or(TOO_LARGE)?;
        }
    }

    fn factor(&mut self) -> Result<Unit, String> {
        let base = self.base()?;
        if !self.take('^') {
            return Ok(base);
        }
        let exponent = self.exponent()?;
        base.power(exponent).ok_or_else(|| TOO_LARGE.to_string())
    }

    fn base(&mut self) -> Result<Unit, String> {
        if self.take('(') {
            self.depth += 1;
            if self.depth > 20 {
                return Err("it nests too many parentheses".to_string());
            }
            let inner = self.product()?;
            self.depth -= 1;
            return if self.take(')') { Ok(inner) } else { Err("a `)` is missing".to_string()) };
        }
        self.rest = self.rest.trim_start();
        let digits = self.digits(|c| c.is_ascii_digit() || c == '.');
        if !digits.is_empty() {
            // 1e-3: only a number may be followed by an exponent of ten.
            let mut text = digits.to_string();
            if let Some(rest) = self.rest.strip_prefix('e')
                && rest.starts_with(|c: char| c == '-' || c.is_ascii_digit())
            {
                self.rest = rest;
                text.push('e');
                if self.take('-') {
                    text.push('-');
                }
                text.push_str(self.digits(|c| c.is_ascii_digit()));
            }
            let scale: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
            return match scale {
                s if s.is_finite() && s > 0.0 => Ok(Unit { scale, ..Unit::ONE }),
                _ => Err(format!("`{text}` is not the size of a unit")),
            };
        }
        let name = self.digits(|c| c.is_alphabetic() || c == '%' || c == '°' || c == '_');
        if name.is_empty() {
            return Err(match self.rest.chars().next() {
                None => "it ends where a unit is missing".to_string(),
                Some(extra) => format!("`{extra}` has no meaning in a unit"),
            });
        }
        Unit::by_name(name).ok_or_else(|| {
            match crate::spec::nearest(name, UNITS.iter().map(|row| row.name)) {
                Some(near) => format!("`{name}` is not a known unit; did you mean `{near}`?"),
                None => format!("`{name}` is not a known unit"),
            }
        })
    }

    fn digits(&mut self, accept: impl Fn(char) -> bool) -> &str {
        let end = self.rest.find(|c| !accept(c)).unwrap_or(self.rest.len());
        let (text, rest) = self.rest.split_at(end);
        self.rest = rest;
        text
    }

    fn whole_number(&mut self) -> Result<i32, String> {
        let minus = self.take('-');
        self.rest = self.rest.trim_start();
        let text = self.digits(|c| c.is_ascii_digit());
        let value: i32 = text.parse().map_err(|_| "a power is not a whole number".to_string())?;
        if i64::from(value) > LARGEST_POWER {
            return Err(TOO_LARGE.to_string());
        }
        Ok(if minus { -value } else { value })
    }

    fn exponent(&mut self) -> Result<Ratio<i32>, String> {
        if !self.take('(') {
            return self.whole_number().map(Ratio::from_integer);
        }
        let numerator = self.whole_number()?;
        let denominator = if self.take('/') { self.whole_number()? } else { 1 };
        if denominator == 0 {
            return Err("a power divides by zero".to_string());
        }
        if self.take(')') {
            Ok(Ratio::new(numerator, denominator))
        } else {
            Err("a `)` is missing".to_string())
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn unit(text: &str) -> Unit {
        Unit::parse(text).unwrap_or_else(|message| panic!("{text}: {message}"))
    }

    #[test]
    fn equal_units_in_different_words() {
        for (a, b) in [
            ("N m", "kg*m^2/s^2"),
            ("J", "kg m^2 / s^2"),
            ("Hz", "1/s"),
            ("rad/s", "s^-1"),
            ("mJ", "1e-3 J"),
            ("W", "V A"),
            ("mm", "0.1 cm"),
            ("min", "60 s"),
            ("mg_n", "9.80665 mm/s^2"),
            ("m^(1/2)*m^(1/2)", "m"),
            ("(kg m)/(s^2)", "N"),
        ] {
            assert!(unit(a).agrees(unit(b)), "{a} is {b}");
        }
        assert!((unit("deg").scale - 0.017_453_292_519_943_295).abs() < 1e-18);
        assert!(unit("cm").same_kind(unit("m")) && !unit("cm").agrees(unit("m")));
        assert!(unit("min").same_kind(unit("s")), "min is no milli-inch");
    }

    #[test]
    fn what_is_no_unit_is_said() {
        for text in ["", "foo", "m^", "m^999999999", "(m", "m)", "/s", "0", "1e999", "m^(1/0)", "-"]
        {
            assert!(Unit::parse(text).is_err(), "{text}");
        }
        assert!(Unit::parse(&"(".repeat(100_000)).is_err());
    }

    #[test]
    fn every_unit_and_its_print_are_the_same() {
        for row in UNITS {
            let of_row = unit(row.name);
            assert!(unit(&of_row.to_string()).agrees(of_row), "{}", row.name);
        }
    }

    proptest! {
        #[test]
        fn print_reads_back(powers in prop::array::uniform8((-9..9_i32, 1..4_i32)), scale in 1e-6..1e6) {
            let powers = powers.map(|(n, d)| Ratio::new(n, d));
            let unit = Unit { powers, scale };
            let text = unit.to_string();
            prop_assert!(Unit::parse(&text).is_ok_and(|read| read.agrees(unit)), "{}", text);
        }

        #[test]
        fn no_text_breaks_it(text in "\\PC{0,30}") {
            let _ = Unit::parse(&text);
        }
    }
}
