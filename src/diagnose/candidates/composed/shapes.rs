//! Functions of one argument that composed terms are made of: one row for each.

/// What an argument has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Needs {
    /// Anything.
    Nothing,
    /// Of one sign over all the data.
    OneSign,
    /// Above zero over all the data.
    Positive,
    /// Of both signs: for a positive argument a simpler row is the same.
    BothSigns,
}

/// What a number inside a shape is, which says where it is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Inner {
    /// A length of the argument.
    Length,
    /// A length within which an exponential changes.
    Scale,
    /// An angle for each unit of the argument.
    WaveNumber,
    /// A value of the argument.
    Centre,
    /// A power.
    Exponent,
}

impl Inner {
    /// Values that are tried for an argument between `lower` and `upper`.
    pub(super) fn grid(self, lower: f64, upper: f64) -> Vec<f64> {
        let span = (upper - lower).max(f64::MIN_POSITIVE);
        let turn = std::f64::consts::TAU / span;
        let ratio = |a: f64, b: f64, count: usize| -> Vec<f64> {
            (0..count).map(|i| a * (b / a).powf(i as f64 / (count - 1) as f64)).collect()
        };
        match self {
            Inner::Length => ratio(0.08 * span, 1.2 * span, 7),
            Inner::Scale => ratio(0.08 * span, 2.0 * span, 7),
            Inner::WaveNumber => (0..20).map(|i| (0.3 + 0.35 * f64::from(i)) * turn).collect(),
            Inner::Centre => (0..9).map(|i| lower + span * (0.1 + 0.1 * f64::from(i))).collect(),
            Inner::Exponent => vec![0.75, 1.25, 1.75, 2.25, 2.75, 3.25, 4.5, -0.5, -1.5, -2.5],
        }
    }

    /// The range that a number may take where it is refined.
    pub(super) fn bounds(self, lower: f64, upper: f64) -> (f64, f64) {
        let span = (upper - lower).max(f64::MIN_POSITIVE);
        let turn = std::f64::consts::TAU / span;
        match self {
            Inner::Length | Inner::Scale => (0.02 * span, 8.0 * span),
            Inner::WaveNumber => (0.1 * turn, 9.0 * turn),
            Inner::Centre => (lower, upper),
            Inner::Exponent => (-6.0, 8.0),
        }
    }
}

/// A function of one argument x and up to two inner numbers a and b.
pub(super) struct Shape {
    /// How it is written in a spec: `{x}` is the argument, `{a}` and `{b}` the inner numbers.
    pub(super) template: &'static str,
    /// Its inner numbers.
    pub(super) numbers: &'static [Inner],
    /// What the argument has to be.
    pub(super) needs: Needs,
    /// The whole power that it is, zero for another function.
    pub(super) power: i32,
    /// Whether textbooks are full of it: it is then cheaper to say.
    pub(super) common: bool,
    /// Value and derivative by the argument.
    pub(super) value: fn(f64, [f64; 2]) -> (f64, f64),
}

/// A power with a whole exponent.
const fn power(
    power: i32,
    template: &'static str,
    needs: Needs,
    value: fn(f64, [f64; 2]) -> (f64, f64),
) -> Shape {
    Shape { template, numbers: &[], needs, power, common: true, value }
}

/// Another function.
const fn shape(
    template: &'static str,
    numbers: &'static [Inner],
    needs: Needs,
    value: fn(f64, [f64; 2]) -> (f64, f64),
) -> Shape {
    Shape { template, numbers, needs, power: 0, common: false, value }
}

/// Another function that is common.
const fn common(
    template: &'static str,
    numbers: &'static [Inner],
    needs: Needs,
    value: fn(f64, [f64; 2]) -> (f64, f64),
) -> Shape {
    Shape { template, numbers, needs, power: 0, common: true, value }
}

/// |x|^e and its derivative.
fn absolute_power(x: f64, exponent: f64) -> (f64, f64) {
    let size = x.abs();
    (size.powf(exponent), exponent * size.powf(exponent - 1.0) * x.signum())
}

/// sech(x)^2, as a derivative of tanh.
fn beside_tanh(tanh: f64) -> f64 {
    1.0 - tanh * tanh
}

/// All shapes. A new one is one row here.
pub(super) static SHAPES: &[Shape] = &[
    power(1, "{x}", Needs::Nothing, |x, _| (x, 1.0)),
    power(2, "{x}^2", Needs::Nothing, |x, _| (x * x, 2.0 * x)),
    power(3, "{x}^3", Needs::Nothing, |x, _| (x.powi(3), 3.0 * x * x)),
    power(4, "{x}^4", Needs::Nothing, |x, _| (x.powi(4), 4.0 * x.powi(3))),
    power(5, "{x}^5", Needs::Nothing, |x, _| (x.powi(5), 5.0 * x.powi(4))),
    power(6, "{x}^6", Needs::Nothing, |x, _| (x.powi(6), 6.0 * x.powi(5))),
    power(7, "{x}^7", Needs::Nothing, |x, _| (x.powi(7), 7.0 * x.powi(6))),
    power(8, "{x}^8", Needs::Nothing, |x, _| (x.powi(8), 8.0 * x.powi(7))),
    power(-1, "{x}^(-1)", Needs::OneSign, |x, _| (1.0 / x, -1.0 / (x * x))),
    power(-2, "{x}^(-2)", Needs::OneSign, |x, _| (x.powi(-2), -2.0 * x.powi(-3))),
    power(-3, "{x}^(-3)", Needs::OneSign, |x, _| (x.powi(-3), -3.0 * x.powi(-4))),
    power(-4, "{x}^(-4)", Needs::OneSign, |x, _| (x.powi(-4), -4.0 * x.powi(-5))),
    power(-6, "{x}^(-6)", Needs::OneSign, |x, _| (x.powi(-6), -6.0 * x.powi(-7))),
    common("abs({x})", &[], Needs::BothSigns, |x, _| (x.abs(), x.signum())),
    shape("sign({x})", &[], Needs::BothSigns, |x, _| (x.signum(), 0.0)),
    common("{x}*abs({x})", &[], Needs::BothSigns, |x, _| (x * x.abs(), 2.0 * x.abs())),
    shape("abs({x})^3", &[], Needs::BothSigns, |x, _| absolute_power(x, 3.0)),
    shape("abs({x})^(1/3)", &[], Needs::BothSigns, |x, _| absolute_power(x, 1.0 / 3.0)),
    shape("abs({x})^(1/2)", &[], Needs::BothSigns, |x, _| absolute_power(x, 0.5)),
    common("abs({x})^(3/2)", &[], Needs::BothSigns, |x, _| absolute_power(x, 1.5)),
    shape("abs({x})^(5/2)", &[], Needs::BothSigns, |x, _| absolute_power(x, 2.5)),
    shape("abs({x})^(7/2)", &[], Needs::BothSigns, |x, _| absolute_power(x, 3.5)),
    common("abs({x})^{a}", &[Inner::Exponent], Needs::BothSigns, |x, [a, _]| absolute_power(x, a)),
    common("sqrt({x})", &[], Needs::Positive, |x, _| (x.sqrt(), 0.5 / x.sqrt())),
    common("{x}^(3/2)", &[], Needs::Positive, |x, _| (x.powf(1.5), 1.5 * x.sqrt())),
    shape("{x}^(5/2)", &[], Needs::Positive, |x, _| (x.powf(2.5), 2.5 * x.powf(1.5))),
    common("{x}^(-1/2)", &[], Needs::Positive, |x, _| (x.powf(-0.5), -0.5 * x.powf(-1.5))),
    common("{x}^(-3/2)", &[], Needs::Positive, |x, _| (x.powf(-1.5), -1.5 * x.powf(-2.5))),
    shape("{x}^(-5/2)", &[], Needs::Positive, |x, _| (x.powf(-2.5), -2.5 * x.powf(-3.5))),
    common("{x}^{a}", &[Inner::Exponent], Needs::Positive, |x, [a, _]| {
        (x.powf(a), a * x.powf(a - 1.0))
    }),
    common("log({x})", &[], Needs::Positive, |x, _| (x.ln(), 1.0 / x)),
    shape("log(abs({x}))", &[], Needs::BothSigns, |x, _| (x.abs().ln(), 1.0 / x)),
    shape("log(1 + abs({x}))", &[], Needs::BothSigns, |x, _| {
        (x.abs().ln_1p(), x.signum() / (1.0 + x.abs()))
    }),
    shape("log(1 + {x}^2)", &[], Needs::Nothing, |x, _| {
        ((1.0 + x * x).ln(), 2.0 * x / (1.0 + x * x))
    }),
    shape("log(1 + ({x}/{a})^2)", &[Inner::Length], Needs::Nothing, |x, [a, _]| {
        ((1.0 + (x / a).powi(2)).ln(), 2.0 * x / (a * a + x * x))
    }),
    common("exp({x})", &[], Needs::Nothing, |x, _| (x.exp(), x.exp())),
    common("exp(-{x})", &[], Needs::Nothing, |x, _| ((-x).exp(), -(-x).exp())),
    shape("exp(-{x}/2)", &[], Needs::Nothing, |x, _| ((-x / 2.0).exp(), -(-x / 2.0).exp() / 2.0)),
    shape("exp(-2*{x})", &[], Needs::Nothing, |x, _| ((-2.0 * x).exp(), -2.0 * (-2.0 * x).exp())),
    common("exp({x}/{a})", &[Inner::Scale], Needs::Nothing, |x, [a, _]| {
        ((x / a).exp(), (x / a).exp() / a)
    }),
    common("exp(-{x}/{a})", &[Inner::Scale], Needs::Nothing, |x, [a, _]| {
        ((-x / a).exp(), -(-x / a).exp() / a)
    }),
    shape("exp(-abs({x}))", &[], Needs::BothSigns, |x, _| {
        ((-x.abs()).exp(), -x.signum() * (-x.abs()).exp())
    }),
    shape("exp(-abs({x})/{a})", &[Inner::Scale], Needs::BothSigns, |x, [a, _]| {
        ((-x.abs() / a).exp(), -x.signum() * (-x.abs() / a).exp() / a)
    }),
    common("exp(-{x}^2)", &[], Needs::Nothing, |x, _| ((-x * x).exp(), -2.0 * x * (-x * x).exp())),
    shape("exp(-{x}^2/2)", &[], Needs::Nothing, |x, _| {
        ((-x * x / 2.0).exp(), -x * (-x * x / 2.0).exp())
    }),
    common("exp(-({x}/{a})^2)", &[Inner::Length], Needs::Nothing, |x, [a, _]| {
        let bump = (-(x / a).powi(2)).exp();
        (bump, -2.0 * x / (a * a) * bump)
    }),
    shape(
        "exp(-(({x} - {a})/{b})^2)",
        &[Inner::Centre, Inner::Length],
        Needs::Nothing,
        |x, [a, b]| {
            let bump = (-((x - a) / b).powi(2)).exp();
            (bump, -2.0 * (x - a) / (b * b) * bump)
        },
    ),
    common("sin({x})", &[], Needs::Nothing, |x, _| (x.sin(), x.cos())),
    common("cos({x})", &[], Needs::Nothing, |x, _| (x.cos(), -x.sin())),
    shape("sin(2*{x})", &[], Needs::Nothing, |x, _| ((2.0 * x).sin(), 2.0 * (2.0 * x).cos())),
    shape("cos(2*{x})", &[], Needs::Nothing, |x, _| ((2.0 * x).cos(), -2.0 * (2.0 * x).sin())),
    shape("sin(3*{x})", &[], Needs::Nothing, |x, _| ((3.0 * x).sin(), 3.0 * (3.0 * x).cos())),
    shape("cos(3*{x})", &[], Needs::Nothing, |x, _| ((3.0 * x).cos(), -3.0 * (3.0 * x).sin())),
    shape("sin(4*{x})", &[], Needs::Nothing, |x, _| ((4.0 * x).sin(), 4.0 * (4.0 * x).cos())),
    shape("cos(4*{x})", &[], Needs::Nothing, |x, _| ((4.0 * x).cos(), -4.0 * (4.0 * x).sin())),
    common("sin({a}*{x})", &[Inner::WaveNumber], Needs::Nothing, |x, [a, _]| {
        ((a * x).sin(), a * (a * x).cos())
    }),
    common("cos({a}*{x})", &[Inner::WaveNumber], Needs::Nothing, |x, [a, _]| {
        ((a * x).cos(), -a * (a * x).sin())
    }),
    common("tanh({x})", &[], Needs::BothSigns, |x, _| (x.tanh(), beside_tanh(x.tanh()))),
    common("tanh({x}/{a})", &[Inner::Length], Needs::BothSigns, |x, [a, _]| {
        ((x / a).tanh(), beside_tanh((x / a).tanh()) / a)
    }),
    shape("tanh(({x} - {a})/{b})", &[Inner::Centre, Inner::Length], Needs::Nothing, |x, [a, b]| {
        let tanh = ((x - a) / b).tanh();
        (tanh, beside_tanh(tanh) / b)
    }),
    shape("log(cosh({x}))", &[], Needs::Nothing, |x, _| (x.cosh().ln(), x.tanh())),
    shape("1/cosh({x})^2", &[], Needs::Nothing, |x, _| {
        let tanh = x.tanh();
        (beside_tanh(tanh), -2.0 * tanh * beside_tanh(tanh))
    }),
    shape("atan({x})", &[], Needs::Nothing, |x, _| (x.atan(), 1.0 / (1.0 + x * x))),
    common("1/(1 + {x}^2)", &[], Needs::Nothing, |x, _| {
        let under = 1.0 / (1.0 + x * x);
        (under, -2.0 * x * under * under)
    }),
    shape("1/(1 + {x}^2)^2", &[], Needs::Nothing, |x, _| {
        let under = 1.0 / (1.0 + x * x);
        (under * under, -4.0 * x * under.powi(3))
    }),
    common("1/(1 + ({x}/{a})^2)", &[Inner::Length], Needs::Nothing, |x, [a, _]| {
        let under = 1.0 / (1.0 + (x / a).powi(2));
        (under, -2.0 * x / (a * a) * under * under)
    }),
    shape("1/(1 + {x})", &[], Needs::Positive, |x, _| (1.0 / (1.0 + x), -(1.0 + x).powi(-2))),
    shape("1/({a} + {x})", &[Inner::Length], Needs::Positive, |x, [a, _]| {
        (1.0 / (a + x), -(a + x).powi(-2))
    }),
    shape("1/(1 + abs({x}))", &[], Needs::BothSigns, |x, _| {
        let under = 1.0 / (1.0 + x.abs());
        (under, -x.signum() * under * under)
    }),
    common("sqrt(1 + {x}^2)", &[], Needs::Nothing, |x, _| {
        let root = (1.0 + x * x).sqrt();
        (root, x / root)
    }),
    common("sqrt({a}^2 + {x}^2)", &[Inner::Length], Needs::Nothing, |x, [a, _]| {
        let root = (a * a + x * x).sqrt();
        (root, x / root)
    }),
    shape("1/sqrt(1 + {x}^2)", &[], Needs::Nothing, |x, _| {
        let root = (1.0 + x * x).sqrt();
        (1.0 / root, -x / root.powi(3))
    }),
    common("1/sqrt({a}^2 + {x}^2)", &[Inner::Length], Needs::Nothing, |x, [a, _]| {
        let root = (a * a + x * x).sqrt();
        (1.0 / root, -x / root.powi(3))
    }),
];

impl Shape {
    /// Whether it can be asked of an argument between `lower` and `upper`.
    pub(super) fn suits(&self, lower: f64, upper: f64) -> bool {
        match self.needs {
            Needs::Nothing => true,
            Needs::OneSign => lower > 0.0 || upper < 0.0,
            Needs::Positive => lower > 0.0,
            Needs::BothSigns => lower < 0.0 && upper > 0.0,
        }
    }

    /// Description length in nats among all shapes.
    pub(super) fn length(&self) -> f64 {
        let ln_2 = std::f64::consts::LN_2;
        if self.power != 0 {
            let negative = if self.power < 0 { ln_2 } else { 0.0 };
            return ln_2 * f64::from(self.power.abs()) + negative;
        }
        let alike = SHAPES.iter().filter(|s| s.power == 0 && s.common == self.common).count();
        // A power, a common function, another one: the code says so with one, two and three bits.
        (alike as f64).ln() + if self.common { 2.0 * ln_2 } else { 3.0 * ln_2 }
    }

    /// Whether it only takes a factor when its argument is measured in another unit.
    pub(super) fn is_homogeneous(&self) -> bool {
        let ratio = |x: f64| (self.value)(2.0 * x, [0.0; 2]).0 / (self.value)(x, [0.0; 2]).0;
        self.numbers.is_empty() && (ratio(0.6) / ratio(1.1) - 1.0).abs() < 1e-9
    }

    /// Whether it is dimensionless in an argument that has a unit, its inner numbers having units
    /// of their own.
    pub(super) fn has_lengths(&self) -> bool {
        let length = |inner: &Inner| !matches!(inner, Inner::Exponent);
        !self.numbers.is_empty() && self.numbers.iter().all(length)
    }

    /// Its text with an argument; `name` says whether the argument is a plain name. The inner
    /// numbers keep their braces, by the names of `numbers`.
    pub(super) fn text(&self, argument: &str, name: bool, numbers: &[String]) -> String {
        // Inside the parentheses of a function of x alone no others are needed.
        let alone = self.template.contains("({x})");
        let wrapped = format!("({argument})");
        let bare = name || self.template == "{x}";
        let mut text = self.template.to_string();
        if alone {
            text = text.replace("({x})", &wrapped);
        }
        text = text.replace("{x}", if bare { argument } else { &wrapped });
        for (place, number) in ["{a}", "{b}"].iter().zip(numbers) {
            text = text.replace(place, &format!("{{{number}}}"));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_values() {
        let numbers = [0.7, 1.3];
        for shape in SHAPES {
            let points: &[f64] = match shape.needs {
                Needs::OneSign | Needs::Positive => &[0.4, 1.1, 2.3],
                Needs::Nothing | Needs::BothSigns => &[-1.7, -0.4, 0.3, 1.9],
            };
            for &x in points {
                let step = 1e-5;
                let at = |x: f64| (shape.value)(x, numbers).0;
                let by_difference = (at(x + step) - at(x - step)) / (2.0 * step);
                let slope = (shape.value)(x, numbers).1;
                let close = 1e-6 * (1.0 + slope.abs());
                assert!((slope - by_difference).abs() < close, "{} at {x}", shape.template);
            }
        }
    }

    #[test]
    fn parentheses_stand_where_they_are_needed() {
        let text = |template: &str, argument: &str, name: bool| {
            let shape = SHAPES.iter().find(|shape| shape.template == template);
            shape.map(|shape| shape.text(argument, name, &["n1".to_string()]))
        };
        assert_eq!(text("{x}^2", "q", true).as_deref(), Some("q^2"));
        assert_eq!(text("{x}^2", "q + p", false).as_deref(), Some("(q + p)^2"));
        assert_eq!(text("sin({x})", "q + p", false).as_deref(), Some("sin(q + p)"));
        assert_eq!(text("sin({a}*{x})", "q", true).as_deref(), Some("sin({n1}*q)"));
    }

    #[test]
    fn powers_alone_are_homogeneous() {
        let of = |template: &str| {
            let shape = SHAPES.iter().find(|shape| shape.template == template);
            shape.map(Shape::is_homogeneous)
        };
        for template in ["{x}", "{x}^3", "{x}^(-2)", "abs({x})^(3/2)", "{x}*abs({x})", "sqrt({x})"]
        {
            assert_eq!(of(template), Some(true), "{template}");
        }
        for template in ["exp({x})", "1/(1 + {x}^2)", "sin(2*{x})", "log({x})", "abs({x})^{a}"] {
            assert_eq!(of(template), Some(false), "{template}");
        }
    }
}
