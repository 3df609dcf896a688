//! What is hidden beside single effects: groups, wrong numbers, and partners that nobody measures.

/// One effect with one coefficient: base, effect, coordinates.
pub(crate) static GROUPS: &[(&str, &str, &[&str])] = &[
    ("trap", "viscous_drag", &["x", "y"]),
    ("trap", "coulomb_friction", &["x", "y"]),
    ("trap", "cubic_stiffness", &["x", "y"]),
    ("trap", "quadratic_drag", &["x", "y"]),
    ("trap", "drag_along_velocity", &["x", "y"]),
    ("trap", "friction_along_velocity", &["x", "y"]),
    ("trap", "central_quartic", &["x", "y"]),
    ("Kepler", "viscous_drag", &["x", "y"]),
    ("Kepler", "drag_along_velocity", &["x", "y"]),
    ("Henon-Heiles", "viscous_drag", &["x", "y"]),
    ("Henon-Heiles", "cubic_stiffness", &["x", "y"]),
    ("two bodies", "viscous_drag", &["x1", "y1", "x2", "y2"]),
    ("two bodies", "quadratic_drag", &["x1", "y1", "x2", "y2"]),
    ("two bodies", "drag_along_velocity", &["x1", "y1"]),
    ("two bodies", "central_quartic", &["x2", "y2"]),
    ("two bodies", "viscous_drag", &["x1", "y1"]),
    ("chain", "viscous_drag", &["q[1]", "q[2]", "q[3]", "q[4]", "q[5]"]),
    ("chain", "cubic_stiffness", &["q[1]", "q[2]", "q[3]", "q[4]", "q[5]"]),
];

/// A known number that is wrong.
pub(crate) struct Number {
    /// Name of the base.
    pub base: &'static str,
    /// Name of the constant.
    pub name: &'static str,
    /// What the spec says that it is.
    pub was: f64,
    /// The law, with the constant in it.
    pub law: &'static str,
}

/// Numbers that are wrong.
pub(crate) static NUMBERS: &[Number] = &[
    Number { base: "pendulum", name: "gravity", was: 1.0, law: "T = p^2/2\nV = -gravity*cos(q)\n" },
    Number {
        base: "pendulum",
        name: "inertia",
        was: 1.0,
        law: "T = p^2/(2*inertia)\nV = -cos(q)\n",
    },
    Number { base: "Duffing", name: "beta", was: 1.0, law: "T = p^2/2\nV = q^2/2 + beta*q^4/4\n" },
    Number { base: "Duffing", name: "k", was: 1.0, law: "T = p^2/2\nV = k*q^2/2 + q^4/4\n" },
    Number {
        base: "trap",
        name: "m",
        was: 1.0,
        law: "T = px^2/(2*m) + py^2/2\nV = x^2/2 + 0.7*y^2\n",
    },
    Number { base: "trap", name: "b", was: 1.4, law: "T = (px^2 + py^2)/2\nV = x^2/2 + b*y^2/2\n" },
    Number {
        base: "Kepler",
        name: "gm",
        was: 1.0,
        law: "T = (px^2 + py^2)/2\nV = -gm/sqrt(x^2 + y^2)\n",
    },
    Number {
        base: "Kepler",
        name: "exponent",
        was: 1.0,
        law: "T = (px^2 + py^2)/2\nV = -1/(x^2 + y^2)^(exponent/2)\n",
    },
    Number {
        base: "two bodies",
        name: "m2",
        was: 1.0,
        law: "T = (px1^2 + py1^2)/2 + (px2^2 + py2^2)/(2*m2)\n\
              V = (x1^2 + y1^2)/2 + 0.6*(x2^2 + y2^2)\n",
    },
    Number {
        base: "Henon-Heiles",
        name: "lambda",
        was: 1.0,
        law: "T = (px^2 + py^2)/2\nV = (x^2 + y^2)/2 + lambda*x^2*y - y^3/3\n",
    },
    Number {
        base: "chain",
        name: "k",
        was: 1.0,
        law: "T = sum(p[i]^2/2 for i in 1..5)\n\
              V = q[1]^2/2 + sum(k*(q[i+1] - q[i])^2/2 for i in 1..4) + q[5]^2/2\n",
    },
];

/// Something that moves too, and that nobody measures: a coordinate of its own.
pub(crate) struct Partner {
    /// What it is.
    pub name: &'static str,
    /// Name of the base.
    pub base: &'static str,
    /// The whole law; `STRENGTH` stands for what couples it.
    pub law: &'static str,
    /// Where its coordinates start, and then its momenta; no numbers where it has none.
    pub starts: &'static [(f64, f64)],
}

/// Hidden partners; the last have no coordinate of their own, but a law beyond any single term.
pub(crate) static PARTNERS: &[Partner] = &[
    Partner {
        name: "hidden oscillator",
        base: "trap",
        law: "T = (px^2 + py^2 + ph^2)/2\nV = x^2/2 + 0.7*y^2 + 0.9*h^2 + STRENGTH*h*x\n",
        starts: &[(-1.0, 1.0), (-1.0, 1.0)],
    },
    Partner {
        name: "hidden oscillator",
        base: "Duffing",
        law: "T = p^2/2 + ph^2/2\nV = q^2/2 + q^4/4 + 1.1*h^2 + STRENGTH*h*q\n",
        starts: &[(-1.0, 1.0), (-1.0, 1.0)],
    },
    Partner {
        name: "hidden pendulum",
        base: "pendulum",
        law: "T = p^2/2 + ph^2/2\nV = -cos(q) - 1.7*cos(h) + STRENGTH*(q - h)^2/2\n",
        starts: &[(-1.8, 1.8), (-1.2, 1.2)],
    },
    Partner {
        name: "hidden oscillator, nonlinear",
        base: "Henon-Heiles",
        law: "T = (px^2 + py^2 + ph^2)/2\n\
              V = (x^2 + y^2)/2 + x^2*y - y^3/3 + 0.8*h^2 + STRENGTH*h^2*y\n",
        starts: &[(-1.0, 1.0), (-1.0, 1.0)],
    },
    Partner {
        name: "hidden mass on the chain",
        base: "chain",
        law: "T = sum(p[i]^2/2 for i in 1..5) + ph^2/2\n\
              V = q[1]^2/2 + sum((q[i+1] - q[i])^2/2 for i in 1..4) + q[5]^2/2 + 0.3*h^2 \
              + STRENGTH*(h - q[3])^2/2\n",
        starts: &[(-1.0, 1.0), (-0.5, 0.5)],
    },
    Partner {
        name: "memory",
        base: "pendulum",
        law: "T = p^2/2 + ph^2/2\nV = -cos(q) + 0.4*h^2 + STRENGTH*(q - h)^2/2\n\
              force h += -4*ph\n",
        starts: &[(-0.1, 0.1), (-0.1, 0.1)],
    },
];
