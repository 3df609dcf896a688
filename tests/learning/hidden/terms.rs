//! What is hidden: small expressions, some by hand, some drawn at random.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::bases::{Base, base};

/// A term that is hidden in a system.
pub(crate) struct Hidden {
    pub base: &'static Base,
    pub statement: String,
}

static OSCILLATOR: Base = Base {
    name: "oscillator",
    variables: "coordinates q\nmomenta p\n",
    law: "T = p^2/2\nV = q^2/2\n",
    space: "T = p^2/2\nV = span{ q^2 }\n",
    starts: &[(-1.8, 1.8), (-1.2, 1.2)],
    step: 0.1,
    hidden: &[],
};

static BODIES: Base = Base {
    name: "two stars",
    variables: "coordinates x1, y1, x2, y2\nmomenta p1, s1, p2, s2\n",
    law: "T = (p1^2 + s1^2 + p2^2 + s2^2)/2\nV = -1/sqrt((x1 - x2)^2 + (y1 - y2)^2)\n",
    space: "T = (p1^2 + s1^2 + p2^2 + s2^2)/2\n\
            V = span{ 1/sqrt((x1 - x2)^2 + (y1 - y2)^2) }\n",
    starts: &[
        (0.6, 0.9),
        (-0.2, 0.2),
        (-0.9, -0.6),
        (-0.2, 0.2),
        (-0.1, 0.1),
        (0.45, 0.65),
        (-0.1, 0.1),
        (-0.65, -0.45),
    ],
    step: 0.1,
    hidden: &[],
};

/// The system with this name: one that is made for these terms, or of the benchmark.
fn system(name: &str) -> &'static Base {
    let own = [&OSCILLATOR, &BODIES].into_iter().find(|own| own.name == name);
    own.unwrap_or_else(|| base(name))
}

/// Terms by hand, each in a system.
const BY_HAND: &[(&str, &str)] = &[
    ("trap", "V += span{ hidden: x^2*y^2 }"),
    ("trap", "V += span{ hidden: (x^2 + y^2)^2 }"),
    ("pendulum", "V += span{ hidden: exp(-q^2) }"),
    ("oscillator", "V += span{ hidden: q*sin(2*q) }"),
    ("oscillator", "V += span{ hidden: 1/(1 + q^2) }"),
    ("pendulum", "V += span{ hidden: abs(q)^(3/2) }"),
    ("oscillator", "force q += span{ hidden: -q^2*p }"),
    ("oscillator", "H += span{ hidden: q^2*p }"),
    (
        "two stars",
        "V += span{ hidden: exp(-sqrt((x1 - x2)^2 + (y1 - y2)^2))/sqrt((x1 - x2)^2 + (y1 - y2)^2) }",
    ),
    ("pendulum", "force q += span{ hidden: -tanh(p/0.3) }"),
    ("trap", "V += span{ hidden: exp(-(x^2 + y^2)/0.5) }"),
    ("Kepler", "V += span{ hidden: (x^2 + y^2)^(-3/2) }"),
    ("trap", "force x += span{ hidden: -x^2*px }"),
    ("Kepler", "V += span{ hidden: x*y/(x^2 + y^2)^(5/2) }"),
    ("trap", "V += span{ hidden: cos(2*(x - y)) }"),
    ("oscillator", "V += span{ hidden: sqrt(0.3^2 + q^2) }"),
];

/// Terms in all.
const COUNT: usize = 30;

/// All hidden terms: those by hand, and others drawn at random with a fixed seed.
pub(crate) fn hidden_terms() -> Vec<Hidden> {
    let mut all: Vec<Hidden> = BY_HAND
        .iter()
        .map(|&(name, term)| Hidden { base: system(name), statement: term.to_string() })
        .collect();
    let mut generator = Pcg64::seed_from_u64(1846);
    while all.len() < COUNT {
        let hidden = random(&mut generator);
        if !all.iter().any(|other| other.statement == hidden.statement) {
            all.push(hidden);
        }
    }
    all
}

/// A function of an argument, by a draw.
fn function(generator: &mut Pcg64, x: &str) -> String {
    let number = |generator: &mut Pcg64, a: f64, b: f64| {
        (generator.random_range(a..b) * 100.0f64).round() / 100.0
    };
    match generator.random_range(0..10) {
        0 => format!("sin({}*{x})", number(generator, 1.4, 4.0)),
        1 => format!("cos({}*{x})", number(generator, 1.4, 4.0)),
        2 => format!("exp(-({x}/{})^2)", number(generator, 0.3, 1.0)),
        3 => format!("exp({x}/{})", number(generator, 0.6, 2.0)),
        4 => format!("1/(1 + ({x}/{})^2)", number(generator, 0.3, 1.0)),
        5 => format!("abs({x})^{}", number(generator, 1.3, 2.7)),
        6 => format!("tanh({x}/{})", number(generator, 0.2, 0.8)),
        7 => format!("sqrt({}^2 + {x}^2)", number(generator, 0.2, 0.8)),
        8 => format!("log(1 + ({x}/{})^2)", number(generator, 0.3, 1.0)),
        _ => format!("{x}^{}", generator.random_range(3..6)),
    }
}

/// A random small expression in a random system.
fn random(generator: &mut Pcg64) -> Hidden {
    let names = ["pendulum", "oscillator", "trap"];
    let base = system(names[generator.random_range(0..names.len())]);
    let (coordinates, momenta): (&[&str], &[&str]) =
        if base.starts.len() == 2 { (&["q"], &["p"]) } else { (&["x", "y"], &["px", "py"]) };
    let draw =
        |generator: &mut Pcg64, of: &[&str]| of[generator.random_range(0..of.len())].to_string();
    let q = draw(generator, coordinates);
    let p = draw(generator, momenta);
    let f = function(generator, &q);
    let statement = match generator.random_range(0..4) {
        0 => format!("V += span{{ hidden: {f} }}"),
        1 => {
            let other = coordinates.last().copied().unwrap_or("q");
            format!("V += span{{ hidden: {other}*{f} }}")
        }
        2 => format!("force {q} += span{{ hidden: -{p}*{f} }}"),
        _ => {
            let f = function(generator, &p);
            format!("force {q} += span{{ hidden: -{f}*{q}^2 }}")
        }
    };
    Hidden { base, statement }
}
