//! Effects on bodies: points that move in a plane or in space.
//!
//! Velocities stand as momenta: for a body whose coordinates have one mass m, a coefficient that
//! multiplies the n-th power of the momentum is that of the velocity over m to the n.

use super::{ActsOn, EffectKind, EffectRow, ROW, Scan, ScanBy};

const CENTRAL: EffectRow =
    EffectRow { kind: EffectKind::Conservative, on: ActsOn::Body, why_two: CENTRE, ..ROW };
const BETWEEN: EffectRow =
    EffectRow { kind: EffectKind::Conservative, on: ActsOn::BodyPair, why_two: TWO, ..ROW };
const ALONG: EffectRow = EffectRow {
    kind: EffectKind::Dissipative,
    on: ActsOn::Body,
    positive: true,
    why_two: VELOCITY,
    ..ROW
};

const CENTRE: &str = "it goes with the distance of a body from the origin";
const TWO: &str = "it goes with the distance of two bodies";
const VELOCITY: &str = "it is along the velocity of a body, in a plane or in space";

const LENGTH: &[Scan] = &[Scan { name: "length", by: ScanBy::Length, example: 0.5 }];
const RANGE: &[Scan] = &[Scan { name: "length", by: ScanBy::Range, example: 0.5 }];
const POWER: &[Scan] = &[Scan { name: "exponent", by: ScanBy::Power, example: 1.5 }];

pub(super) static ROWS: &[EffectRow] = &[
    EffectRow {
        name: "drag_along_velocity",
        aliases: &["vector_drag"],
        template: "force {q} += span{ {n}: -sqrt({pp})*{p} }",
        physics: "A drag against the velocity of a body, in proportion to the square of its speed: air on a ball. The coefficient is that of the momenta: of the speed, over the square of the mass.",
        telltale: "The residual force is against the path, and grows with the square of the speed; motion along one axis is braked by that along the others.",
        reference: "Batchelor, An Introduction to Fluid Dynamics, section 5.11",
        ..ALONG
    },
    EffectRow {
        name: "cubic_drag_along_velocity",
        template: "force {q} += span{ {n}: -{pp}*{p} }",
        physics: "A drag against the velocity of a body, in proportion to the cube of its speed; of the momenta, over the cube of the mass.",
        telltale: "Only the fastest parts of a path are braked, and against the path.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 3.3",
        ..ALONG
    },
    EffectRow {
        name: "friction_along_velocity",
        aliases: &["sliding_friction"],
        template: "force {q} += span{ {n}: -{p}/sqrt({pp}) }",
        physics: "Dry friction of a body that slides on a table: a force of fixed size against the velocity.",
        telltale: "Paths end in a straight line; the residual force has one size and is against the path.",
        reference: "C. A. Coulomb, Theorie des machines simples (1785)",
        ..ALONG
    },
    EffectRow {
        name: "poynting_robertson_drag",
        template: "force {q} += span{ {n}: -({p} + {qp}*{q}/{qq})/{qq} }",
        why_two: "it goes with the distance of a body from the origin",
        physics: "The drag of a star's light on a grain of dust about it: like 1/r^2, and twice as strong along the line to the star.",
        telltale: "Orbits shrink and become round; the residual force is against the velocity and largest near the origin.",
        reference: "Burns, Lamy and Soter, Icarus 40, 1 (1979)",
        ..ALONG
    },
    EffectRow {
        name: "radiation_damping",
        aliases: &["radiation_reaction"],
        template: "force {q} += span{ {n}: -({p} - 3*{qp}*{q}/{qq})/{qq}^(3/2) }",
        why_two: "it goes with the distance of a body from the origin",
        physics: "What a charge loses by radiation on its orbit about another: the rate of change of a force like 1/r^2, times a short time.",
        telltale: "Orbits shrink faster and faster; the residual force brakes across the line to the origin, and pushes along it.",
        reference: "Landau and Lifshitz, The Classical Theory of Fields, section 75",
        ..ALONG
    },
    EffectRow {
        name: "central_linear",
        template: "V += span{ {n}: sqrt({qq}) }",
        physics: "A pull of fixed size to the origin: a thread over a pulley with a weight on it.",
        telltale: "The residual force points to the origin and has one size.",
        reference: "Goldstein, Classical Mechanics, section 3.6",
        ..CENTRAL
    },
    EffectRow {
        name: "central_quartic",
        aliases: &["ring"],
        template: "V += span{ {n}: {qq}^2/4 }",
        physics: "A spring to the origin that hardens with distance, the same in every direction.",
        telltale: "The residual force points to the origin and grows with the cube of the distance.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 6.2",
        ..CENTRAL
    },
    EffectRow {
        name: "central_sextic",
        template: "V += span{ {n}: {qq}^3/6 }",
        physics: "A spring to the origin that hardens only far out, the same in every direction.",
        telltale: "The residual force points to the origin and grows with the fifth power of the distance.",
        reference: "Nayfeh and Mook, Nonlinear Oscillations, section 6.2",
        ..CENTRAL
    },
    EffectRow {
        name: "central_logarithm",
        template: "V += span{ {n}: log({qq}/{one}^2)/2 }",
        physics: "A pull to the origin like 1/r: a charged wire across the plane, or a galaxy whose curve of rotation is flat.",
        telltale: "The residual force points to the origin and falls like the inverse of the distance.",
        reference: "Binney and Tremaine, Galactic Dynamics, section 2.2",
        ..CENTRAL
    },
    EffectRow {
        name: "central_inverse_cube",
        aliases: &["oblate_centre"],
        template: "V += span{ {n}: -1/{qq}^(3/2) }",
        physics: "A potential like 1/r^3 about the origin: the bulge of a planet that turns, felt in the plane of its equator.",
        telltale: "Orbits precess, the faster the nearer; the residual force falls like 1/r^4.",
        reference: "Murray and Dermott, Solar System Dynamics, section 6.11",
        ..CENTRAL
    },
    EffectRow {
        name: "central_magnet",
        template: "V += span{ {n}: ({qq} - 2*{length}^2)/({qq} + {length}^2)^(5/2) }",
        parameters: LENGTH,
        physics: "A magnet that moves in a plane above another at the origin, at the distance of a length: two dipoles that point across the plane.",
        telltale: "The residual force pulls to the origin when near, and pushes away beyond twice the length.",
        reference: "Jackson, Classical Electrodynamics, section 5.7",
        ..CENTRAL
    },
    EffectRow {
        name: "central_power",
        template: "V += span{ {n}: ({qq}/{one}^2)^({exponent}/2)/{exponent} }",
        parameters: POWER,
        physics: "A potential to the origin that is some power of the distance, over that power.",
        telltale: "The residual force points to the origin; against the distance it is a straight line on paper with two logarithmic scales.",
        reference: "Landau and Lifshitz, Mechanics, section 14",
        ..CENTRAL
    },
    EffectRow {
        name: "central_yukawa",
        template: "V += span{ {n}: -exp(-sqrt({qq})/{length})/sqrt({qq}) }",
        parameters: RANGE,
        physics: "A pull of the origin that is screened beyond some length.",
        telltale: "The residual force points to the origin and falls faster than any power of the distance.",
        reference: "H. Yukawa, Proc. Phys. Math. Soc. Japan 17, 48 (1935)",
        ..CENTRAL
    },
    EffectRow {
        name: "screening_of_centre",
        template: "V += span{ {n}: (1 - exp(-sqrt({qq})/{length}))/sqrt({qq}) }",
        parameters: RANGE,
        physics: "A pull of the origin that is known near to it and is screened beyond some length: what the screen takes away of k/r, where the coefficient is k.",
        telltale: "The residual force points away from the origin; beside a known pull like 1/r^2 it is small near the origin and as large as the pull far out.",
        reference: "P. Debye and E. Hückel, Physikalische Zeitschrift 24, 185 (1923)",
        ..CENTRAL
    },
    EffectRow {
        name: "gravity_between",
        aliases: &["newton_gravity", "coulomb_between"],
        template: "V += span{ {n}: -1/sqrt({dd}) }",
        physics: "Gravity or an electric force between two bodies: like 1/r^2.",
        telltale: "Residual forces on two bodies are opposite, along the line between them, and largest when they are near.",
        reference: "Landau and Lifshitz, Mechanics, section 13",
        positive: true,
        ..BETWEEN
    },
    EffectRow {
        name: "softened_gravity",
        template: "V += span{ {n}: -1/sqrt({dd} + {length}^2) }",
        parameters: LENGTH,
        physics: "Gravity between two bodies of some extent: it vanishes where they fall together.",
        telltale: "Residual forces along the line between two bodies are largest at some distance.",
        reference: "H. C. Plummer, Mon. Not. R. Astron. Soc. 71, 460 (1911)",
        positive: true,
        ..BETWEEN
    },
    EffectRow {
        name: "inverse_square_between",
        template: "V += span{ {n}: -1/{dd} }",
        physics: "A potential like 1/r^2 between two bodies: of a charge and a dipole that follows it, or the first correction to gravity.",
        telltale: "The orbit of two bodies about each other precesses at a steady rate.",
        reference: "Landau and Lifshitz, Mechanics, section 15",
        ..BETWEEN
    },
    EffectRow {
        name: "spring_between",
        template: "V += span{ {n}: {dd}/2 }",
        physics: "A spring without length between two bodies.",
        telltale: "Residual forces on two bodies are opposite and go with the distance between them.",
        reference: "Landau and Lifshitz, Mechanics, section 13",
        ..BETWEEN
    },
    EffectRow {
        name: "elastic_rod_between",
        aliases: &["tether"],
        template: "V += span{ {n}: (sqrt({dd}) - {length})^2/2 }",
        parameters: LENGTH,
        physics: "A spring of some length at rest between two bodies: a rod, a tether, a bond.",
        telltale: "Residual forces along the line between two bodies change sign at some distance.",
        reference: "Landau and Lifshitz, Mechanics, section 24",
        ..BETWEEN
    },
    EffectRow {
        name: "logarithm_between",
        template: "V += span{ {n}: log({dd}/{one}^2)/2 }",
        physics: "A force like 1/r between two bodies: two charged wires, two vortices.",
        telltale: "Residual forces along the line between two bodies fall like the inverse of the distance.",
        reference: "Jackson, Classical Electrodynamics, section 2.10",
        ..BETWEEN
    },
    EffectRow {
        name: "power_law_between",
        template: "V += span{ {n}: ({dd}/{one}^2)^({exponent}/2)/{exponent} }",
        parameters: POWER,
        physics: "A potential between two bodies that is some power of their distance, over that power.",
        telltale: "Against the distance, the residual force along the line between two bodies is straight on paper with two logarithmic scales.",
        reference: "Landau and Lifshitz, Mechanics, section 14",
        ..BETWEEN
    },
    EffectRow {
        name: "yukawa_between",
        template: "V += span{ {n}: -exp(-sqrt({dd})/{length})/sqrt({dd}) }",
        parameters: RANGE,
        physics: "A force between two bodies that is screened beyond some length: charges in a plasma, a fifth force.",
        telltale: "Residual forces along the line between two bodies fall faster than any power of the distance.",
        reference: "H. Yukawa, Proc. Phys. Math. Soc. Japan 17, 48 (1935)",
        ..BETWEEN
    },
    EffectRow {
        name: "screening_between",
        template: "V += span{ {n}: (1 - exp(-sqrt({dd})/{length}))/sqrt({dd}) }",
        parameters: RANGE,
        physics: "A force like 1/r^2 between two bodies that is known and is screened beyond some length: what the screen takes away of k/r, where the coefficient is k.",
        telltale: "Residual forces along the line between two bodies are against the known pull, and as large as it when they are far apart.",
        reference: "P. Debye and E. Hückel, Physikalische Zeitschrift 24, 185 (1923)",
        ..BETWEEN
    },
    EffectRow {
        name: "damping_between",
        template: "force {q} += span{ {n}: {s} - {p} }; force {r} += span{ {n}: {p} - {s} }",
        why_two: "it damps the motion of one body against another",
        physics: "A damper between two bodies of equal mass: equal and opposite forces against their relative velocity.",
        telltale: "Relative motion of two bodies dies out while common motion goes on.",
        reference: "Rayleigh, The Theory of Sound, section 81",
        kind: EffectKind::Dissipative,
        positive: true,
        ..BETWEEN
    },
];
